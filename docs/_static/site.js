// Code and tables that scroll sideways can be scrolled with the keyboard.
document.addEventListener("DOMContentLoaded", () => {
  for (const block of document.querySelectorAll("pre, article table.docutils")) {
    block.tabIndex = 0;
  }
});
