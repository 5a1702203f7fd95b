"use strict";
// What viser's page lacks: dark where the system is, Escape, a link to copy, room for the picture on a phone, and
// pictures where there is no WebGL.
(() => {
  const SOFTWARE = "Software WebGL", EVERY = 700, COPIED = 2000;

  const asked = new URLSearchParams(location.search);
  if (matchMedia("(prefers-color-scheme: dark)").matches && !asked.has("darkMode")) {
    asked.set("darkMode", "");
    history.replaceState(null, "", `?${asked}`);
  }

  addEventListener("keydown", (event) => {
    if (event.key === "Escape") [...document.querySelectorAll(".mantine-Modal-body button")].pop()?.click();
  }, true);

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
      const sheet = document.querySelector('#root [style*="max-height: 60%"]');
      if (sheet && sheet !== watched) {
        sheets.disconnect();
        sheets.observe(watched = sheet);
      }
      // It would cover the robot for ever.
      for (const each of document.querySelectorAll(".mantine-Notification-root")) {
        if (each.textContent.startsWith(SOFTWARE)) each.querySelector("button")?.click();
      }
    }).observe(document.body, { childList: true, subtree: true });
  });
})();
