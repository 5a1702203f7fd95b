"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { time, floor, colors, shapes } = data;
  const byId = (id) => document.getElementById(id);
  const view = byId("view");
  const VIEWS = {  // azimuth and elevation of the eye, degrees; the robot sets out along x
    oblique: [-112, 32],
    behind: [-170, 22],
    side: [-90, 10],
    above: [-90, 90],
  };
  const NARROW = Math.tan(Math.PI / 180 * 13);  // of half the field of view, up and down
  const FAR = 1.7;  // times the distance of what is looked at, beyond which lines have no marks
  const FILLED = 1.7;  // of a panel by what is to be seen, as much as 2
  const TOUCHING = 1e-4;  // m, by which a foot may be off the floor and is drawn on it
  const ROLES = { front: colors.edge, module: colors.body, leg: "#5f6772", joint: "#ffffff" };

  const surface = document.createElement("canvas");
  const gl = surface.getContext("webgl2", { alpha: false, antialias: true, stencil: true });
  if (!gl) {
    byId("no-webgl").hidden = false;
    byId("panels").hidden = byId("controls").hidden = byId("legend").hidden = true;
    return;
  }

  const player = replayPlayer(data, data.robots.length > 1 ? 0.72 : window.innerWidth < 640 ? 0.9 : 0.6);
  const { robots, follow } = player;
  const poses = replayPoses(data);
  const eye = { azimuth: 0, elevation: 0, zoom: 1, aside: [0, 0] };
  const room = { key: "", found: null };  // the camera that shows all of the walk, and what it was found for
  let painter;

  for (const robot of robots) {
    robot.raw = new Int16Array(player.bytes(robot.pose).buffer);
    robot.path = [];
    for (let frame = 0; frame < time.count && poses.exists(robot.raw); frame++) {
      robot.path.push([poses.value(robot.raw, frame, 0), poses.value(robot.raw, frame, 1)]);
    }
    for (const aim of robot.aims) {
      aim.pole = {
        kind: "cylinder",
        size: [data.pole.radius, 0.5 * data.pole.height],
        matrix: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...aim.place, 0.5 * data.pole.height, 1],
        color: colors.target,
      };
    }
  }

  const marked = landmarks();

  function setUp() {
    painter = replayPainter(gl, data);
    for (const robot of robots) robot.ribbon = painter.ribbon(robot.path);
  }

  // ------------------------------------------------------------------------------------------------ the eye

  function axes() {
    const a = eye.azimuth * Math.PI / 180, e = eye.elevation * Math.PI / 180;
    const [ca, sa, ce, se] = [Math.cos(a), Math.sin(a), Math.cos(e), Math.sin(e)];
    return { back: [ce * ca, ce * sa, se], right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce] };
  }

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const moved = (p, by, direction) => p.map((each, i) => each + by * direction[i]);

  // x, y and w of a point, for an eye at a distance from what it looks at: on the panel are x/w and y/w from -1 to 1.
  function clip(point, { target, distance, aspect, back, right, up }) {
    const off = moved(point, -1, target);
    return [dot(off, right) * aspect / NARROW, dot(off, up) / NARROW, distance - dot(off, back)];
  }

  function onPanel(point, camera) {
    const [x, y, w] = clip(point, camera);
    return w > 0.02 * camera.distance ? [x / w, y / w] : null;
  }

  // What is to be seen: all modules at times half a second apart, and targets.
  function landmarks() {
    // Robots that diverge may be anywhere.
    const points = [], inside = ([x, y]) => x >= floor.x0 && x <= floor.x1 && y >= floor.y0 && y <= floor.y1;
    const every = Math.max(1, Math.round(0.5 / (time.step || 1)));
    for (const robot of robots) {
      for (let frame = 0; frame < time.count && poses.exists(robot.raw); frame += every) {
        poses.at(robot.raw, time.start + frame * time.step).forEach((matrix, i) => {
          const place = matrix.slice(12, 15);
          if (["front", "module", "foot"].includes(shapes[i].role) && inside(place)) points.push(place);
        });
      }
      for (const { place: [x, y] } of robot.aims) {
        const r = data.arrivalRadius;
        points.push([x - r, y, 0], [x + r, y, 0], [x, y - r, 0], [x, y + r, 0], [x, y, data.pole.height]);
      }
    }
    return points.length ? points : [[floor.x0, floor.y0, 0], [floor.x1, floor.y1, 0]];
  }

  // Looks at the whole walk, or at one robot, from as near as shows it whole.
  function cameraOn(robot, middle) {
    const aspect = robot.height / robot.width, camera = { ...axes(), aspect, target: middle, distance: 1 };
    if (middle) camera.distance = 0.6 * data.length * Math.max(aspect, camera.back[2]) / NARROW;
    else Object.assign(camera, wholeWalk(camera));
    camera.distance /= eye.zoom;
    const a = eye.azimuth * Math.PI / 180;
    camera.target = moved(camera.target, eye.aside[0], camera.right);
    camera.target = moved(camera.target, eye.aside[1], [-Math.cos(a), -Math.sin(a), 0]);
    camera.eye = moved(camera.target, camera.distance, camera.back);
    camera.seen = seen(camera);
    return camera;
  }

  function wholeWalk({ aspect, back, right, up }) {
    const key = [aspect, eye.azimuth, eye.elevation].join();
    if (room.key === key) return room.found;
    const camera = { aspect, back, right, up, target: [0.5 * (floor.x0 + floor.x1), 0.5 * (floor.y0 + floor.y1), 0] };
    camera.distance = 2 * (floor.x1 - floor.x0) / NARROW;
    for (let round = 0; round < 10; round++) {
      const places = marked.map((point) => onPanel(point, camera)).filter(Boolean);
      const [x, y] = [0, 1].map((i) => {
        const values = places.map((place) => place[i]);
        const low = values.reduce((a, b) => Math.min(a, b)), high = values.reduce((a, b) => Math.max(a, b));
        return { middle: 0.5 * (low + high) * camera.distance * NARROW, size: high - low };
      });
      camera.target = moved(moved(camera.target, x.middle / aspect, right), y.middle, up);
      camera.distance *= Math.max(x.size, y.size) / FILLED;
    }
    Object.assign(room, { key, found: { target: camera.target, distance: Math.max(camera.distance, data.length) } });
    return room.found;
  }

  function seen({ eye: from, right, up, back, distance, aspect }) {
    const near = 0.05 * distance, far = 12 * distance;
    const x = right.map((each) => each * aspect / NARROW), y = up.map((each) => each / NARROW);
    const z = back.map((each) => -each * (far + near) / (far - near)), w = back.map((each) => -each);
    const rows = [[x, 0], [y, 0], [z, -2 * far * near / (far - near)], [w, 0]];
    const columns = [0, 1, 2].flatMap((i) => rows.map(([row]) => row[i]));
    return columns.concat(rows.map(([row, more]) => more - dot(row, from)));
  }

  // ------------------------------------------------------------------------------------------------ one panel

  function draw(robot, frame, now) {
    const { canvas } = robot;
    if (surface.width !== canvas.width || surface.height !== canvas.height) {
      [surface.width, surface.height] = [canvas.width, canvas.height];
    }
    const exists = poses.exists(robot.raw), solids = exists ? dressed(robot, now) : [];
    const modules = solids.filter(({ kind }) => kind === "box").map(({ matrix }) => matrix);
    const mean = (i) => modules.reduce((sum, matrix) => sum + matrix[12 + i], 0) / modules.length;
    const camera = cameraOn(robot, follow.checked && exists ? [0, 1, 2].map(mean) : null);
    const ratio = canvas.width / robot.width;
    const aim = begun(robot, now).at(-1);
    const pale = robot.outcome.kind === "stopped" && now > robot.outcome.time;
    const pole = aim ? [aim.pole] : [];
    painter.start(canvas.width, canvas.height, camera);
    painter.paintFloor(camera, ratio, aim?.place, Boolean(aim) && isReached(aim, now));
    if (pole.length) painter.paintSolids(camera, pole, true, false);
    painter.paintSolids(camera, solids, true, pale);
    const width = 6 * camera.distance * NARROW / robot.height, pieces = exists ? frame : 0;
    painter.paintPath(camera, robot.ribbon, pieces, width, false);
    painter.paintSolids(camera, pole, false, false);
    painter.paintSolids(camera, solids, false, pale);
    painter.paintPath(camera, robot.ribbon, pieces, width, true);
    const context = canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(surface, 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    drawMarks(context, robot, camera);
  }

  function dressed(robot, now) {
    const frame = Math.max(0, Math.min(time.count - 1, Math.floor((now - time.start) / time.step + 1e-6)));
    let joint = 0;
    return poses.at(robot.raw, now).map((matrix, i) => {
      const { kind, size, role } = shapes[i];
      if (role === "joint") {
        const { width, color } = player.spring(robot, joint++, frame);
        return { kind, size, matrix: matrix.map((each, at) => at < 8 ? width * each : each), color };
      }
      const lies = matrix[14] < size[0] + TOUCHING;
      return { kind, size, matrix, color: role === "foot" ? (lies ? colors.ink : "#ffffff") : ROLES[role] };
    });
  }

  // Metres beside the lines of the grid, where they leave the panel on the side nearer to the eye.
  function drawMarks(context, robot, camera) {
    const { grid } = floor, reach = 3 * camera.distance, taken = [];
    context.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineJoin = "round";
    context.strokeStyle = "rgba(255, 255, 255, 0.9)";
    context.lineWidth = 4;
    context.fillStyle = colors.air;
    for (const axis of [0, 1]) {
      const [first, last] = [-1, 1].map((side) => Math.round((camera.target[axis] + side * reach) / grid));
      for (let i = first; i <= last; i++) {
        const ends = [-1, 1].map((side) => {
          const point = [0, 0, 0];
          point[axis] = i * grid;
          point[1 - axis] = camera.target[1 - axis] + side * reach;
          return clip(point, camera);
        });
        const place = leaves(...ends);
        if (!place || place[2] > FAR * camera.distance) continue;
        const text = `${"xy"[axis]} = ${+(i * grid).toPrecision(3)} m`.replace("-", "−");
        const half = 0.5 * context.measureText(text).width + 6;
        const x = Math.max(half, Math.min(robot.width - half, 0.5 * (1 + place[0]) * robot.width));
        const y = Math.max(14, Math.min(robot.height - 14, 0.5 * (1 - place[1]) * robot.height));
        if (taken.some(([u, v]) => Math.abs(u - x) < 2 * half && Math.abs(v - y) < 22)) continue;
        taken.push([x, y]);
        context.strokeText(text, x, y);
        context.fillText(text, x, y);
      }
    }
  }

  // The lower end, or else the left one, of the part of a line that is on the panel: x and y, -1 to 1, and w.
  function leaves(from, to) {
    let low = 0, high = 1;
    const sides = [[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1], [0, 0, 1]];
    for (const side of sides) {
      const a = dot(side, from) - 1e-3, b = dot(side, to) - 1e-3;
      if (a < 0 && b < 0) return null;
      if (a < 0) low = Math.max(low, a / (a - b));
      if (b < 0) high = Math.min(high, a / (a - b));
    }
    if (low >= high) return null;
    const [p, q] = [low, high].map((t) => from.map((each, i) => each + t * (to[i] - each)))
      .map(([x, y, w]) => [x / w, y / w, w]);
    return p[1] + 0.01 * p[0] < q[1] + 0.01 * q[0] ? p : q;
  }

  // ------------------------------------------------------------------------------------------------ looking around

  function look(name) {
    if (!(name in VIEWS)) return;
    [eye.azimuth, eye.elevation] = VIEWS[name];
    eye.zoom = 1;
    eye.aside = [0, 0];
    view.value = name;
    player.redraw();
  }

  function byHand(change) {
    change();
    eye.elevation = Math.max(2, Math.min(90, eye.elevation));
    eye.zoom = Math.max(0.3, Math.min(15, eye.zoom));
    view.value = "free";
    player.redraw();
  }

  function listen(robot) {
    const { canvas } = robot, fingers = new Map();
    canvas.classList.add(robots.length > 1 ? "turns" : "turns-freely");
    const pull = (dx, dy) => {
      const { distance } = cameraOn(robot, follow.checked ? [0, 0, 0] : null);
      const metre = 2 * distance * NARROW / robot.height;
      eye.aside[0] -= dx * metre;
      eye.aside[1] += dy * metre / Math.max(0.3, Math.sin(eye.elevation * Math.PI / 180));
    };
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
    };
    const end = (event) => { fingers.delete(event.pointerId); };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const dx = event.clientX - before[0], dy = event.clientY - before[1], size = fingers.size > 1 ? spread() : 0;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      byHand(() => {
        if (fingers.size > 1) {
          eye.zoom *= spread() / size;
          pull(dx / fingers.size, dy / fingers.size);
        } else if (event.shiftKey || event.buttons & 2) {
          pull(dx, dy);
        } else {
          eye.azimuth -= 0.4 * dx;
          eye.elevation += 0.4 * dy;
        }
      });
    });
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) canvas.addEventListener(kind, end);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const lines = event.deltaMode ? 30 * event.deltaY : event.deltaY;
      byHand(() => { eye.zoom *= Math.exp(-0.0015 * Math.max(-300, Math.min(300, lines))); });
    }, { passive: false });
  }

  surface.addEventListener("webglcontextlost", (event) => event.preventDefault());
  surface.addEventListener("webglcontextrestored", () => { setUp(); player.redraw(); });
  for (const key of ["+", "="]) player.actions[key] = () => byHand(() => { eye.zoom *= 1.25; });
  player.actions["-"] = () => byHand(() => { eye.zoom /= 1.25; });
  view.addEventListener("change", () => look(view.value));
  robots.forEach(listen);
  setUp();
  look("oblique");
  const asked = /[#&]view=(\w+)/.exec(location.hash);
  if (asked) look(asked[1]);
  player.start(draw);
})();
