"use strict";
// The opening page: a question, kept in the address, and its answer from the measured cells.
(() => {
  const place = document.getElementById("question-data");
  if (!place) return;
  const data = JSON.parse(place.textContent);
  const measured = data.columns.flatMap(({ cells, ...column }) => cells.map((cell) => ({ ...column, ...cell })));
  const form = document.getElementById("ask"), answer = document.getElementById("answer");
  const START = { particle: "ellipsoid", St: "10000", error: "1e-6", want: "slow" };

  function made(name, properties, parent) {
    const node = Object.assign(document.createElement(name), properties);
    if (parent) parent.append(node);
    return node;
  }

  function field(label, name, properties) {
    const box = made("label", { className: "field" }, form);
    made("span", { textContent: label }, box);
    const control = made(name, properties, box);
    control.addEventListener(name === "select" ? "change" : "input", ask);
    return control;
  }

  const choices = (words, select) => Object.entries(words).forEach(([value, text]) =>
    made("option", { value, textContent: text }, select));
  const particle = field("particle", "select", {});
  choices(data.particles, particle);
  const stokes = field("Stokes number St", "input", { inputMode: "decimal", size: 8, autocomplete: "off" });
  const error = field("error allowed", "input", { inputMode: "decimal", size: 8, autocomplete: "off" });
  const want = field("error of", "select", {});
  choices(data.wants, want);
  form.addEventListener("submit", (event) => event.preventDefault());

  // "3e3", "1e-4" or "1 %" as a number.
  const number = (text) => {
    const share = /^\s*([\d.eE+-]+)\s*(%?)\s*$/.exec(text);
    return share ? Number(share[1]) * (share[2] ? 0.01 : 1) : NaN;
  };
  // As the links have it; results to two digits.
  const short = (value, digits = 6) => (value >= 1e-3 && value < 1e5 ? String(Number(value.toPrecision(digits)))
    : String(Number(value.toPrecision(digits)).toExponential()).replace("e+", "e"));

  function ask() {
    const query = new URLSearchParams({ particle: particle.value, want: want.value, St: stokes.value, error: error.value });
    history.replaceState(null, "", "#" + query);
    show();
  }

  function take() {
    const query = new URLSearchParams(location.hash.slice(1)), own = (name) => query.get(name) ?? START[name];
    particle.value = own("particle") in data.particles ? own("particle") : Object.keys(data.particles)[0];
    want.value = own("want") in data.wants ? own("want") : Object.keys(data.wants)[0];
    stokes.value = own("St");
    error.value = own("error");
    show();
    if (query.get("error")) form.scrollIntoView({ block: "nearest" });
  }

  function show() {
    const St = number(stokes.value), allowed = number(error.value);
    for (const section of document.querySelectorAll("section.region"))
      section.hidden = section.dataset.particle !== particle.value || section.dataset.want !== want.value;
    if (!(St > 0 && allowed > 0)) {
      answer.replaceChildren(made("p", { textContent: "St and the error allowed are positive numbers, such as 3e3 and 1e-4." }));
      return;
    }
    const cells = measured.filter((cell) => cell.particle === particle.value && cell.want === want.value && cell.St > 0);
    const far = (cell) => Math.abs(Math.log(cell.St / St));
    const nearest = Math.min(...cells.map(far));
    const column = cells.filter((cell) => far(cell) === nearest).sort((a, b) => b.error - a.error);
    const cell = column.find((each) => each.error <= allowed * 1.0001) ?? column[column.length - 1];
    for (const link of document.querySelectorAll(".map td a"))
      link.toggleAttribute("aria-current", link.getAttribute("href").includes(`particle=${cell.particle}&want=${cell.want}&`)
        && link.getAttribute("href").endsWith(`St=${short(cell.St)}&error=${short(cell.error)}`));
    draw(cell, St, allowed, cells);
  }

  function draw(cell, St, allowed, cells) {
    answer.replaceChildren();
    const first = made("p", { className: "first" }, answer);
    if (cell.form) {
      first.append("Run ", made("b", { textContent: cell.form }), " by ", made("b", { textContent: cell.solver }),
        cell.tolerance ? " at tolerance " : "", cell.tolerance ? made("b", { textContent: cell.tolerance }) : "",
        ": about ", made("b", { textContent: cell.time }), ".");
      const next = !cell.next ? "No other method gets to this error." : cell.tied ? `It ties with ${cell.next}.`
        : `The next, ${cell.next}, takes ${cell.lead.replace("×", "")} times as long.`;
      made("p", { textContent: next }, answer);
    } else first.append(cell.known ? "No run measured gets to this error." : "The reference is not good enough to say.");
    averaging(cell, St, allowed, cells);
    if (cell.form) command(`polhode solve scene.toml --form ${cell.form} --solver ${cell.solver}` +
      (cell.tolerance ? ` --tolerance ${cell.tolerance}` : ""));
    const note = made("p", { className: "note" }, answer);
    const asked = Math.abs(cell.St / St - 1) < 1e-3 ? "" : ", the nearest St measured";
    note.append(`Measured at St = ${short(cell.St)}${asked}, for an error of ${short(cell.error)}${cell.span ? ", over " + cell.span : ""}. `,
      made("a", { textContent: "All runs there", href: "cost.html#" + new URLSearchParams({ scene: "regimes: " + cell.particle,
        St: String(cell.St), error: cell.want === "slow" ? "slow_error" : "orientation_error" }) }), ".");
  }

  // The smallest error of each averaged form at St, between the measured ones by a power law.
  function averaging(cell, St, allowed, cells) {
    const known = new Map(cells.map((each) => [each.St, each.averaging]));
    const numbers = [...known.keys()].sort((a, b) => a - b);
    const at = numbers.findLastIndex((x) => x <= St * 1.0001), x = numbers[at], u = numbers[at + 1];
    const lines = Object.keys(known.get(x) ?? {}).flatMap((form) => {
      const y = known.get(x)[form], v = known.get(u)?.[form];
      const value = Math.abs(St / x - 1) < 1e-3 ? y : y * (St / x) ** (Math.log(v / y) / Math.log(u / x));
      return Number.isFinite(value) ? [`${form} errs by about ${short(value, 2)}, ${value <= allowed ? "" : "not "}good enough`] : [];
    });
    if (lines.length) made("p", { textContent: `Averaged equations at St = ${short(St)}: ${lines.join("; ")} for ${short(allowed)}.` }, answer);
    else if (cell.want === "orientation") made("p", { textContent: "No averaged form was measured for the orientation here." }, answer);
  }

  function command(text) {
    const line = made("p", { className: "command" }, answer);
    made("code", { textContent: text }, line);
    const copy = made("button", { type: "button", textContent: "Copy" }, line);
    copy.addEventListener("click", async () => {
      try {
        await navigator.clipboard.writeText(text);
        copy.textContent = "Copied";
      } catch {
        getSelection().selectAllChildren(line.firstChild);
      }
    });
  }

  addEventListener("hashchange", take);
  take();
})();
