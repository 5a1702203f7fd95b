"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const by = (id) => document.getElementById(id);
  const TOLERANCE = 1e-8, NUDGE = 0.001, DEGREE = Math.PI / 180, LONGEST_FRAME = 0.1, FOLLOWING = 0.4, FINEST = 2;
  const [softest, stiffest] = data.range.map((each) => each / data.unit);
  const asked = new URLSearchParams(location.search), wrong = [];
  const robot = planarRobot(data, TOLERANCE);
  let random = mulberry(number("seed", 1, 0, 2 ** 31, Math.trunc));
  let paused = matchMedia("(prefers-reduced-motion: reduce)").matches, last = null, cycles = 0;
  let path = [], trail = [], reached = null, chosen = data.springs[0] / data.unit;
  const camera = { x: 0, y: 0 };

  // -- controls
  // -----------------------------------------------------------------------------------------------------------------

  const slider = Object.assign(by("spring"), { min: softest, max: stiffest, step: 0.05 });
  slider.addEventListener("input", () => setSpring(Number(slider.value)));
  by("pause").addEventListener("click", () => { paused = !paused; });
  by("restart").addEventListener("click", restart);
  by("left").addEventListener("click", () => aim(45));
  by("right").addEventListener("click", () => aim(-45));
  by("none").addEventListener("click", () => release(null));
  by("steers").addEventListener("change", () => { robot.steersSpring = by("steers").checked; });
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target instanceof HTMLSelectElement) return;
    const id = { p: "pause", r: "restart", a: "left", d: "right", x: "none" }[event.key.toLowerCase()];
    if (id) by(id).click();
  });

  function setSpring(value) {
    chosen = Math.min(Math.max(value, softest), stiffest);
    robot.setSpring(0, chosen * data.unit);
    slider.value = chosen;
  }

  // Ends a way to a target; the spring is again the one that was chosen.
  function release(arrived) {
    robot.target = null;
    reached = arrived;
    setSpring(chosen);
  }

  function restart() {
    robot.restart(Array.from({ length: data.modules - 1 }, () => DEGREE * normal()));
    release(null);
    cycles = 0;
    path = [];
    trail = [];
  }

  // A target 1.3 m away, at a bearing in degrees.
  function aim(bearing) {
    const [x, y, heading] = robot.place()[0], angle = heading + bearing * DEGREE;
    put([x + 1.3 * Math.cos(angle), y + 1.3 * Math.sin(angle)]);
  }

  function put(place) {
    robot.target = place;
    reached = null;
  }

  by("floor").addEventListener("click", (event) => {
    const { left, top, zoom } = view(by("floor"));
    put([left + event.offsetX / zoom, top - event.offsetY / zoom]);
  });

  // Arrow keys on the floor move the target as it is seen; the first one sets it at the middle.
  const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }, NEXT = 0.1;
  by("floor").addEventListener("keydown", (event) => {
    const way = ARROWS[event.key];
    if (!way) return;
    event.preventDefault();
    const from = robot.target || [camera.x, camera.y];
    put(from.map((each, axis) => each + NEXT * way[axis]));
  });

  const fork = by("fork");
  fork.addEventListener("pointerdown", (event) => { fork.setPointerCapture(event.pointerId); slide(event); });
  fork.addEventListener("pointermove", (event) => { if (fork.hasPointerCapture(event.pointerId)) slide(event); });

  function slide(event) {
    setSpring(forkScale(fork).spring(event.offsetX));
  }

  // -- the walk
  // -----------------------------------------------------------------------------------------------------------------

  function walk(seconds) {
    const until = robot.time + seconds;
    while (robot.time < until && !robot.bentTooFar) {
      robot.advance(Math.min(until, (cycles + 1) * data.gait.period));
      if (robot.time < (cycles + 1) * data.gait.period) continue;
      cycles += 1;
      // No floor is quite even: small disturbances once a gait cycle.
      for (let joint = 0; joint < data.modules - 1; joint++) robot.state[3 + joint] += NUDGE * normal();
      const [x, y] = robot.place()[0];
      path.push([x, y]);
      trail.push([robot.springs[0] / data.unit, robot.bend() / DEGREE]);
      if (path.length > 2000) path.shift();
      if (trail.length > 60) trail.shift();
      if (robot.target && robot.observe().distance < data.arrivalRadius) {
        release(robot.target);
      }
    }
    if (robot.steersSpring && robot.target) slider.value = robot.springs[0] / data.unit;
  }

  function words() {
    const spring = robot.springs[0] / data.unit, critical = data.pitchfork / data.unit, bend = robot.bend() / DEGREE;
    if (robot.bentTooFar) return "A joint is bent by more than a right angle. The walk has ended: restart it.";
    const side = bend > 0 ? "left" : "right", size = Math.abs(bend).toFixed(0);
    const straight = Math.abs(bend) < 15;
    const parts = [
      spring > critical
        ? `The straight walk is stable: the first spring is stiffer than ${critical.toFixed(2)} N·mm/deg.`
        : `The straight walk is unstable: the first spring is softer than ${critical.toFixed(2)} N·mm/deg.`,
      straight ? "The body is nearly straight." : `The body is bent by ${size}° to the ${side}.`,
    ];
    if (robot.target) parts.push(`${robot.observe().distance.toFixed(2)} m to the target.`);
    else if (reached) parts.push("The robot has arrived at its target.");
    return parts.join(" ");
  }

  // -- pictures
  // -----------------------------------------------------------------------------------------------------------------

  const COLORS = ["ink", "soft", "line", "grid", "paper", "body", "edge", "path", "target", "spring"];

  function colors() {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(COLORS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  // What changes only with the size or the colours of the page is drawn once, the rest of the plot when it looks otherwise.
  let ink = colors(), still = null, drawn = null;
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { ink = colors(); still = null; });

  function prepared(canvas) {
    const ratio = Math.min(devicePixelRatio || 1, FINEST), width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const context = canvas.getContext("2d", { alpha: false });
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = ink.paper;
    context.fillRect(0, 0, width, height);
    return { context, width, height };
  }

  function view(canvas) {
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const zoom = Math.min(width / 2.2, height / 1.6);
    return { left: camera.x - 0.5 * width / zoom, top: camera.y + 0.5 * height / zoom, zoom };
  }

  function drawFloor(passed) {
    const canvas = by("floor"), modules = robot.place();
    const middle = modules[Math.floor(data.modules / 2)];
    const far = Math.hypot(middle[0] - camera.x, middle[1] - camera.y) > 0.8, share = far ? 1 : 1 - Math.exp(-passed / FOLLOWING);
    camera.x += share * (middle[0] - camera.x);
    camera.y += share * (middle[1] - camera.y);
    const { context, width, height } = prepared(canvas), { left, top, zoom } = view(canvas);
    const X = (x) => (x - left) * zoom, Y = (y) => (top - y) * zoom, tile = 0.25;
    line(context, ink.grid, 1, () => {
      for (let i = Math.ceil(left / tile); i * tile < left + width / zoom; i++) segment(context, X(i * tile), 0, X(i * tile), height);
      for (let i = Math.ceil((top - height / zoom) / tile); i * tile < top; i++) segment(context, 0, Y(i * tile), width, Y(i * tile));
    });
    for (const [place, faint] of [[reached, true], [robot.target, false]]) {
      if (!place) continue;
      context.globalAlpha = faint ? 0.5 : 1;
      ring(context, X(place[0]), Y(place[1]), data.arrivalRadius * zoom, ink.target, 3);
      ring(context, X(place[0]), Y(place[1]), 3, ink.target, 3);
      context.globalAlpha = 1;
    }
    line(context, ink.path, 2, () => path.forEach(([x, y]) => context.lineTo(X(x), Y(y))));
    drawFeet(context, ink, modules, X, Y, zoom);
    modules.forEach(([x, y, heading], i) => {
      context.save();
      context.translate(X(x), Y(y));
      context.rotate(-heading);
      context.fillStyle = i === 0 ? ink.edge : ink.body;
      context.strokeStyle = ink.edge;
      context.lineWidth = 1;
      context.beginPath();
      const length = 0.86 * data.length * zoom, wide = data.width * zoom;
      context.roundRect(-0.5 * length, -0.5 * wide, length, wide, 0.4 * wide);
      context.fill();
      context.stroke();
      context.restore();
    });
    for (let joint = 0; joint < data.modules - 1; joint++) drawSpring(context, ink, modules, joint, X, Y, zoom);
    scaleBar(context, ink, height, zoom);
  }

  function drawFeet(context, ink, modules, X, Y, zoom) {
    robot.feet().forEach(({ x, y, stands }, leg) => {
      const [mx, my, heading] = modules[leg >> 1], aside = (leg & 1 ? -0.5 : 0.5) * data.width;
      const hx = mx + data.forwardOffset * Math.cos(heading) - aside * Math.sin(heading);
      const hy = my + data.forwardOffset * Math.sin(heading) + aside * Math.cos(heading);
      line(context, stands ? ink.ink : ink.soft, stands ? 2 : 1, () => segment(context, X(hx), Y(hy), X(x), Y(y)));
      context.beginPath();
      context.arc(X(x), Y(y), 0.012 * zoom, 0, 2 * Math.PI);
      context.fillStyle = stands ? ink.ink : ink.paper;
      context.fill();
      ring(context, X(x), Y(y), 0.012 * zoom, stands ? ink.ink : ink.soft, 1);
    });
  }

  // A spring as a ring: thin and light when it is soft.
  function drawSpring(context, ink, modules, joint, X, Y, zoom) {
    const [x, y, heading] = modules[joint], half = 0.5 * data.length;
    const share = Math.min(robot.springs[joint] / data.range[1], 1);
    const px = X(x - half * Math.cos(heading)), py = Y(y - half * Math.sin(heading));
    context.beginPath();
    context.arc(px, py, 0.022 * zoom, 0, 2 * Math.PI);
    context.fillStyle = ink.paper;
    context.fill();
    context.globalAlpha = 0.3 + 0.7 * share;
    ring(context, px, py, 0.022 * zoom, ink.spring, 6 * (0.3 + 0.7 * share));
    context.globalAlpha = 1;
  }

  function scaleBar(context, ink, height, zoom) {
    context.fillStyle = ink.ink;
    context.font = "13px system-ui, sans-serif";
    context.fillRect(12, height - 14, 0.5 * zoom, 3);
    context.fillText("0.5 m", 18 + 0.5 * zoom, height - 8);
  }

  function forkScale(canvas) {
    const left = 46, right = canvas.clientWidth - 10, upper = 10, lower = canvas.clientHeight - 34, most = 240;
    return {
      left, right, upper, lower, most,
      x: (spring) => left + (right - left) * spring / stiffest,
      y: (bend) => lower - (lower - upper) * (bend + most) / (2 * most),
      spring: (x) => stiffest * (x - left) / (right - left),
    };
  }

  function drawFork() {
    const scale = forkScale(fork), { x, y } = scale, point = [robot.springs[0] / data.unit, robot.bend() / DEGREE];
    const now = [cycles, Math.round(2 * x(point[0])), Math.round(2 * y(point[1])), fork.clientWidth, ink.paper].join();
    if (drawn === now) return;
    drawn = now;
    const { context, width, height } = prepared(fork);
    if (still?.width !== fork.width || still.height !== fork.height) {
      still = Object.assign(document.createElement("canvas"), { width: fork.width, height: fork.height });
      const below = still.getContext("2d");
      below.setTransform(context.getTransform());
      drawBranches(below, scale);
    }
    context.drawImage(still, 0, 0, width, height);
    clip(context, scale);
    context.globalAlpha = 0.5;
    line(context, ink.path, 1.5, () => trail.forEach(([spring, bend]) => context.lineTo(x(spring), y(bend))));
    context.globalAlpha = 1;
    context.fillStyle = ink.path;
    context.beginPath();
    context.arc(x(point[0]), y(point[1]), 6, 0, 2 * Math.PI);
    context.fill();
    context.restore();
  }

  function drawBranches(context, scale) {
    const { x, y } = scale, critical = data.pitchfork / data.unit;
    context.font = "12px system-ui, sans-serif";
    context.fillStyle = ink.soft;
    context.textAlign = "center";
    for (let spring = 0; spring <= stiffest; spring += 10) {
      line(context, ink.grid, 1, () => segment(context, x(spring), scale.upper, x(spring), scale.lower));
      context.fillText(String(spring), x(spring), scale.lower + 15);
    }
    context.fillText("first spring (N·mm/deg)", 0.5 * (scale.left + scale.right), scale.lower + 30);
    context.textAlign = "right";
    for (const bend of [-180, -90, 0, 90, 180]) {
      line(context, ink.grid, 1, () => segment(context, scale.left, y(bend), scale.right, y(bend)));
      context.fillText(`${bend}°`, scale.left - 5, y(bend) + 4);
    }
    context.fillText("bend to the left", scale.right - 4, scale.upper + 13);
    context.fillText("bend to the right", scale.right - 4, scale.lower - 6);
    context.textAlign = "left";
    line(context, ink.edge, 3, () => segment(context, x(critical), y(0), x(stiffest), y(0)));
    line(context, ink.edge, 2, () => segment(context, x(0), y(0), x(critical), y(0)), [5, 4]);
    const { springs, bends, stable } = data.branch;
    context.fillStyle = ink.ink;
    context.fillText(`pitchfork ${critical.toFixed(2)}`, x(critical) + 6, y(0) - 8);
    clip(context, scale);
    for (const side of [1, -1]) {
      for (let i = 1; i < springs.length; i++) {
        const solid = stable[i];
        line(context, ink.edge, solid ? 3 : 2, () => segment(
          context, x(springs[i - 1] / data.unit), y(side * bends[i - 1] / DEGREE), x(springs[i] / data.unit), y(side * bends[i] / DEGREE),
        ), solid ? [] : [5, 4]);
      }
    }
    context.restore();
  }

  function clip(context, { left, right, upper, lower }) {
    context.save();
    context.beginPath();
    context.rect(left, upper, right - left, lower - upper);
    context.clip();
  }

  function line(context, color, width, draw, dash = []) {
    context.strokeStyle = color;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.beginPath();
    draw();
    context.stroke();
    context.setLineDash([]);
  }

  function segment(context, x0, y0, x1, y1) {
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
  }

  function ring(context, x, y, radius, color, width) {
    line(context, color, width, () => context.arc(x, y, radius, 0, 2 * Math.PI));
  }

  // -- frames
  // -----------------------------------------------------------------------------------------------------------------

  function frame(now) {
    const passed = last === null ? 0 : Math.min((now - last) / 1000, LONGEST_FRAME);
    last = now;
    if (!paused) walk(passed * Number(by("speed").value));
    const said = words();
    drawFloor(passed);
    drawFork();
    by("pause").textContent = paused ? "Go on" : "Pause";
    by("value").textContent = `${(robot.springs[0] / data.unit).toFixed(1)} N·mm/deg`;
    if (by("words").textContent !== said) by("words").textContent = said;
    window.play.frames += 1;
    requestAnimationFrame(frame);
  }

  // Number of the address, within its range.
  function number(name, otherwise, low, high, whole = (each) => each) {
    const text = asked.get(name), value = text === null || text.trim() === "" ? NaN : Number(text);
    const used = Number.isFinite(value) ? whole(Math.min(Math.max(value, low), high)) : otherwise;
    const [least, most, now] = [low, high, used].map((each) => Number(each.toPrecision(10)));
    if (text !== null && !(Math.abs(used - value) <= 1e-9 * Math.abs(value)))
      wrong.push(`${name} = ${text.slice(0, 40)} (allowed: ${least} to ${most}, now ${now})`);
    return used;
  }

  function mulberry(seed) {
    let state = seed >>> 0;
    return () => {
      state = (state + 0x6d2b79f5) | 0;
      let mixed = Math.imul(state ^ (state >>> 15), 1 | state);
      mixed = (mixed + Math.imul(mixed ^ (mixed >>> 7), 61 | mixed)) ^ mixed;
      return ((mixed ^ (mixed >>> 14)) >>> 0) / 4294967296;
    };
  }

  function normal() {
    return Math.sqrt(-2 * Math.log(1 - random())) * Math.cos(2 * Math.PI * random());
  }

  window.play = { robot, data, walk, words, frames: 0 };
  robot.steersSpring = by("steers").checked;
  restart();
  setSpring(number("k1", data.springs[0] / data.unit, softest, stiffest));
  if (wrong.length) by("note").textContent = `Wrong in the address: ${wrong.join(", ")}.`;
  requestAnimationFrame(frame);
})();
