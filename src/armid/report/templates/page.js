"use strict";

// Sort a table by the column of a button: numbers by value, text by name, what is empty last either way.
function sortBy(button) {
  const head = button.closest("th");
  const column = [...head.parentNode.children].indexOf(head);
  const direction = head.getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
  const sign = direction === "ascending" ? 1 : -1;
  const body = head.closest("table").tBodies[0];
  const rows = [...body.rows].map((row) => ({ row, cell: row.cells[column] }));
  const key = (cell) => (cell.dataset.number === undefined ? cell.textContent.trim() : Number(cell.dataset.number));
  const compare = (a, b) => {
    const [x, y] = [key(a.cell), key(b.cell)];
    if (x === "" || y === "") return (x === "") - (y === "");
    if (typeof x !== typeof y) return typeof x === "number" ? -1 : 1;
    return sign * (typeof x === "number" ? Math.sign(x - y) || 0 : x.localeCompare(y, "en", { numeric: true }));
  };
  rows.sort(compare).forEach(({ row }) => body.append(row));
  for (const other of head.parentNode.children) other.setAttribute("aria-sort", other === head ? direction : "none");
}

// Fade between two layers: the first alone at one end, both in the middle, the last alone at the other end.
function fade(input) {
  const share = Number(input.value) / 100;
  const box = input.closest(".gallery");
  const show = (name, opacity) => box.querySelectorAll(name).forEach((layer) => (layer.style.opacity = opacity));
  show(".layer-before", Math.min(1, 2 - 2 * share));
  show(".layer-after", Math.min(1, 2 * share));
  const words = { 0: "before", 0.5: "both", 1: "after" }[share];
  input.setAttribute("aria-valuetext", words ?? `${Math.round(100 * share)} % after`);
}

document.querySelectorAll("th > button").forEach((button) => button.addEventListener("click", () => sortBy(button)));
document.querySelectorAll(".gallery input").forEach((input) => input.addEventListener("input", () => fade(input)));
