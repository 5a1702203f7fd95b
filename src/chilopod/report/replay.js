"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { time, floor, scale, body, colors } = data;
  const byId = (id) => document.getElementById(id);
  const play = byId("play"), scrub = byId("scrub"), clock = byId("clock"), speed = byId("speed"), follow = byId("follow");
  const panels = byId("panels");
  const values = 2 * (3 * body.modules + 1);  // of one frame: x and y of the spine and of all feet
  const flags = Math.ceil(2 * body.modules / 8);
  const nowhere = -32768;
  const aspect = (floor.y1 - floor.y0) / (floor.x1 - floor.x0);
  const last = time.count - 1;
  const end = time.start + last * time.step;

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const robots = data.robots.map((robot, index) => {
    const figure = panels.children[index];
    return {
      ...robot,
      points: new Int16Array(bytes(robot.points).buffer),
      stands: bytes(robot.stands),
      canvas: figure.querySelector("canvas"),
      caption: figure.querySelector("figcaption"),
      label: figure.querySelector(".outcome"),
    };
  });

  const closest = smallest();
  let now = time.start, playing = false, previous = 0;

  // ------------------------------------------------------------------------------------------------ one panel

  function at(robot, frame, point) {
    const index = frame * values + 2 * point;
    return [scale.x + scale.step * robot.points[index], scale.y + scale.step * robot.points[index + 1]];
  }

  function around(robot, frame) {
    const box = { x0: Infinity, x1: -Infinity, y0: Infinity, y1: -Infinity };
    for (let point = 0; point <= body.modules; point++) {
      const [x, y] = at(robot, frame, point);
      box.x0 = Math.min(box.x0, x);
      box.x1 = Math.max(box.x1, x);
      box.y0 = Math.min(box.y0, y);
      box.y1 = Math.max(box.y1, y);
    }
    return box;
  }

  // The smallest piece of floor that, moved along, holds every robot at every time, with a module's length to spare.
  function smallest() {
    const size = { width: 0, height: 0 };
    for (const robot of robots) {
      for (let frame = 0; frame <= last; frame++) {
        const box = around(robot, frame);
        size.width = Math.max(size.width, box.x1 - box.x0 + body.length);
        size.height = Math.max(size.height, box.y1 - box.y0 + body.length);
      }
    }
    return size;
  }

  function draw(robot, frame) {
    const context = robot.canvas.getContext("2d");
    const ratio = robot.canvas.width / robot.width;
    const shown = robot.points[frame * values] !== nowhere;
    let zoom = robot.width / (floor.x1 - floor.x0), left = floor.x0, top = floor.y1;
    if (follow.checked && shown) {
      const box = around(robot, frame);
      zoom = Math.max(zoom, Math.min(robot.width / closest.width, robot.height / closest.height));
      left = 0.5 * (box.x0 + box.x1 - robot.width / zoom);
      top = 0.5 * (box.y0 + box.y1 + robot.height / zoom);
    }
    const X = (x) => (x - left) * zoom, Y = (y) => (top - y) * zoom;
    const on = (point) => { const [x, y] = at(robot, frame, point); return [X(x), Y(y)]; };

    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, robot.width, robot.height);
    context.globalAlpha = 1;
    drawGrid(context, robot, X, Y, left, top, zoom);
    if (robot.target) drawTarget(context, robot, X, Y, zoom);
    if (shown) {
      if (robot.outcome.kind === "stopped" && now > robot.outcome.time) context.globalAlpha = 0.45;
      const feet = drawModules(context, robot, frame, on, zoom);
      context.globalAlpha = 1;
      drawPath(context, robot, frame, X, Y);
      drawJointsAndFeet(context, feet, on, zoom);
    }
    drawScaleBar(context, robot, zoom);
  }

  function drawGrid(context, robot, X, Y, left, top, zoom) {
    const right = left + robot.width / zoom, bottom = top - robot.height / zoom;
    context.strokeStyle = colors.grid;
    context.lineWidth = 1;
    context.beginPath();
    for (let i = Math.ceil(left / floor.grid); i * floor.grid <= right; i++) {
      context.moveTo(X(i * floor.grid), 0);
      context.lineTo(X(i * floor.grid), robot.height);
    }
    for (let i = Math.ceil(bottom / floor.grid); i * floor.grid <= top; i++) {
      context.moveTo(0, Y(i * floor.grid));
      context.lineTo(robot.width, Y(i * floor.grid));
    }
    context.stroke();
  }

  function drawTarget(context, robot, X, Y, zoom) {
    const [x, y] = [X(robot.target[0]), Y(robot.target[1])];
    const arrived = robot.outcome.kind === "arrived" && now >= robot.outcome.time;
    context.strokeStyle = context.fillStyle = colors.target;
    context.beginPath();
    context.arc(x, y, data.arrivalRadius * zoom, 0, 2 * Math.PI);
    context.globalAlpha = arrived ? 0.35 : 0.1;
    context.fill();
    context.globalAlpha = 1;
    context.lineWidth = 1.5;
    context.setLineDash(arrived ? [] : [4, 3]);
    context.stroke();
    context.setLineDash([]);
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(x - 5, y);
    context.lineTo(x + 5, y);
    context.moveTo(x, y - 5);
    context.lineTo(x, y + 5);
    context.stroke();
  }

  function drawPath(context, robot, frame, X, Y) {
    const every = Math.ceil((frame + 1) / 2000);
    context.strokeStyle = colors.path;
    context.lineWidth = 2;
    context.lineJoin = "round";
    context.beginPath();
    for (let earlier = 0; ; earlier = Math.min(earlier + every, frame)) {
      const front = at(robot, earlier, 0), joint = at(robot, earlier, 1);
      context.lineTo(X(0.5 * (front[0] + joint[0])), Y(0.5 * (front[1] + joint[1])));
      if (earlier === frame) break;
    }
    context.stroke();
  }

  function drawModules(context, robot, frame, on, zoom) {
    const length = body.length * zoom, width = body.width * zoom, gap = 0.04 * length;
    const line = thin(zoom), feet = [];
    for (let module = body.modules - 1; module >= 0; module--) {
      const [fx, fy] = on(module), [rx, ry] = on(module + 1);
      const angle = Math.atan2(fy - ry, fx - rx), cos = Math.cos(angle), sin = Math.sin(angle);
      const x = 0.5 * (fx + rx), y = 0.5 * (fy + ry);
      for (const side of [0, 1]) {
        const bit = 2 * module + side;
        const stands = (robot.stands[frame * flags + (bit >> 3)] >> (bit & 7)) & 1;
        const foot = on(body.modules + 1 + bit);
        // Screen y points down, so the left side is at negative y of the module.
        const hx = body.offset * zoom, hy = (side ? 0.5 : -0.5) * width;
        context.strokeStyle = stands ? colors.ink : colors.air;
        context.lineWidth = line;
        context.beginPath();
        context.moveTo(x + cos * hx - sin * hy, y + sin * hx + cos * hy);
        context.lineTo(...foot);
        context.stroke();
        feet.push([stands, foot]);
      }
      context.save();
      context.translate(x, y);
      context.rotate(angle);
      context.fillStyle = module ? colors.body : colors.edge;
      context.strokeStyle = colors.edge;
      context.beginPath();
      context.roundRect(-0.5 * length + gap, -0.5 * width, length - 2 * gap, width, 0.4 * width);
      context.fill();
      context.stroke();
      context.restore();
    }
    return feet;
  }

  function drawJointsAndFeet(context, feet, on, zoom) {
    const length = body.length * zoom, line = thin(zoom), dot = Math.max(2, 0.055 * length);
    for (let joint = 1; joint < body.modules; joint++) {
      disc(context, on(joint), Math.max(1.5, 0.05 * length), "white", colors.ink, line);
    }
    for (const [stands, foot] of feet) {
      disc(context, foot, dot, stands ? colors.ink : "white", stands ? colors.ink : colors.air, line);
    }
  }

  function thin(zoom) {
    return Math.max(0.8, Math.min(1.5, 0.02 * body.length * zoom));
  }

  function disc(context, [x, y], radius, fill, stroke, line) {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = fill;
    context.strokeStyle = stroke;
    context.lineWidth = line;
    context.fill();
    context.stroke();
  }

  function drawScaleBar(context, robot, zoom) {
    const bar = robot.width > 1.6 * floor.grid * zoom ? floor.grid : 0.1 * floor.grid;
    const text = `${+bar.toPrecision(3)} m`, x = 12, y = robot.height - 12, length = bar * zoom;
    context.font = "13px system-ui, 'DejaVu Sans', sans-serif";
    context.fillStyle = colors.ink;
    context.fillRect(x, y - 2, length, 3);
    context.fillRect(x, y - 6, 1.5, 11);
    context.fillRect(x + length - 1.5, y - 6, 1.5, 11);
    context.textBaseline = "middle";
    context.strokeStyle = "white";
    context.lineWidth = 4;
    context.strokeText(text, x + length + 6, y);
    context.fillText(text, x + length + 6, y);
  }

  // ------------------------------------------------------------------------------------------------ all panels

  function show() {
    const frame = Math.max(0, Math.min(last, Math.floor((now - time.start) / time.step + 1e-6)));
    scrub.value = frame;
    clock.value = `${now.toFixed(1)} s of ${end.toFixed(1)} s`;
    scrub.setAttribute("aria-valuetext", `${now.toFixed(1)} seconds`);
    for (const robot of robots) {
      draw(robot, frame);
      const known = now >= robot.outcome.time - 0.5 * time.step;
      robot.label.textContent = known ? robot.outcome.text : "walking";
      robot.label.className = `outcome ${known ? robot.outcome.kind : ""}`;
    }
  }

  // As many columns as make the panels largest while all of them fit into the window.
  function layOut() {
    const width = panels.clientWidth, count = robots.length, gap = 28;
    const spare = document.documentElement.clientHeight - panels.offsetTop - byId("controls").offsetHeight - 28;
    const captions = Math.max(...robots.map((robot) => robot.caption.offsetHeight)) + 16;
    let columns = 1, best = 0;
    for (let tried = count; tried >= 1; tried--) {
      const rows = Math.ceil(count / tried), wide = (width - gap * (tried - 1)) / tried;
      const fitting = Math.min(wide, Math.max(0, spare / rows - captions) / aspect);
      // Below this nothing can be seen: better scroll.
      const size = Math.max(fitting, Math.min(wide, 300));
      if (size > best * 1.02) [columns, best] = [tried, size];
    }
    panels.style.setProperty("--columns", columns);
    const ratio = window.devicePixelRatio || 1;
    for (const robot of robots) {
      robot.width = Math.floor(best) - 2;
      robot.height = Math.round(robot.width * aspect);
      robot.canvas.style.width = `${robot.width + 2}px`;
      robot.canvas.style.height = `${robot.height + 2}px`;
      robot.caption.style.width = `${robot.width + 2}px`;
      robot.canvas.width = Math.round(robot.width * ratio);
      robot.canvas.height = Math.round(robot.height * ratio);
    }
    show();
  }

  function step(stamp) {
    if (!playing) return;
    now = Math.min(end, now + Number(speed.value) * Math.min(0.25, (stamp - previous) / 1000));
    previous = stamp;
    show();
    if (now >= end) setPlaying(false);
    else requestAnimationFrame(step);
  }

  function setPlaying(wanted) {
    if (wanted && now >= end) now = time.start;
    if (wanted && !playing) requestAnimationFrame((stamp) => { previous = stamp; step(stamp); });
    playing = wanted;
    play.textContent = playing ? "Pause" : "Play";
  }

  function goTo(wanted) {
    now = Math.max(time.start, Math.min(end, wanted));
    show();
  }

  function onKey(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target === speed) return;
    const reach = event.shiftKey ? time.step : 1;
    const actions = {
      " ": () => setPlaying(!playing),
      ArrowLeft: () => goTo(now - reach),
      ArrowRight: () => goTo(now + reach),
      Home: () => goTo(time.start),
      End: () => goTo(end),
      ArrowUp: () => { speed.selectedIndex = Math.min(speed.selectedIndex + 1, speed.length - 1); },
      ArrowDown: () => { speed.selectedIndex = Math.max(speed.selectedIndex - 1, 0); },
    };
    // On a button or a box the space bar presses that.
    if (!(event.key in actions) || (event.key === " " && [play, follow].includes(event.target))) return;
    event.preventDefault();
    actions[event.key]();
  }

  scrub.max = last;
  scrub.addEventListener("input", () => goTo(time.start + Number(scrub.value) * time.step));
  play.addEventListener("click", () => setPlaying(!playing));
  follow.addEventListener("change", show);
  document.addEventListener("keydown", onKey);
  window.addEventListener("resize", layOut);
  const asked = /[#&]t=([0-9.]+)/.exec(location.hash);
  if (asked) now = Math.max(time.start, Math.min(end, Number(asked[1]) || time.start));
  layOut();
  if (!asked && !matchMedia("(prefers-reduced-motion: reduce)").matches) setPlaying(true);
})();
