"use strict";
// Regions that hold more than they show fade out on that side.
for (const region of document.querySelectorAll(".scroll")) {
  const look = () => region.classList.toggle("more", region.scrollLeft + region.clientWidth < region.scrollWidth - 4);
  region.addEventListener("scroll", look, { passive: true });
  new ResizeObserver(look).observe(region);
}
// Tables sort by a click, or Enter, on a header; numbers as numbers.
for (const table of document.querySelectorAll("table.sort")) {
  const scale = { s: 1, ms: 1e-3, "µs": 1e-6 };
  const value = (text) => {
    const [, number, unit] = /^[<~ ]*([-+\d.e]+)\s*(\S*)/.exec(text) || [];
    return number === undefined ? NaN : Number(number) * (scale[unit] ?? 1);
  };
  table.querySelectorAll("th").forEach((head, position) => {
    head.tabIndex = 0;
    const sort = () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const body = table.tBodies[0];
      const rows = [...body.rows].map((row) => [row, row.cells[position].textContent]);
      rows.sort(([, a], [, b]) => {
        const [x, y] = [value(a), value(b)];
        const order = Number.isNaN(x) || Number.isNaN(y) ? Number.isNaN(x) - Number.isNaN(y) || a.localeCompare(b) : x - y;
        return up ? order : -order;
      });
      body.append(...rows.map(([row]) => row));
    };
    head.addEventListener("click", sort);
    head.addEventListener("keydown", (event) => event.key === "Enter" && sort());
  });
}
