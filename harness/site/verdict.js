"use strict";
// The look-up, as in lookup.py: runs to make at the St measured, or at the neighbours on both sides.
const lookUp = (() => {
  const SAME = 1e-3, TIE = 1.15, LEAST = 2.2250738585072014e-308;
  const run = (points, error) => points.find((point) => point[0] <= error);

  // Time for an error: logarithms interpolated between two runs.
  function cost(points, error) {
    const place = points.findIndex((point) => point[0] <= error);
    if (place < 0) return null;
    const here = points[place], before = points[place - 1];
    if (!before || here[0] === error) return here[1];
    const share = Math.log(before[0] / error) / Math.log(before[0] / Math.max(here[0], LEAST));
    return Math.exp(Math.log(before[1]) + share * Math.log(here[1] / before[1]));
  }

  // Of each averaged form its least error, and the least time of a run that is good enough.
  function averagedForms(methods, error) {
    const best = new Map();
    for (const { form, averaged, points } of methods) {
      if (!averaged) continue;
      const least = Math.min(...points.map((point) => point[0])), seconds = run(points, error)?.[1] ?? null;
      const entry = best.get(form) ?? [form, least, null];
      entry[1] = Math.min(entry[1], least);
      if (seconds !== null && (entry[2] === null || seconds < entry[2])) entry[2] = seconds;
      best.set(form, entry);
    }
    return [...best.values()];
  }

  const order = (a, b) => (a < b ? -1 : a > b ? 1 : 0);

  function answer(column, error) {
    const methods = column.limit !== null && error > column.limit ? column.methods : [];
    const found = { St: column.St, averaged: averagedForms(column.methods, error), known: methods.length > 0 };
    const ranked = methods.map((method) => ({ method, seconds: cost(method.points, error) })).filter((entry) => entry.seconds !== null);
    ranked.sort((a, b) => order(a.seconds, b.seconds) || order(a.method.form, b.method.form) || order(a.method.solver, b.method.solver));
    if (!ranked.length) return found;
    let best = ranked[0];
    // An averaged form that is good enough is never dearer than what is recommended.
    for (const entry of ranked)
      if (entry.method.averaged && run(entry.method.points, error)[1] < run(best.method.points, error)[1]) best = entry;
    const rival = ranked.find((entry) => entry.method.label !== best.method.label), made = run(best.method.points, error);
    const tied = Boolean(rival) && rival.seconds / best.seconds <= Math.max(TIE, 1 + made[3], 1 + run(rival.method.points, error)[3]);
    return { ...found, form: best.method.form, solver: best.method.solver, cost: best.seconds, error: made[0], seconds: made[1],
      tolerance: made[2], next: rival ? [rival.method.form, rival.method.solver, rival.seconds] : null, tied };
  }

  return (columns, particle, want, St, error) => {
    const own = columns.filter((one) => one.particle === particle && one.want === want && one.St > 0).sort((a, b) => a.St - b.St);
    const same = own.filter((one) => Math.abs(one.St / St - 1) < SAME);
    const neighbours = [own.findLast((one) => one.St < St), own.find((one) => one.St > St)].filter(Boolean);
    const chosen = same.length ? same : neighbours;
    return { beyond: !same.length && chosen.length < 2, answers: chosen.map((column) => answer(column, error)) };
  };
})();
if (typeof module !== "undefined") module.exports = { lookUp };

