// Sorts a table by a column when its heading is clicked; a second click reverses the order.
for (const head of document.querySelectorAll("table.sortable thead th")) {
  const button = document.createElement("button");
  button.append(...head.childNodes);
  head.append(button);
  button.addEventListener("click", () => {
    const table = head.closest("table");
    const column = [...head.parentNode.children].indexOf(head);
    const falling = head.getAttribute("aria-sort") !== "descending";
    for (const other of table.querySelectorAll("thead th")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", falling ? "descending" : "ascending");
    const text = (row) => row.children[column].textContent;
    const number = (row) => {
      const cell = row.children[column];
      if (!cell.classList.contains("number")) return NaN;
      return parseFloat(cell.dataset.value ?? text(row).replaceAll(",", ""));
    };
    const rows = [...table.tBodies[0].rows];
    rows.sort((a, b) => {
      const [x, y] = [number(a), number(b)];
      const equal = x === y || (isNaN(x) && isNaN(y));
      const order = equal ? text(a).localeCompare(text(b)) : isNaN(x) || x < y ? -1 : 1;
      return falling ? -order : order;
    });
    table.tBodies[0].append(...rows);
  });
}
