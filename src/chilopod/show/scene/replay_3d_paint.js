"use strict";
// Meshes, shaders and draw calls. Everything on the floor is painted first, without depth: the eye is always above it.
function replayPainter(gl, data) {
  const LIGHT = [-0.32, -0.42, 0.85];
  const ROUNDING = 0.006;  // m, of the edges of boxes


  const SOLID = `#version 300 es
    uniform mat4 seen, model;
    uniform vec3 light;
    uniform bool shadow;
    in vec3 place, normal;
    out vec3 facing, spot;
    void main() {
      vec4 p = model * vec4(place, 1.0);
      if (shadow) p.xyz -= light * (p.z / light.z);
      facing = mat3(model) * normal;
      spot = p.xyz;
      gl_Position = seen * p;
    }`;
  const SOLID_COLOR = `#version 300 es
    precision highp float;
    uniform vec4 color;
    uniform vec3 light, eye;
    uniform bool shadow;
    in vec3 facing, spot;
    out vec4 result;
    void main() {
      vec3 n = normalize(facing), half_way = normalize(light + normalize(eye - spot));
      float lit = 0.62 + 0.06 * n.z + 0.36 * max(dot(n, light), 0.0);
      float gloss = 0.08 * pow(max(dot(n, half_way), 0.0), 24.0);
      result = shadow ? color : vec4(min(color.rgb * lit + gloss, 1.0), color.a);
    }`;
  const FLOOR = `#version 300 es
    uniform mat4 seen;
    uniform vec2 middle;
    uniform float reach;
    in vec2 corner;
    out vec2 spot;
    void main() {
      spot = middle + reach * corner;
      gl_Position = seen * vec4(spot, 0.0, 1.0);
    }`;
  const FLOOR_COLOR = `#version 300 es
    precision highp float;
    uniform vec2 middle;
    uniform vec3 target, targetColor, lineColor;
    uniform float reach, grid, fine, pixel;
    uniform bool arrived;
    in vec2 spot;
    out vec4 result;
    // How much of a pixel lines of a width in pixels cover; none where they would stand too close to be told apart.
    float lines(float every, float width) {
      vec2 place = spot / every, size = max(fwidth(place), 1e-6);
      vec2 off = abs(fract(place - 0.5) - 0.5) / size;
      vec2 covered = clamp(0.5 * width * pixel + 0.5 - off, 0.0, 1.0) * (1.0 - smoothstep(0.07, 0.17, size));
      return max(covered.x, covered.y);
    }
    void main() {
      vec3 color = vec3(0.972, 0.976, 0.980);
      color = mix(color, lineColor, max(0.38 * lines(fine, 1.0), lines(grid, 1.3)));
      if (target.z > 0.0) {
        vec2 from = spot - target.xy;
        float away = length(from), size = fwidth(away);
        color = mix(color, targetColor, (arrived ? 0.4 : 0.14) * clamp((target.z - away) / size + 0.5, 0.0, 1.0));
        float ring = clamp(0.9 * pixel + 0.5 - abs(away - target.z) / size, 0.0, 1.0);
        float dash = arrived ? 1.0 : step(fract(atan(from.y, from.x) * 3.8197186), 0.6);
        color = mix(color, targetColor, ring * dash);
      }
      result = vec4(mix(color, vec3(1.0), smoothstep(0.35, 0.95, length(spot - middle) / reach)), 1.0);
    }`;
  const PATH = `#version 300 es
    uniform mat4 seen;
    uniform float width;
    in vec2 place, beside;
    void main() { gl_Position = seen * vec4(place + width * beside, 0.0, 1.0); }`;
  const PATH_COLOR = `#version 300 es
    precision highp float;
    uniform vec4 color;
    out vec4 result;
    void main() { result = color; }`;

  function program(vertex, fragment) {
    const made = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    const fine = gl.getProgramParameter(made, gl.LINK_STATUS) || gl.isContextLost();
    if (!fine) throw new Error(gl.getProgramInfoLog(made));
    const places = {};
    for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
      const { name } = gl.getActiveUniform(made, i);
      places[name] = gl.getUniformLocation(made, name);
    }
    return { made, places };
  }

  // Vertices, by program: each attribute has its number of values, interleaved in the order given.
  function mesh({ made }, vertices, triangles, attributes) {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(vertices), gl.STATIC_DRAW);
    const stride = 4 * attributes.reduce((total, [, size]) => total + size, 0);
    let offset = 0;
    for (const [name, size] of attributes) {
      const place = gl.getAttribLocation(made, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, stride, offset);
      offset += 4 * size;
    }
    if (triangles) {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(triangles), gl.STATIC_DRAW);
    }
    gl.bindVertexArray(null);
    return { array, count: triangles ? triangles.length : 0 };
  }

  // Triangles between rows of equally many vertices.
  function woven(rows, columns) {
    const triangles = [];
    for (let i = 0; i + 1 < rows; i++) {
      for (let j = 0; j + 1 < columns; j++) {
        const a = i * columns + j, b = a + columns;
        triangles.push(a, a + 1, b, b, a + 1, b + 1);
      }
    }
    return triangles;
  }

  // A box with a ball rolled round it: every octant of the ball stands at its corner. Without width a capsule, without
  // height a ball.
  function rounded([x, y, z], radius, parts) {
    const vertices = [], around = [], along = [];
    for (let quarter = 0; quarter < 4; quarter++) {
      const sx = [1, -1, -1, 1][quarter], sy = [1, 1, -1, -1][quarter];
      for (let k = 0; k <= parts; k++) around.push([(quarter + k / parts) * 0.5 * Math.PI, sx, sy]);
    }
    around.push(around[0]);
    for (const sz of [-1, 1]) {
      for (let k = 0; k <= parts; k++) along.push([(k / parts - (sz < 0 ? 1 : 0)) * 0.5 * Math.PI, sz]);
    }
    const row = (flat, tall, sz, wide) => {
      for (const [angle, sx, sy] of around) {
        const n = [flat * Math.cos(angle), flat * Math.sin(angle), tall];
        vertices.push(wide * sx * x + radius * n[0], wide * sy * y + radius * n[1], sz * z + radius * n[2], ...n);
      }
    };
    row(0, -1, -1, 0);
    for (const [height, sz] of along) row(Math.cos(height), Math.sin(height), sz, 1);
    row(0, 1, 1, 0);
    return [vertices, woven(along.length + 2, around.length)];
  }

  function cylinder(radius, half) {
    const vertices = [], parts = 32;
    const rows = [[0, -1, 0, -1], [1, -1, 0, -1], [1, -1, 1, 0], [1, 1, 1, 0], [1, 1, 0, 1], [0, 1, 0, 1]];
    for (const [r, z, nr, nz] of rows) {
      for (let k = 0; k <= parts; k++) {
        const angle = 2 * Math.PI * k / parts, cos = Math.cos(angle), sin = Math.sin(angle);
        vertices.push(r * radius * cos, r * radius * sin, z * half, nr * cos, nr * sin, nz);
      }
    }
    return [vertices, woven(rows.length, parts + 1)];
  }

  const round = ([x, y, z]) => {
    const bevel = Math.min(ROUNDING, x, y, z);
    return rounded([x - bevel, y - bevel, z - bevel], bevel, 4);
  };
  const made = {
    box: round,
    capsule: ([r, half]) => rounded([0, 0, half], r, 5),
    sphere: ([r]) => rounded([0, 0, 0], r, 6),
    cylinder: ([r, half]) => cylinder(r, half),
  };

  const solid = program(SOLID, SOLID_COLOR), floor = program(FLOOR, FLOOR_COLOR), path = program(PATH, PATH_COLOR);
  const meshes = new Map();
  const rgb = (text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16) / 255);
  const quad = mesh(floor, [-1, -1, 1, -1, 1, 1, -1, 1], [0, 1, 2, 0, 2, 3], [["corner", 2]]);
  const length = Math.hypot(...LIGHT), light = LIGHT.map((each) => each / length);

  function meshOf(kind, size) {
    const key = [kind, ...size].join();
    if (!meshes.has(key)) meshes.set(key, mesh(solid, ...made[kind](size), [["place", 3], ["normal", 3]]));
    return meshes.get(key);
  }

  function start(width, height, camera) {
    gl.viewport(0, 0, width, height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.STENCIL_TEST);
    gl.disable(gl.BLEND);
    gl.useProgram(floor.made);
    gl.uniformMatrix4fv(floor.places.seen, false, camera.seen);
  }

  function paintFloor(camera, ratio, target, arrived) {
    gl.uniform2fv(floor.places.middle, camera.target.slice(0, 2));
    gl.uniform1f(floor.places.reach, 5 * camera.distance);
    gl.uniform1f(floor.places.grid, data.floor.grid);
    gl.uniform1f(floor.places.fine, data.floor.grid / data.fine);
    gl.uniform1f(floor.places.pixel, ratio);
    gl.uniform3fv(floor.places.lineColor, rgb(data.colors.grid).map((each) => 0.9 * each));
    gl.uniform3fv(floor.places.target, target ? [...target, data.arrivalRadius] : [0, 0, 0]);
    gl.uniform3fv(floor.places.targetColor, rgb(data.colors.target));
    gl.uniform1i(floor.places.arrived, arrived);
    gl.bindVertexArray(quad.array);
    gl.drawElements(gl.TRIANGLES, quad.count, gl.UNSIGNED_SHORT, 0);
  }

  // A ribbon along points [x, y]: rectangles that overlap; how many of them are drawn is told later.
  function ribbon(points) {
    const vertices = [];
    let along = [1, 0];
    for (let i = 0; i + 1 < points.length; i++) {
      const [a, b] = [points[i], points[i + 1]], length = Math.hypot(b[0] - a[0], b[1] - a[1]);
      if (length > 0) along = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
      const [x, y] = along, corner = ([u, v], end, side) => [u, v, end * x - side * y, end * y + side * x];
      const corners = [corner(a, -1, -1), corner(a, -1, 1), corner(b, 1, -1), corner(b, 1, 1)];
      vertices.push(...[0, 2, 1, 1, 2, 3].flatMap((each) => corners[each]));
    }
    return mesh(path, vertices, null, [["place", 2], ["beside", 2]]);
  }

  // Where shadows, or pieces of a path, overlap they are no darker.
  function blendOnce() {
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
  }

  // Where robots hide it, after they are painted, as if one saw through them.
  function paintPath(camera, ribbon, pieces, width, hidden) {
    if (hidden) {
      gl.depthFunc(gl.GREATER);
      gl.depthMask(false);
      gl.clear(gl.STENCIL_BUFFER_BIT);
      blendOnce();
    }
    gl.useProgram(path.made);
    gl.uniformMatrix4fv(path.places.seen, false, camera.seen);
    gl.uniform1f(path.places.width, 0.5 * width);
    gl.uniform4fv(path.places.color, [...rgb(data.colors.path), hidden ? 0.45 : 1]);
    gl.bindVertexArray(ribbon.array);
    gl.drawArrays(gl.TRIANGLES, 0, 6 * pieces);
    gl.depthFunc(gl.LESS);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.disable(gl.STENCIL_TEST);
  }

  // Solids: {kind, size, matrix, color}; paled when their robot has stopped.
  function paintSolids(camera, solids, shadow, pale) {
    gl.useProgram(solid.made);
    gl.uniformMatrix4fv(solid.places.seen, false, camera.seen);
    gl.uniform3fv(solid.places.light, light);
    gl.uniform3fv(solid.places.eye, camera.eye);
    gl.uniform1i(solid.places.shadow, shadow);
    if (shadow) {
      blendOnce();
      gl.uniform4fv(solid.places.color, [0.1, 0.12, 0.16, pale ? 0.08 : 0.2]);
    } else {
      gl.disable(gl.BLEND);
      gl.disable(gl.STENCIL_TEST);
      gl.enable(gl.DEPTH_TEST);
    }
    for (const { kind, size, matrix, color } of solids) {
      const { array, count } = meshOf(kind, size);
      const shade = rgb(color).map((each) => (pale ? 0.4 * each + 0.6 : each));
      if (!shadow) gl.uniform4fv(solid.places.color, [...shade, 1]);
      gl.uniformMatrix4fv(solid.places.model, false, matrix);
      gl.bindVertexArray(array);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_SHORT, 0);
    }
    gl.disable(gl.BLEND);
    gl.disable(gl.STENCIL_TEST);
  }

  return { start, paintFloor, ribbon, paintPath, paintSolids };
}
