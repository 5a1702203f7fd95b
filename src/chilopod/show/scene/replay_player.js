"use strict";
// The targets of a robot that have had their turn, or have it, and whether one of them has been reached.
const begun = (robot, now) => robot.aims.filter(({ since }) => now >= since - 1e-9);
const isReached = ({ reached }, now) => reached !== null && now >= reached;

// Time and its controls, and the panels of all robots, of every kind of replay. The kind draws: it calls start with a
// function of a robot, the frame that is shown and the time in s, which may lie between two frames.
function replayPlayer(data, aspect) {
  const { time } = data;
  const byId = (id) => document.getElementById(id);
  const play = byId("play"), scrub = byId("scrub"), clock = byId("clock"), speed = byId("speed");
  const follow = byId("follow"), panels = byId("panels");
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const last = time.count - 1;
  const end = time.start + last * time.step;
  const robots = data.robots.map((robot, index) => {
    const figure = panels.children[index];
    return {
      ...robot,
      canvas: figure.querySelector("canvas"),
      caption: figure.querySelector("figcaption"),
      label: figure.querySelector(".outcome"),
    };
  });

  for (const robot of robots) robot.springs = robot.springs.map((each) => new Uint16Array(bytes(each).buffer));

  // Stiffness of a spring relative to the stiffest of all, and what it looks like: thin and light when soft.
  function spring(robot, joint, frame) {
    const steps = robot.springs[joint], share = steps[Math.min(frame, steps.length - 1)] / 65535;
    const width = data.springs.thin + (1 - data.springs.thin) * share;
    const channels = [1, 3, 5].map((at) => 255 + width * (parseInt(data.colors.spring.slice(at, at + 2), 16) - 255));
    return { share, width, color: `#${channels.map((each) => Math.round(each).toString(16).padStart(2, "0")).join("")}` };
  }

  let now = time.start, playing = false, previous = 0, waiting = false, draw = () => {};

  function show() {
    const frame = Math.max(0, Math.min(last, Math.floor((now - time.start) / time.step + 1e-6)));
    scrub.value = frame;
    clock.value = `${now.toFixed(1)} s of ${end.toFixed(1)} s`;
    scrub.setAttribute("aria-valuetext", `${now.toFixed(1)} seconds`);
    for (const robot of robots) {
      draw(robot, frame, now);
      const known = now >= robot.outcome.time - 0.5 * time.step;
      const first = robot.steers ? (data.springs.stiffest * spring(robot, 0, frame).share).toPrecision(3) : "";
      const softness = first ? `, k₁ = ${first} N·mm/deg` : "";
      robot.label.textContent = (known ? robot.outcome.text : "walking") + softness;
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

  // Soon, once, however often it is asked for; while playing the next frame does it anyway.
  function redraw() {
    if (playing || waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; show(); });
  }

  const actions = {
    " ": () => setPlaying(!playing),
    ArrowLeft: (event) => goTo(now - (event.shiftKey ? time.step : 1)),
    ArrowRight: (event) => goTo(now + (event.shiftKey ? time.step : 1)),
    Home: () => goTo(time.start),
    End: () => goTo(end),
    ArrowUp: () => { speed.selectedIndex = Math.min(speed.selectedIndex + 1, speed.length - 1); },
    ArrowDown: () => { speed.selectedIndex = Math.max(speed.selectedIndex - 1, 0); },
  };

  function onKey(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target instanceof HTMLSelectElement) return;
    // On a button or a box the space bar presses that.
    if (!(event.key in actions) || (event.key === " " && [play, follow].includes(event.target))) return;
    event.preventDefault();
    actions[event.key](event);
  }

  function start(drawn) {
    draw = drawn;
    scrub.max = last;
    scrub.addEventListener("input", () => goTo(time.start + Number(scrub.value) * time.step));
    play.addEventListener("click", () => setPlaying(!playing));
    follow.addEventListener("change", show);
    document.addEventListener("keydown", onKey);
    window.addEventListener("resize", layOut);
    follow.checked = /[#&]follow\b/.test(location.hash);
    const asked = /[#&]t=([0-9.]+)/.exec(location.hash);
    if (asked) now = Math.max(time.start, Math.min(end, Number(asked[1]) || time.start));
    layOut();
    if (!asked && !matchMedia("(prefers-reduced-motion: reduce)").matches) setPlaying(true);
  }

  return { robots, follow, actions, bytes, spring, redraw, start };
}
