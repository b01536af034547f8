// Code and tables that scroll sideways can be scrolled with the keyboard.
document.addEventListener("DOMContentLoaded", () => {
  for (const block of document.querySelectorAll("pre, article table.docutils")) {
    block.tabIndex = 0;
  }
  // Titles of tables of contents are headings without a level.
  for (const title of document.querySelectorAll("p.caption[role=heading]")) {
    title.setAttribute("aria-level", "2");
  }
});
