"use strict";
// Regions that hold more than they show fade out on that side, and take the keyboard.
document.querySelectorAll("article :is(.scroll, .table-wrapper, figure, pre, .math)").forEach((region, place) => {
  const kind = region.querySelector("table") ? "Table" : region.matches("pre") ? "Code" : region.matches(".math") ? "Formula" : "Figure";
  const look = () => {
    const wide = region.clientWidth < region.scrollWidth - 4;
    region.classList.toggle("more", wide && region.scrollLeft + region.clientWidth < region.scrollWidth - 4);
    if (!wide) {
      region.removeAttribute("tabindex");
      return;
    }
    region.tabIndex = 0;
    if (region.hasAttribute("aria-label")) return;
    region.setAttribute("role", "region");
    region.setAttribute("aria-label", `${kind} ${place + 1}, wider than the page`);
  };
  region.addEventListener("scroll", look, { passive: true });
  new ResizeObserver(look).observe(region);
  look();
});

// Elements in a row as one tab stop: the arrow keys move along it.
function oneStop(items) {
  items.forEach((item, i) => {
    item.tabIndex = i ? -1 : 0;
    item.addEventListener("focus", () => items.forEach((other) => { other.tabIndex = other === item ? 0 : -1; }));
    item.addEventListener("keydown", (event) => {
      const next = items[i + ({ ArrowLeft: -1, ArrowRight: 1 }[event.key] ?? NaN)];
      if (!next) return;
      event.preventDefault();
      next.focus();
    });
  });
}

// Rows as a file; a cell that begins like a formula would be one to a spreadsheet.
function download(name, rows) {
  const cell = (v) => (v === null ? "" : typeof v === "number" ? v : `"${String(v).replace(/^[=+@-](?![\d.]+(e-?\d+)?$)/, "'$&").replaceAll('"', '""')}"`);
  const text = rows.map((row) => row.map(cell).join(",") + "\n").join("");
  const url = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  Object.assign(document.createElement("a"), { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

// Tables of many rows have filters, kept in the address, and come as CSV; tables of the same columns share them.
// Words alone, as of arguments and what they take, need neither until there are very many rows.
const alike = new Map();
for (const table of document.querySelectorAll("table.docutils"))
  alike.set(table.tHead.textContent, [...(alike.get(table.tHead.textContent) ?? []), table]);
[...alike.values()].forEach((tables, place) => {
  const MANY = 8, VERY_MANY = 20, FEW = 9, SHORT = 20;
  const rows = tables.flatMap((table) => [...table.tBodies[0].rows]);
  const heads = [...tables[0].tHead.rows[0].cells].map((head) => head.textContent);
  const numbers = [...rows[0]?.cells ?? []].some((cell) => cell.classList.contains("text-right"));
  if (rows.length < (numbers ? MANY : VERY_MANY)) return;
  const tools = document.createElement("div");
  tools.className = "tools";
  tables[0].closest(".table-wrapper").before(tools);
  const made = (name, properties) => tools.appendChild(Object.assign(document.createElement(name), properties));
  const asked = (name) => new URLSearchParams(location.hash.slice(1)).get(name + place);
  const words = made("input", { type: "search", placeholder: "filter rows", value: asked("rows") ?? "", name: "rows" });
  words.setAttribute("aria-label", "filter rows");
  // Columns of a few words that come again and again, as verdicts do.
  const choices = heads.flatMap((head, i) => {
    const values = [...new Set(rows.map((row) => row.cells[i].textContent))];
    const fits = values.length > 1 && values.length <= FEW && 2 * values.length <= rows.length
      && values.every((value) => value.length < SHORT && !/^[\d.<~–✓·-]/.test(value)) && !rows[0].cells[i].classList.contains("text-right");
    if (!fits || !head) return [];
    const select = made("select", { name: head });
    select.setAttribute("aria-label", head);
    select.append(new Option(`every ${head}`, ""), ...values.sort().map((value) => new Option(value, value)));
    select.value = values.includes(asked(head)) ? asked(head) : "";
    return [[i, select]];
  });
  const count = made("span", { className: "note" });
  count.setAttribute("role", "status");
  const shown = () => rows.filter((row) => !row.hidden);
  made("button", { type: "button", textContent: "CSV" }).addEventListener("click", () => download("table.csv",
    [heads, ...shown().map((row) => [...row.cells].map((cell) => cell.textContent))]));
  const filter = () => {
    const wanted = words.value.toLowerCase().split(" ");
    for (const row of rows)
      row.hidden = !(wanted.every((word) => row.textContent.toLowerCase().includes(word))
        && choices.every(([i, select]) => !select.value || row.cells[i].textContent === select.value));
    for (const table of tables) table.closest(".table-wrapper").hidden = [...table.tBodies[0].rows].every((row) => row.hidden);
    count.textContent = shown().length < rows.length ? `${shown().length} of ${rows.length} rows` : "";
  };
  const keep = () => {
    const query = new URLSearchParams(location.hash.includes("=") ? location.hash.slice(1) : "");
    for (const control of [words, ...choices.map(([, select]) => select)])
      if (control.value) query.set(control.name + place, control.value);
      else query.delete(control.name + place);
    history.replaceState(null, "", "#" + query);
    filter();
  };
  words.addEventListener("input", keep);
  choices.forEach(([, select]) => select.addEventListener("change", keep));
  filter();
});

// Tables sort by a click, or Enter, on a header; numbers as numbers.
for (const table of document.querySelectorAll("table.docutils")) {
  const scale = { s: 1, ms: 1e-3, "µs": 1e-6 };
  const value = (text) => {
    const [, number, unit] = /^[<~ ]*([-+\d.e]+)\s*(\S*)/.exec(text) || [];
    return number === undefined ? NaN : Number(number) * (scale[unit] ?? 1);
  };
  oneStop([...table.querySelectorAll("thead th")]);
  table.querySelectorAll("thead th").forEach((head) => {
    const position = head.cellIndex;
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
