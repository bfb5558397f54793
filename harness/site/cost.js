"use strict";
// Cost against accuracy: filters, the diagram, and the list of runs without a result.
(() => {
  const { chart, html, swatch, read } = polhode;
  const data = read("cost-data");
  // A column holds what stands several times in a row as [value, times]; of words and tolerances their places in the list.
  const names = Object.keys(data.columns), column = Object.fromEntries(names.map((name, i) => [name, i]));
  const columns = Object.values(data.columns).map((own) =>
    own.flatMap((v) => (Array.isArray(v) ? Array(v[1]).fill(v[0]) : [v])));
  const runs = columns[0].map((_, i) => columns.map((own) => own[i]));
  for (const row of runs) for (const i of [1, 2, 3, 4, 5]) row[i] = data.words[row[i]];
  const form = document.getElementById("filters");
  const DASHES = ["", "6 3", "2 3", "8 3 2 3", "1 2"];
  const number = (v) => (v === null ? "–" : v >= 0.01 && v < 1e4 ? String(Number(v.toPrecision(3))) : v.toExponential(1).replace(".0e", "e").replace("e+", "e"));
  const time = (s) => (s === null ? "–" : s >= 1 ? s.toPrecision(2) + " s" : s >= 1e-3 ? (s * 1e3).toPrecision(3) + " ms"
    : (s * 1e6).toPrecision(3) + " µs");

  function select(label, options) {
    const box = html("label", { className: "field" }, form);
    html("span", { textContent: label }, box);
    const made = html("select", {}, box);
    options.forEach(([value, text]) => html("option", { value, textContent: text }, made));
    made.addEventListener("change", refresh);
    return made;
  }

  function boxes(title, entries) {
    const set = html("fieldset", {}, form);
    html("legend", { textContent: title }, set);
    const made = entries.map(([name, picture]) => {
      const label = html("label", { className: "box" }, set);
      const box = html("input", { type: "checkbox", checked: true, value: name }, label);
      if (picture) label.append(picture);
      label.append(name);
      box.addEventListener("change", refresh);
      return box;
    });
    const all = html("button", { type: "button", className: "all", textContent: "all / none" }, set);
    all.addEventListener("click", () => {
      const on = !made.every((box) => box.checked);
      made.forEach((box) => (box.checked = on));
      refresh();
    });
    return () => new Set(made.filter((box) => box.checked).map((box) => box.value));
  }

  const named = (g) => g[0] + ": " + g[1];
  const which = [...new Set(data.groups.map(named))];
  const labels = [...new Set(data.groups.flatMap((g) => g[3]))].sort();
  const label = select("tag", [["", "all"], ...labels.map((tag) => [tag, tag])]);
  label.parentElement.hidden = !labels.length;
  label.addEventListener("change", () => offer(scene.value));
  const scene = select("study: scene", []);
  const stokes = select("St", []);
  const want = select("error of", [["slow_error", "L and E"], ["orientation_error", "orientation"]]);
  const cost = select("cost", [["seconds", "wall time"], ["work.rhs_calls", "right-hand-side calls"], ["work.steps", "steps"]]);
  const formNames = Object.keys(data.forms).sort((a, b) => (b === "quaternion") - (a === "quaternion"));
  const forms = boxes("Forms", formNames.map((name) => [name, swatch({ color: data.forms[name].color,
    line: !data.forms[name].averaged, dash: dash(name), mark: data.forms[name].averaged && data.forms[name].mark })]));
  const tags = boxes("Kinds", ["explicit", "implicit", "compiled", "Python in the loop"].map((tag) => [tag]));
  const solvers = boxes("Solvers", Object.entries(data.solvers).map(([name, s]) => [name, swatch({ ...s, line: true })]));
  const csv = html("button", { type: "button", textContent: "CSV of these runs" }, form);
  csv.addEventListener("click", save);
  const address = new URLSearchParams(location.hash.slice(1));
  let before = null, drawn = null, alone = "", seen = [];
  for (const [name, control] of [["error", want], ["cost", cost]])
    if (address.get(name)) control.value = address.get(name);
  offer(address.get("scene") ?? which.find((name) => name.startsWith("bench:")));

  // The scenes that bear the tag chosen.
  function offer(wanted) {
    const own = data.groups.filter((g) => !label.value || g[3].includes(label.value)).map(named);
    scene.replaceChildren(...[...new Set(own)].map((name) => html("option", { value: name, textContent: name })));
    if (own.includes(wanted)) scene.value = wanted;
    refresh();
  }

  function dash(name) {
    return DASHES[formNames.filter((other) => !data.forms[other].averaged).indexOf(name) % DASHES.length] || "";
  }

  function refresh() {
    if (before !== scene.value) {
      const own = data.groups.map((g, i) => [i, g]).filter(([, g]) => named(g) === scene.value);
      // First what the address asks for, then a Stokes number at which forms and solvers differ most.
      const kept = stokes.selectedOptions[0]?.textContent ?? address.get("St") ?? "10000";
      stokes.replaceChildren(...own.map(([i, g]) => html("option", { value: i, textContent: g[2] === null ? "∞" : g[2] })));
      for (const option of stokes.options) if (option.textContent === kept) option.selected = true;
      const present = runs.filter((row) => own.some(([i]) => i === row[0]));
      for (const box of form.querySelectorAll("fieldset input"))
        box.parentElement.hidden = !(data.forms[box.value] || data.solvers[box.value] ? present.some((row) => row.includes(box.value)) : true);
      before = scene.value;
    }
    const rows = runs.filter((row) => String(row[0]) === stokes.value && shown(row));
    history.replaceState(null, "", "#" + new URLSearchParams({ scene: scene.value,
      St: stokes.selectedOptions[0]?.textContent ?? "", error: want.value, cost: cost.value }));
    seen = rows;
    finding(rows);
    if (drawn) drawn.update(spec(rows));
    else drawn = chart(document.getElementById("cost-chart"), spec(rows));
    failures(rows);
  }

  function shown(row) {
    const own = tags();
    if (alone && alone !== row[1] + "," + row[2]) return false;
    return forms().has(row[1]) && solvers().has(row[2]) && data.solvers[row[2]].tags.every((tag) => own.has(tag));
  }

  function spec(rows) {
    const x = column[want.value], y = column[cost.value], series = new Map();
    const rules = new Map();
    for (const row of rows) {
      const averaged = data.forms[row[1]].averaged, look = data.solvers[row[2]];
      if (row[x] === null || row[y] === null) continue;
      const key = row[1] + "," + row[2];
      if (!series.has(key)) series.set(key, { name: key, color: averaged ? data.forms[row[1]].color : look.color, mark: averaged ? data.forms[row[1]].mark : look.mark,
        line: !averaged, dash: dash(row[1]), points: [] });
      series.get(key).points.push([row[x], row[y], tip(row)]);
      if (averaged && want.value === "slow_error") rules.set(row[1], { x: row[column.model_slow_error], color: data.forms[row[1]].color });
    }
    const failed = rows.filter((row) => row[3] !== "reached_end" && !row[column.inferred]);
    const group = data.groups[Number(stokes.value)];
    return {
      label: `Cost against accuracy, ${scene.value}, St = ${group[2] ?? "infinity"}`,
      x: { label: { slow_error: "largest error of L and E, over I_max", orientation_error: "largest orientation error, rad" }[want.value],
        log: true, reverse: true, max: largest(rows, x) },
      y: { label: { seconds: "wall time of a warm run, s", "work.rhs_calls": "calls of the right-hand side" }[cost.value] || "steps", log: true },
      series: [...series.values()],
      front: steps(front(rows)),
      isolate: (name) => { alone = alone ? "" : name || ""; refresh(); },
      rules: [...rules.values()],
      strip: { label: "no result", points: failed.map((row) => [row[5], data.solvers[row[2]].color, data.solvers[row[2]].mark, tip(row)]) },
    };
  }

  // Runs than which none is both cheaper and more accurate, from the least accurate to the most; each halves the error.
  function front(rows, gain = 2) {
    const x = column[want.value], y = column[cost.value], found = [];
    const known = rows.filter((row) => row[3] === "reached_end" && row[x] !== null && row[y] !== null);
    for (const row of known.sort((a, b) => a[y] - b[y])) if (!found.length || (gain > 1 ? gain * row[x] <= found[found.length - 1][x] : row[x] < found[found.length - 1][x])) found.push(row);
    return found;
  }

  function steps(found) {
    const x = column[want.value], y = column[cost.value];
    return found.flatMap((row, i) => (i ? [[found[i - 1][x], row[y]], [row[x], row[y]]] : [[row[x], row[y]]]));
  }

  // The cheapest run at a few errors, in words.
  function finding(rows) {
    const x = column[want.value], y = column[cost.value], found = front(rows, 1);
    const unit = (v) => (cost.value === "seconds" ? time(v) : `${number(v)} ${cost.selectedOptions[0].textContent}`);
    const parts = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10].flatMap((target) => {
      const run = found.find((row) => row[x] <= target);
      return run ? [`${number(target)}: ${run[1]} by ${run[2]}, ${unit(run[y])}`] : [];
    });
    document.getElementById("finding").textContent = parts.length ? `Cheapest, by error reached. ${parts.join("; ")}.`
      : "No run shown reaches an error of 0.01.";
  }

  function save() {
    download("runs.csv", [["study", "scene", "St", ...names.slice(1)], ...seen.map((row) => [...data.groups[row[0]].slice(0, 3), ...row.slice(1)])]);
  }

  function largest(rows, x) {
    const values = rows.map((row) => row[x]).filter((v) => v !== null);
    return values.some((v) => v > data.largest) ? data.largest : undefined;
  }

  function tip(row) {
    const of = (name) => row[column[name]];
    const lines = [`${row[1]}, ${row[2]} at tolerance ${number(row[5])}`];
    if (row[3] !== "reached_end") lines.push(row[3].replaceAll("_", " ") + (of("message") ? ": " + of("message").slice(0, 90) : ""));
    if (of("slow_error") !== null) lines.push(`error of L and E ${number(of("slow_error"))}` +
      (of("model_slow_error") ? ` (model ${number(of("model_slow_error"))})` : ""));
    if (of("orientation_error") !== null) lines.push(`orientation error ${number(of("orientation_error"))} rad`);
    if (of("seconds") !== null) lines.push(`time ${time(of("seconds"))}`);
    lines.push(`right-hand-side calls ${of("work.rhs_calls") ?? "not counted by the library"}, steps ${of("work.steps") ?? "not counted"}`);
    return lines.join("\n");
  }

  function failures(rows) {
    const place = document.getElementById("failures");
    const groups = new Map();
    for (const row of rows) {
      if (row[3] === "reached_end") continue;
      const key = [row[1], row[3]].join("\u0000");
      groups.set(key, [...(groups.get(key) || []), row]);
    }
    if (!groups.size) {
      place.replaceChildren(html("p", { textContent: "None among the runs shown." }));
      return;
    }
    const list = html("ul", {});
    for (const own of groups.values()) {
      const methods = new Map();
      for (const row of own) {
        const at = number(row[5]) + (row[column.inferred] ? " (not tried)" : "");
        methods.set(row[2], [...(methods.get(row[2]) || []), at]);
      }
      const who = [...methods].map(([name, at]) => `${name} at ${at.join(", ")}`).join("; ");
      const meaning = data.meanings[own[0][3]] || own[0][column.message];
      html("li", { textContent: `${own[0][1]}, ${own[0][3].replaceAll("_", " ")} (${meaning}): ${who}` }, list);
    }
    place.replaceChildren(list);
    if (rows.some((row) => row[3] !== "reached_end" && row[column.inferred]))
      html("p", { className: "note", textContent: "Not tried: at a looser tolerance the same form and solver gave no result already." }, place);
  }
})();
