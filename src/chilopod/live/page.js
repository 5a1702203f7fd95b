"use strict";
// What viser's page lacks: dark where the system is, Escape, a link to copy, names of controls for screen readers, folders
// that open by a key, room for the picture on a phone, and pictures where there is no WebGL.
(() => {
  const SOFTWARE = "Software WebGL", EVERY = 700, COPIED = 2000;

  const asked = new URLSearchParams(location.search);
  if (matchMedia("(prefers-color-scheme: dark)").matches && !asked.has("darkMode")) {
    asked.set("darkMode", "");
    history.replaceState(null, "", `?${asked}`);
  }

  addEventListener("keydown", (event) => {
    if (event.key === "Escape") [...document.querySelectorAll(".mantine-Modal-body button")].pop()?.click();
    const button = event.target instanceof Element && event.target.closest("button, [data-keys]");
    if (!button || ![" ", "Enter"].includes(event.key)) return;
    event.stopPropagation();  // else the space bar would pause the walk too
    if (!button.matches("[data-keys]")) return;
    event.preventDefault();
    button.click();
  }, true);

  const ICONS = { "list-search": "Commands", adjustments: "Settings of the view", "arrow-back": "Back to the controls" };

  function set(element, attributes) {
    for (const [name, value] of Object.entries(attributes))
      if (element && element.getAttribute(name) !== value) element.setAttribute(name, value);
  }

  // Names, roles and states that viser leaves out.
  function describe() {
    const root = document.getElementById("root");
    set(root, { role: "main" });
    const title = () => [...root.querySelectorAll("div")].find((each) => !each.children.length && each.textContent === document.title);
    set(root.querySelector("[role=heading]") || title(), { role: "heading", "aria-level": "1" });
    set(root.querySelector("canvas[data-engine]"), { role: "img", "aria-label": "The robot on the floor" });
    for (const slider of root.querySelectorAll(".mantine-Slider-root[id]")) {
      const name = root.querySelector(`label[for="${slider.id}"]`)?.textContent || "";
      for (const each of slider.parentNode.querySelectorAll("[role=slider], input[type=text]")) set(each, { "aria-label": name });
    }
    for (const [icon, name] of Object.entries(ICONS))
      set(root.querySelector(`.tabler-icon-${icon}`)?.closest("button"), { "aria-label": name });
    const named = {
      ".mantine-Notification-closeButton": "Close", "[role=progressbar]": "Progress", "section[role=dialog]": "Commands",
      "input[value^='ws']": "Address of the server", "[aria-haspopup=dialog]:not(button)": "Properties",
    };
    for (const [where, name] of Object.entries(named))
      for (const each of document.querySelectorAll(`${where}:not([aria-label], [aria-labelledby])`)) set(each, { "aria-label": name });
    for (const each of root.querySelectorAll("div[aria-haspopup=dialog]")) set(each, { role: "button", tabindex: "0", "data-keys": "" });
    for (const each of root.querySelectorAll("img:not([alt])")) set(each, { alt: "" });
    for (const inside of root.querySelectorAll(".mantine-Paper-root > .mantine-Paper-root + [aria-hidden]")) {
      const open = String(inside.getAttribute("aria-hidden") === "false");
      set(inside.previousElementSibling, { role: "button", tabindex: "0", "aria-expanded": open, "data-keys": "" });
    }
  }

  addEventListener("click", (event) => {
    const button = event.target instanceof Element && event.target.closest("[data-copy]");
    if (!button) return;
    const said = (text) => {
      button.textContent = text;
      setTimeout(() => { button.textContent = "Copy"; }, COPIED);
    };
    // Only this machine's own addresses count as safe enough for a script to copy.
    if (!navigator.clipboard) said("Select it");
    else navigator.clipboard.writeText(button.dataset.copy).then(() => said("Copied"), () => said("Select it"));
  });

  function withoutWebGL() {
    document.body.innerHTML = "<div class='chilopod-pictures'><h1>chilopod live</h1><p>This browser has no WebGL, which "
      + "the page in three dimensions needs. The robot walks on in pictures, as its address has it: <code>?k1=8</code> "
      + "sets the first spring, <code>?seed=2</code> begins anew.</p><img alt='The robot, seen from above'></div>";
    const image = document.querySelector("img");
    let count = 0;
    setInterval(() => { image.src = `picture.svg?${count++}`; }, EVERY);
  }

  addEventListener("DOMContentLoaded", () => {
    const canvas = document.createElement("canvas");
    if (!canvas.getContext("webgl2")) { setTimeout(withoutWebGL, 0); return; }
    let full = false;  // at first the sheet is empty, and the picture must not take its room
    const sheets = new ResizeObserver(([{ target }]) => {
      full ||= target.offsetHeight > 0.3 * innerHeight;
      if (!full) return;
      document.documentElement.style.setProperty("--sheet", `${target.offsetHeight}px`);
    });
    let watched = null;
    new MutationObserver(() => {
      describe();
      const sheet = document.querySelector('#root [style*="max-height: 60%"]');
      if (sheet && sheet !== watched) {
        sheets.disconnect();
        sheets.observe(watched = sheet);
      }
      // It would cover the robot for ever.
      for (const each of document.querySelectorAll(".mantine-Notification-root")) {
        if (each.textContent.startsWith(SOFTWARE)) each.querySelector("button")?.click();
      }
    }).observe(document.body, { childList: true, subtree: true, attributeFilter: ["aria-hidden"] });
  });
})();
