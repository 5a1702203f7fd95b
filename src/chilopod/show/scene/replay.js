"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { time, floor, scale, body, colors } = data;
  const values = 2 * (3 * body.modules + 1);  // of one frame: x and y of the spine and of all feet
  const flags = Math.ceil(2 * body.modules / 8);
  const nowhere = -32768;
  const last = time.count - 1;
  const player = replayPlayer(data, (floor.y1 - floor.y0) / (floor.x1 - floor.x0));
  const { robots, follow, bytes } = player;

  for (const robot of robots) {
    robot.points = new Int16Array(bytes(robot.points).buffer);
    robot.stands = bytes(robot.stands);
  }
  const closest = smallest();

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

  function draw(robot, frame, now) {
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
    begun(robot, now).forEach((aim, i, all) => drawTarget(context, aim, i + 1 === all.length, now, X, Y, zoom));
    if (shown) {
      if (robot.outcome.kind === "stopped" && now > robot.outcome.time) context.globalAlpha = 0.45;
      const feet = drawModules(context, robot, frame, on, zoom);
      context.globalAlpha = 1;
      drawPath(context, robot, frame, X, Y);
      drawJointsAndFeet(context, robot, frame, feet, on, zoom);
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

  // Of a target that has had its turn a faint ring stays.
  function drawTarget(context, aim, present, now, X, Y, zoom) {
    const [x, y] = [X(aim.place[0]), Y(aim.place[1])];
    const arrived = isReached(aim, now);
    context.strokeStyle = context.fillStyle = colors.target;
    context.beginPath();
    context.arc(x, y, data.arrivalRadius * zoom, 0, 2 * Math.PI);
    context.globalAlpha = arrived ? 0.35 : 0.1;
    if (present) context.fill();
    context.globalAlpha = present ? 1 : 0.4;
    context.lineWidth = 1.5;
    context.setLineDash(arrived ? [] : [4, 3]);
    context.stroke();
    context.setLineDash([]);
    context.globalAlpha = 1;
    if (!present) return;
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

  function drawJointsAndFeet(context, robot, frame, feet, on, zoom) {
    const length = body.length * zoom, line = thin(zoom), dot = Math.max(2, 0.055 * length);
    for (let joint = 1; joint < body.modules; joint++) {
      const { width, color } = player.spring(robot, joint - 1, frame);
      disc(context, on(joint), Math.max(2, 0.06 * length), "white", color, width * Math.max(2, 0.06 * length));
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

  player.start(draw);
})();