// The opening page: a question, kept in the address, and its answers.
if (typeof document !== "undefined") (() => {
  const place = document.getElementById("question-data");
  if (!place) return;
  const data = JSON.parse(place.textContent);
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
    const found = lookUp(data.columns, particle.value, want.value, St, allowed);
    mark(found, allowed);
    draw(found, St, allowed);
  }

  // The cells of the map that the answers belong to: the loosest error named there that is no larger than the one allowed.
  function mark(found, allowed) {
    const numbers = new Set(found.answers.map((one) => short(one.St)));
    const links = [...document.querySelectorAll(".map td a")].map((link) => [link, new URLSearchParams(link.getAttribute("href").slice(1))])
      .filter(([link, query]) => {
        link.removeAttribute("aria-current");
        return query.get("particle") === particle.value && query.get("want") === want.value && numbers.has(query.get("St"));
      });
    const errors = links.map(([, query]) => Number(query.get("error"))).filter((error) => error <= allowed * 1.0001);
    for (const [link, query] of links)
      link.toggleAttribute("aria-current", Number(query.get("error")) === Math.max(...errors));
  }

  const time = (s) => (s >= 1 ? s.toPrecision(2) + " s" : s >= 1e-3 ? (s * 1e3).toPrecision(2) + " ms" : (s * 1e6).toPrecision(3) + " µs");

  function draw(found, St, allowed) {
    answer.replaceChildren();
    const alone = found.answers.length === 1;
    // The fields are not printed: the question stands in words.
    made("p", { className: "note", textContent: `For ${data.wants[want.value]} of the ${data.particles[particle.value]}: St = ${short(St)}, error at most ${short(allowed)}.` }, answer);
    if (!alone) made("p", { textContent: `St = ${short(St)} lies between two that were measured:` }, answer);
    for (const one of found.answers) {
      const first = made("p", { className: "first" }, answer);
      if (!alone || found.beyond) first.append(`At St = ${short(one.St)}: `);
      if (one.form) recommend(first, one, allowed);
      else first.append(one.known ? "no run measured gets to this error." : "the reference is not good enough to say.");
      averaging(one, allowed);
      if (one.form) command(`polhode solve scene.toml --form ${one.form} --solver ${one.solver} --tolerance ${short(one.tolerance)}`);
    }
    const unsure = found.beyond || !alone || found.answers.some((one) => !one.form);
    if (unsure) {
      const why = found.beyond ? `St = ${short(St)} lies beyond what was measured.` : alone ? "" : "In between, ask for your own scene.";
      made("p", { textContent: [why, "pick races the methods on your scene:"].filter(Boolean).join(" ") }, answer);
      command(`polhode pick scene.toml --error ${short(allowed)} --want ${want.value}`);
    }
    const note = made("p", { className: "note" }, answer);
    for (const one of found.answers) {
      const span = data.columns.find((column) => column.particle === particle.value && column.want === want.value && column.St === one.St).span;
      note.append(`Measured at St = ${short(one.St)}${span ? " over " + span : ""}: `, made("a", { textContent: "all runs there",
        href: "cost.html#" + new URLSearchParams({ scene: "regimes: " + particle.value, St: String(one.St),
          error: want.value === "slow" ? "slow_error" : "orientation_error" }) }), ". ");
    }
  }

  function recommend(first, one, allowed) {
    first.append("Run ", made("b", { textContent: one.form }), " by ", made("b", { textContent: one.solver }), " at tolerance ",
      made("b", { textContent: short(one.tolerance) }), ": ", made("b", { textContent: time(one.seconds) }), ".");
    const rival = one.next && `${one.next[0]} by ${one.next[1]}`, lead = one.next && one.next[2] / one.cost;
    const next = !rival ? "No other method gets to this error." : one.tied ? `A tie: ${rival} takes as long, within the spread of repeats.`
      : `The next, ${rival}, takes ${short(lead, 2)} times as long to an error of ${short(allowed)}.`;
    made("p", { textContent: `Its measured error is ${short(one.error, 2)}. ${next}` }, answer);
  }

  // What each averaged form does at this St.
  function averaging(one, allowed) {
    const lines = one.averaged.map(([form, least, seconds]) => seconds === null
      ? `form ${form} errs by ${short(least, 2)}, not good enough` : `form ${form} is good enough, in ${time(seconds)}`);
    if (lines.length) made("p", { textContent: `Averaged equations at St = ${short(one.St)}: ${lines.join("; ")}.` }, answer);
    else if (want.value === "orientation") made("p", { textContent: `No averaged form was measured for the orientation at St = ${short(one.St)}.` }, answer);
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

  // One stop of the tab key for each map; arrows go from cell to cell.
  for (const table of document.querySelectorAll(".map")) {
    const rows = [...table.tBodies[0].rows].map((row) => [...row.cells].slice(1).map((cell) => cell.querySelector("a")));
    const links = rows.flat().filter(Boolean);
    links.forEach((link, i) => (link.tabIndex = i ? -1 : 0));
    table.addEventListener("focusin", (event) => {
      if (links.includes(event.target)) links.forEach((link) => (link.tabIndex = link === event.target ? 0 : -1));
    });
    table.addEventListener("keydown", (event) => {
      const [down, right] = { ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0] }[event.key] ?? [0, 0];
      let row = rows.findIndex((own) => own.includes(document.activeElement));
      if (row < 0 || !(down || right)) return;
      event.preventDefault();
      let column = rows[row].indexOf(document.activeElement);
      do {
        row += down;
        column += right;
      } while (rows[row] && column in rows[row] && !rows[row][column]);
      rows[row]?.[column]?.focus();
    });
  }

  addEventListener("hashchange", take);
  take();
})();
