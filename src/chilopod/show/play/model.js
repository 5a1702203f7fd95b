"use strict";
// The planar robot of chilopod.planar: the same equations, contact pattern and Dormand-Prince 8(5,3) method.

/** Robot that walks.
 *
 * @param {object} data  Robot as chilopod.show.play writes it, SI units and radians.
 * @param {number} tolerance  Bound on the local error of a step, relative to max(1, |state|).
 */
function planarRobot(data, tolerance) {
  const n = data.modules, size = 2 * n + 4, half = 0.5 * data.length;
  const { A, B, C, E3, E5 } = data.tableau, stages = 12;
  const moments = Array.from({ length: n }, () => new Float64Array(8));
  const work = Array.from({ length: n }, () => new Float64Array(10));
  const slopes = Array.from({ length: stages + 1 }, () => new Float64Array(size));
  const trial = new Float64Array(size);
  const stops = [...data.gait.times.slice(1).map((time, segment) => ({ time, segment: segment + 1 })),
                 ...data.legYaw.events.map((event) => ({ time: event.phase * data.gait.period, side: event.side }))]
    .sort((a, b) => a.time - b.time);

  const robot = {
    time: 0, state: new Float64Array(size), springs: Float64Array.from(data.springs), legYaw: [0, 0], target: null,
    steersSpring: false, bentTooFar: false, friction: 1,
    restart, advance, setSpring, observe, bend, place, feet,
  };
  let segment, since, cycle, next, step;
  let ramp = null;  // of the first spring, as the actuator of a robot file without limits makes it
  restart([]);
  return robot;

  /** Puts the robot at the origin, along x, at the speed of the straight walk. */
  function restart(jointAngles) {
    robot.state.fill(0);
    robot.state[0] = data.speed;
    jointAngles.forEach((angle, joint) => { robot.state[3 + joint] = angle; });
    robot.time = cycle = next = since = segment = 0;
    robot.legYaw = [0, 0];
    robot.bentTooFar = false;
    ramp = null;
    step = 0.01;
    touchDown();
  }

  /** Sets the stiffness of a spring, N*m/rad, at once or, for the first one, within a time, s. */
  function setSpring(joint, stiffness, within = 0) {
    if (joint === 0) ramp = within > 0 ? { from: firstSpring(robot.time), start: robot.time, within } : null;
    robot.springs[joint] = stiffness;
  }

  function firstSpring(time) {
    if (!ramp) return robot.springs[0];
    const share = Math.min((time - ramp.start) / ramp.within, 1);
    return ramp.from + share * (robot.springs[0] - ramp.from);
  }

  /** Walks on until a time, s. */
  function advance(until) {
    while (robot.time < until && !robot.bentTooFar) {
      const stop = stops[next], at = cycle * data.gait.period + stop.time;
      const ended = ramp ? ramp.start + ramp.within : Infinity, here = Math.min(at, until, ended);
      if (here > robot.time) integrate(here - robot.time);
      robot.time = here;
      if (here === ended) ramp = null;
      if (here === at) arrive(stop);
      for (let joint = 0; joint < n - 1; joint++) {
        if (!(Math.abs(robot.state[3 + joint]) <= Math.PI / 2)) robot.bentTooFar = true;
      }
    }
  }

  function arrive(stop) {
    if (stop.side === undefined) {
      segment = stop.segment % (data.gait.times.length - 1);
      since = 0;
      touchDown();
    } else if (robot.target) {
      steer(stop.side);
    }
    next = (next + 1) % stops.length;
    if (next === 0) cycle += 1;
  }

  // Contact moments of the feet that stand, at the beginning of a segment (chilopod.planar.contact).
  function touchDown() {
    for (let i = 0; i < n; i++) {
      const out = moments[i].fill(0);
      for (let side = 0; side < 2; side++) {
        if (!data.gait.contact[segment][i][side]) continue;
        const yaw = i === 0 ? robot.legYaw[side] : 0;
        const ex = -2 * Math.sin(0.5 * yaw) ** 2, ey = Math.sin(yaw), stroke = data.gait.stroke[segment][i][side];
        const x = data.forwardOffset + stroke * (1 + ex);
        const y = (side === 0 ? data.halfWidth : -data.halfWidth) + stroke * ey, c = data.friction * robot.friction;
        out[0] += c;
        out[1] += c * x;
        out[2] += c * y;
        out[3] += c * (x * x + y * y);
        out[4] += c * ex;
        out[5] += c * ey;
        out[6] += c * (x * (1 + ex) + y * ey);
        out[7] += c * (x * ey - y * ex);
      }
    }
  }

  // -- steering: the paper's leg yaw, and chilopod.steering.SpringLaw
  // -----------------------------------------------------------------------------------------------------------------

  function steer(side) {
    const seen = observe(), { step: most, limit } = data.legYaw;
    const sought = robot.legYaw[0] < 0 ? -Math.PI / 2 : Math.PI / 2;
    const bearing = seen.inView ? seen.bearing : sought;
    const change = clip(bearing - robot.legYaw[side], -most, most);
    robot.legYaw[side] = clip(robot.legYaw[side] + change, -limit, limit);
    if (side === 0 && robot.steersSpring) setSpring(0, lawSpring(seen, sought), data.legYaw.window);
  }

  function observe() {
    const [x, y, heading] = robot.state.subarray(2 * n + 1);
    const dx = robot.target[0] - x, dy = robot.target[1] - y, distance = Math.hypot(dx, dy);
    const bearing = wrapped(Math.atan2(dy, dx) - heading);
    return { bearing, distance, inView: distance <= data.view.range && Math.abs(bearing) <= data.view.angle };
  }

  function lawSpring(seen, sought) {
    const law = data.law, curvature = wantedCurvature(seen, sought), wanted = law.arm * curvature;
    let furthest = 0;
    for (let joint = 0; joint < n - 1; joint++) furthest = Math.max(furthest, Math.abs(robot.state[3 + joint]));
    const share = bend() * Math.sign(wanted) / Math.max(Math.abs(wanted), law.straight);
    if (share < 0 || Math.abs(wanted) < law.straight || furthest > law.mostBent) return law.stiffest;
    if (share < 1 - law.band) return law.softest;
    if (share >= 1 + law.band) return law.stiffest;
    return clip(interpolated(Math.abs(curvature), law.curvatures, law.springs), law.softest, law.stiffest);
  }

  function wantedCurvature({ bearing, distance, inView }, sought) {
    const law = data.law;
    if (!inView) return Math.sign(sought) / law.tightest;
    const ahead = distance * Math.cos(bearing), aside = Math.abs(distance * Math.sin(bearing));
    if (Math.hypot(ahead, aside - law.tightest) < law.tightest - data.arrivalRadius) return 0;
    return 2 * Math.sin(clip(bearing, -Math.PI / 2, Math.PI / 2)) / clip(distance, data.arrivalRadius, law.ahead);
  }

  /** Bend of the body: minus the sum of the joint angles, left positive, rad. */
  function bend() {
    let sum = 0;
    for (let joint = 0; joint < n - 1; joint++) sum -= robot.state[3 + joint];
    return sum;
  }

  // -- motion
  // -----------------------------------------------------------------------------------------------------------------

  function integrate(duration) {
    const x = robot.state;
    let t = 0;
    rhs(since, x, slopes[0]);
    for (let count = 0; t < duration && count < 100000; count++) {
      const last = step >= (duration - t) * (1 - 1e-12), h = last ? duration - t : step;
      const error = attempt(x, since + t, h);
      if (error <= 1) {
        t = last ? duration : t + h;
        x.set(trial);
        slopes[0].set(slopes[stages]);
        const factor = error === 0 ? 6 : Math.min(6, 0.9 * error ** -0.125);
        if (!last || factor < 1) step = h * factor;
      } else {
        step = h * Math.max(0.2, error < Infinity ? 0.9 * error ** -0.125 : 0.2);
      }
    }
    since += duration;
  }

  // A step from x into `trial`; returns its error over the tolerated one.
  function attempt(x, t, h) {
    for (let s = 1; s < stages; s++) {
      for (let i = 0; i < size; i++) {
        let sum = 0;
        for (let j = 0; j < s; j++) sum += A[s][j] * slopes[j][i];
        trial[i] = x[i] + h * sum;
      }
      rhs(t + C[s] * h, trial, slopes[s]);
    }
    for (let i = 0; i < size; i++) {
      let sum = 0;
      for (let j = 0; j < stages; j++) sum += B[j] * slopes[j][i];
      trial[i] = x[i] + h * sum;
    }
    rhs(t + h, trial, slopes[stages]);
    let fifth = 0, third = 0;
    for (let i = 0; i < size; i++) {
      let e5 = 0, e3 = 0;
      for (let j = 0; j <= stages; j++) {
        e5 += E5[j] * slopes[j][i];
        e3 += E3[j] * slopes[j][i];
      }
      const scale = tolerance * Math.max(1, Math.abs(x[i]), Math.abs(trial[i]));
      fifth = Math.max(fifth, Math.abs(e5) / scale);
      third = Math.max(third, Math.abs(e3) / scale);
      if (!Number.isFinite(trial[i] + e5)) return Infinity;
    }
    return fifth || third ? h * fifth * fifth / Math.sqrt(fifth * fifth + 0.01 * third * third) : 0;
  }

  // dx/dt by the articulated-body recursion (chilopod.planar.dynamics.rhs), a time t after the last switch.
  function rhs(t, x, out) {
    const m = data.mass, speed = data.speed, travel = speed * t;
    let rate = x[2], vx = x[0], vy = x[1], c = 1, s = 0;
    for (let i = 0; i < n; i++) {
      const w = work[i];
      if (i > 0) {
        vx += half * rate * s;
        vy -= half * rate * c;
        rate += x[n + 1 + i];
        const bc = Math.cos(x[2 + i]), bs = Math.sin(x[2 + i]);
        [c, s] = [c * bc - s * bs, s * bc + c * bs];
        vx += half * rate * s;
        vy -= half * rate * c;
        const stiffness = i > 1 ? robot.springs[i - 1] : firstSpring(robot.time - since + t);
        w[9] = -stiffness * x[2 + i] - data.damping[i - 1] * x[n + 1 + i];
      }
      w[0] = c;
      w[1] = s;
      w[2] = rate;
      w[3] = vx;
      w[4] = vy;
    }
    let pxx = 0, pxy = 0, pyy = 0, fx = 0, fy = 0, behind = 0;
    for (let i = n - 1; i >= 0; i--) {
      const w = work[i], q = moments[i];
      [c, s, rate] = w;
      const cx = q[1] - travel * (q[0] + q[4]), cy = q[2] - travel * q[5];
      const cpp = q[3] - travel * (2 * q[6] - travel * q[0]), cpxe = q[7] - travel * q[5];
      const u = c * w[3] + s * w[4] - speed, v = c * w[4] - s * w[3];
      const along = cy * rate - q[0] * u + speed * q[4];
      const across = speed * q[5] - q[0] * v - cx * rate;
      const turning = cy * u - cx * v - cpp * rate + speed * cpxe;
      const groundX = c * along - s * across, groundY = s * along + c * across;
      const reach = i > 0 ? half : 0, dx = -reach * c, dy = -reach * s;
      const rx = -(reach + half) * c, ry = -(reach + half) * s, rr = rate * rate;
      const axx = m + pxx, axy = pxy, ayy = m + pyy;
      let bx = -m * rr * dx - groundX, by = -m * rr * dy - groundY, hx = -m * dy, hy = m * dx;
      let j = data.inertia + m * (dx * dx + dy * dy);
      let bt = -turning - (dx * groundY - dy * groundX) + behind;
      if (i < n - 1) {
        const gx = fx - rr * (pxx * rx + pxy * ry), gy = fy - rr * (pxy * rx + pyy * ry);
        const qx = -pxx * ry + pxy * rx, qy = -pxy * ry + pyy * rx;
        hx += qx;
        hy += qy;
        j += -ry * qx + rx * qy;
        bx += gx;
        by += gy;
        bt += rx * gy - ry * gx;
      }
      w[5] = hx;
      w[6] = hy;
      w[8] = bt;
      const inverse = 1 / j;
      if (i > 0) {
        const torque = w[9];
        behind = torque;
        w[7] = inverse;
        pxx = axx - hx * hx * inverse;
        pxy = axy - hx * hy * inverse;
        pyy = ayy - hy * hy * inverse;
        fx = bx + hx * (torque - bt) * inverse;
        fy = by + hy * (torque - bt) * inverse;
      } else {
        const sxx = axx - hx * hx * inverse, sxy = axy - hx * hy * inverse, syy = ayy - hy * hy * inverse;
        const gx = -bx + hx * bt * inverse, gy = -by + hy * bt * inverse, d = 1 / (sxx * syy - sxy * sxy);
        const ax = (syy * gx - sxy * gy) * d, ay = (sxx * gy - sxy * gx) * d;
        out[0] = ax + x[2] * x[1];
        out[1] = ay - x[2] * x[0];
        out[2] = -(bt + hx * ax + hy * ay) * inverse;
      }
    }
    let ax = out[0] - x[2] * x[1], ay = out[1] + x[2] * x[0], alpha = out[2];
    for (let i = 1; i < n; i++) {
      [c, s, rate] = work[i - 1];
      const reach = i > 1 ? half : 0, rx = -(reach + half) * c, ry = -(reach + half) * s, w = work[i];
      ax += -alpha * ry - rate * rate * rx;
      ay += alpha * rx - rate * rate * ry;
      const turned = (w[9] - w[8] - w[5] * ax - w[6] * ay) * w[7];
      out[2 + i] = x[n + 1 + i];
      out[n + 1 + i] = turned - alpha;
      alpha = turned;
    }
    const heading = x[2 * n + 3], hc = Math.cos(heading), hs = Math.sin(heading);
    out[2 * n + 1] = hc * x[0] - hs * x[1];
    out[2 * n + 2] = hs * x[0] + hc * x[1];
    out[2 * n + 3] = x[2];
  }

  // -- picture
  // -----------------------------------------------------------------------------------------------------------------

  /** Centre and heading of every module, front to rear. */
  function place() {
    let [x, y, heading] = robot.state.subarray(2 * n + 1);
    const found = [[x, y, heading]];
    for (let joint = 0; joint < n - 1; joint++) {
      x -= half * Math.cos(heading);
      y -= half * Math.sin(heading);
      heading += robot.state[3 + joint];
      x -= half * Math.cos(heading);
      y -= half * Math.sin(heading);
      found.push([x, y, heading]);
    }
    return found;
  }

  /** Place and contact of every foot, two a module, left first. */
  function feet() {
    const cycles = robot.time / data.gait.period, duty = data.gait.duty;
    return place().flatMap(([x, y, heading], i) => [0, 1].map((side) => {
      const phase = (((cycles + data.gait.phases[i][side]) % 1) + 1) % 1, stands = phase < duty;
      const swung = Math.PI * (phase - duty) / (1 - duty);
      const stroke = data.gait.stride * (stands ? 0.5 - phase / duty : -0.5 * Math.cos(swung));
      const yaw = i === 0 ? robot.legYaw[side] : 0;
      const ahead = data.forwardOffset + stroke * Math.cos(yaw);
      const left = (side === 0 ? 1 : -1) * data.halfWidth + stroke * Math.sin(yaw);
      const cos = Math.cos(heading), sin = Math.sin(heading);
      return { x: x + ahead * cos - left * sin, y: y + ahead * sin + left * cos, stands };
    }));
  }

  function clip(value, low, high) {
    return Math.min(Math.max(value, low), high);
  }

  function wrapped(angle) {
    return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
  }

  function interpolated(value, xs, ys) {
    if (value <= xs[0]) return ys[0];
    for (let i = 1; i < xs.length; i++) {
      if (value <= xs[i]) return ys[i - 1] + (ys[i] - ys[i - 1]) * (value - xs[i - 1]) / (xs[i] - xs[i - 1]);
    }
    return ys[ys.length - 1];
  }
}
