"use strict";
// Where all shapes of a robot are at any time: joint positions unpacked, interpolated between frames, and followed
// along the chain of bodies. Rotations are quaternions [w, x, y, z].
function replayPoses(data) {
  const { bodies, shapes, scale, time } = data;
  const coordinates = scale.origin.length;
  const nowhere = -32768;

  function product(p, q) {
    return [
      p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
      p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
      p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
      p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    ];
  }

  function turned([w, x, y, z], [a, b, c]) {
    const s = 2 * (y * c - z * b), t = 2 * (z * a - x * c), u = 2 * (x * b - y * a);
    return [a + w * s + y * u - z * t, b + w * t + z * s - x * u, c + w * u + x * t - y * s];
  }

  const sum = (a, b, sign = 1) => [a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2]];

  function matrix([w, x, y, z], [a, b, c]) {
    return new Float32Array([
      1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
      2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
      2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0,
      a, b, c, 1,
    ]);
  }

  function joined(values, place, turn, joint) {
    if (joint.free) {
      const q = values.slice(joint.at + 3, joint.at + 7), size = Math.hypot(...q);
      return [values.slice(joint.at, joint.at + 3), q.map((each) => each / size)];
    }
    const anchor = sum(place, turned(turn, joint.anchor)), half = 0.5 * values[joint.at], sine = Math.sin(half);
    const after = product(turn, [Math.cos(half), sine * joint.axis[0], sine * joint.axis[1], sine * joint.axis[2]]);
    return [sum(anchor, turned(after, joint.anchor), -1), after];
  }

  // One coordinate in a frame; a robot that never started has none.
  const value = (raw, frame, i) => scale.origin[i] + scale.step[i] * raw[frame * coordinates + i];
  const exists = (raw) => raw[0] !== nowhere;

  // Matrices of all shapes, by columns as WebGL has them; now in s.
  function at(raw, now) {
    const frame = Math.max(0, Math.min(time.count - 1, time.step > 0 ? (now - time.start) / time.step : 0));
    const below = Math.floor(frame + 1e-6), above = Math.min(below + 1, time.count - 1);
    const share = Math.max(0, frame - below), values = [];
    for (let i = 0; i < coordinates; i++) {
      values.push((1 - share) * value(raw, below, i) + share * value(raw, above, i));
    }
    const placed = [];
    for (const body of bodies) {
      // The first body is the floor, which is its own parent.
      const [origin, facing] = placed[body.parent] || [[0, 0, 0], [1, 0, 0, 0]];
      let place = sum(origin, turned(facing, body.place)), turn = product(facing, body.turn);
      for (const joint of body.joints) [place, turn] = joined(values, place, turn, joint);
      placed.push([place, turn]);
    }
    return shapes.map((shape) => {
      const [place, turn] = placed[shape.body];
      return matrix(product(turn, shape.turn), sum(place, turned(turn, shape.place)));
    });
  }

  return { at, exists, value };
}
