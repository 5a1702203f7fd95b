"use strict";
(() => {
  const POLL = 4, SILENT = 45;  // s between looks for news; without a sign of life the computation has ended
  const AGAIN = "The same command begins the page anew: it reads the kept trials and computes the rest again, in a few minutes.";
  const parts = (root) => [...root.querySelectorAll("[data-part]")];

  // A copy of this page in a hidden frame hands its parts to the page that is read.
  if (window !== window.parent && window.name === "chilopod-news") {
    window.parent.postMessage({ chilopod: document.documentElement.outerHTML }, "*");
    return;
  }

  // -- tables: sorted by a column, filtered by verdict
  // -----------------------------------------------------------------------------------------------------------------

  const ORDER = ["differs", "undecided", "undetermined", "more", "agrees", "open"];
  let wanted = "", sorted = {};
  const tables = () => [...document.querySelectorAll("table.rows")];

  function filter(look) {
    wanted = look;
    for (const row of document.querySelectorAll("tr.row")) row.hidden = Boolean(look) && row.dataset.look !== look;
    for (const body of document.querySelectorAll("table.rows tbody"))
      body.hidden = Boolean(body.querySelector("tr.row")) && !body.querySelector("tr.row:not([hidden])");
    for (const table of tables()) table.closest("section").hidden = !table.querySelector("tr.row:not([hidden])");
    for (const button of document.querySelectorAll(".filter button"))
      button.setAttribute("aria-pressed", String(button.dataset.look === look));
  }

  function sort(table, column, direction) {
    sorted[table.closest("section").id] = [column, direction];
    const rows = [...table.querySelectorAll("tr.row")];
    rows.forEach((row, index) => { row.place ??= { index, body: row.parentNode }; });
    const last = table.tHead.rows[0].cells.length - 1;
    const key = (row) => column === last ? ORDER.indexOf(row.dataset.look) : row.cells[column].textContent.trim();
    rows.sort((one, other) => {
      const [a, b] = direction ? [key(one), key(other)] : [one.place.index, other.place.index];
      return (direction || 1) * (typeof a === "number" ? a - b : a.localeCompare(b, undefined, { numeric: true }));
    });
    for (const row of rows) (direction ? table.tBodies[0] : row.place.body).append(row);
    table.classList.toggle("sorted", Boolean(direction));
    [...table.tHead.rows[0].cells].forEach((cell, index) => cell.setAttribute(
      "aria-sort", index === column && direction ? (direction > 0 ? "ascending" : "descending") : "none"));
  }

  // The poster of a film is seen whole: its controls come when it is played.
  function uncover() {
    for (const film of document.querySelectorAll("video[controls]:not([data-played])")) {
      const stage = Object.assign(document.createElement("span"), { className: "stage" });
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: "▶ Play" });
      button.setAttribute("aria-label", `Play: ${film.getAttribute("aria-label")}`);
      const start = () => {
        film.controls = true;
        film.dataset.played = "";
        button.remove();
        film.focus();
        film.play();
      };
      button.addEventListener("click", start);
      film.addEventListener("click", start, { once: true });
      film.controls = false;
      film.replaceWith(stage);
      stage.append(film, button);
    }
  }

  function dress() {
    uncover();
    const strip = document.querySelector(".strip"), holder = document.getElementById("tables");
    if (!strip || !holder || !tables().length) return;
    holder.querySelector(".filter")?.remove();
    const bar = Object.assign(document.createElement("p"), { className: "filter" });
    const choices = [["", "All"], ...[...strip.querySelectorAll("a")].map((each) => [each.dataset.look, each.textContent])];
    bar.append("Show: ", ...choices.map(([look, text]) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: text });
      button.dataset.look = look;
      button.addEventListener("click", () => filter(look));
      return button;
    }));
    holder.prepend(bar);
    for (const table of tables()) {
      [...table.tHead.rows[0].cells].forEach((cell, column) => {
        if (cell.querySelector("button")) return;
        const button = Object.assign(document.createElement("button"), { type: "button", textContent: cell.textContent });
        button.addEventListener("click", () => {
          const [before, direction] = sorted[table.closest("section").id] || [-1, 0];
          sort(table, column, before === column ? { 0: 1, 1: -1, "-1": 0 }[direction] : 1);
        });
        cell.replaceChildren(button);
      });
      const [column, direction] = sorted[table.closest("section").id] || [0, 0];
      if (direction) sort(table, column, direction);
    }
    filter(choices.some(([look]) => look === wanted) ? wanted : "");
  }

  document.addEventListener("click", (event) => {
    const link = event.target.closest(".strip a");
    if (link) filter(link.dataset.look);
  });

  // -- news: new parts are put in, and the reader's place stays
  // -----------------------------------------------------------------------------------------------------------------

  let texts = new Map(parts(document).map((each) => [each.id, each.outerHTML]));
  let state = document.body.dataset.state, version = null, missed = 0;
  dress();

  function take(html) {
    const page = new DOMParser().parseFromString(html, "text/html");
    const seen = parts(document).find((each) => each.getBoundingClientRect().bottom > 0);
    const place = seen && [seen.id, seen.getBoundingClientRect().top];
    for (const part of parts(page)) {
      const here = document.getElementById(part.id);
      if (here && (texts.get(part.id) === part.outerHTML || busy(here))) continue;
      texts.set(part.id, part.outerHTML);
      const fresh = document.importNode(part, true);
      const open = [...(here?.querySelectorAll("details") || [])].map((each) => each.open);
      const focus = here ? reached(here).indexOf(document.activeElement) : -1;
      if (here) here.replaceWith(fresh);
      else put(fresh, part);
      if (focus >= 0) reached(fresh)[focus]?.focus({ preventScroll: true });
      [...fresh.querySelectorAll("details")].forEach((each, index) => { each.open = Boolean(open[index]); });
    }
    const kept = new Set(parts(page).map((each) => each.id));
    for (const part of parts(document)) if (!kept.has(part.id) && !busy(part)) part.remove();
    state = document.body.dataset.state = page.body.dataset.state;
    dress();
    const now = place && document.getElementById(place[0]);
    if (now) scrollBy({ top: now.getBoundingClientRect().top - place[1], behavior: "instant" });
  }

  const reached = (part) => [...part.querySelectorAll("a, button, summary, video")];

  // A film that plays waits for the next news.
  function busy(part) {
    return [...part.querySelectorAll("video")].some((film) => !film.paused);
  }

  function put(fresh, part) {
    let before = part.previousElementSibling;
    while (before && !(before.id ? document.getElementById(before.id) : before.tagName === "H2"))
      before = before.previousElementSibling;
    const parent = document.getElementById(part.parentNode.id) || document.querySelector(part.parentNode.tagName);
    const after = before && (before.id ? document.getElementById(before.id) : parent.querySelector("h2"));
    if (after) after.after(fresh);
    else parent.prepend(fresh);
  }

  function renew() {
    const frame = Object.assign(document.createElement("iframe"), { name: "chilopod-news", hidden: true });
    return new Promise((done) => {
      const over = () => { removeEventListener("message", told); frame.remove(); done(); };
      const told = (event) => {
        if (event.source !== frame.contentWindow || typeof event.data?.chilopod !== "string") return;
        take(event.data.chilopod);
        over();
      };
      addEventListener("message", told);
      setTimeout(over, 60000);
      frame.src = `${location.pathname}?news=${Date.now()}`;
      document.body.append(frame);
    });
  }

  function ended(when) {
    const time = new Date(1000 * when).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
    const said = Object.assign(document.createElement("p"), { className: "failed", textContent:
      `The computation has ended: there is no sign of life of it since ${time}. ${AGAIN}` });
    said.setAttribute("role", "status");
    document.querySelector("#status [role=status]").replaceWith(said);
    texts.delete("status");
  }

  let alive = Number(document.body.dataset.written);
  window.chilopodNews = (number, time) => { window.chilopodNews.told = [number, time]; };

  async function look() {
    window.chilopodNews.told = null;
    const script = document.createElement("script");
    await new Promise((done) => {
      script.onload = script.onerror = done;
      script.src = `news.js?${Date.now()}`;
      document.head.append(script);
    });
    script.remove();
    const [number, time] = window.chilopodNews.told || [null, alive];
    missed = number === null ? missed + 1 : 0;
    alive = Math.max(alive, time);
    if (number !== null ? number !== version : missed === 2) {
      version = number;
      await renew();
    }
    if (state !== "running") return;
    if (Date.now() / 1000 - alive > SILENT) ended(alive);
    setTimeout(look, 1000 * POLL);
  }
  if (state === "running") look();
})();
