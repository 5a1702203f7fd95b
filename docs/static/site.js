// A page that was opened from disk may not read others, and search goes without their first lines.
if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;

// What is wider than the screen scrolls within its own box, and the box is reached by the keyboard.
const BOXES = "article pre, .table-wrapper, .math-wrapper, .output_html";
function reachable() {
  for (const box of document.querySelectorAll(BOXES))
    box.toggleAttribute("tabindex", box.scrollWidth > box.clientWidth) && box.setAttribute("tabindex", "0");
}
addEventListener("load", reachable);
addEventListener("resize", reachable);

// The theme names neither of its two side bars.
addEventListener("DOMContentLoaded", () => {
  for (const [where, name] of [[".sidebar-drawer", "Site"], [".toc-drawer", "This page"]])
    document.querySelector(where)?.setAttribute("aria-label", name);
});
