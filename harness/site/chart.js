"use strict";
// Diagrams as SVG, without a library: log or linear axes, lines and markers, a tooltip under pointer and keyboard.
const polhode = (() => {
  const SPACE = "http://www.w3.org/2000/svg";
  const MARGIN = { left: 64, right: 14, top: 12, bottom: 44 };
  const STRIP = 30, NEAR = 26, MARK = 4;

  function node(name, attributes, parent, text) {
    const made = document.createElementNS(SPACE, name);
    for (const key in attributes) made.setAttribute(key, attributes[key]);
    if (text !== undefined) made.textContent = text;
    if (parent) parent.appendChild(made);
    return made;
  }

  function html(name, properties, parent) {
    const made = Object.assign(document.createElement(name), properties);
    if (parent) parent.appendChild(made);
    return made;
  }

  // A marker, an SVG path of unit size, at a point.
  const mark = (path, x, y, attributes, parent) => node("path", { d: path, "vector-effect": "non-scaling-stroke",
    transform: `translate(${x.toFixed(1)} ${y.toFixed(1)}) scale(${MARK})`, ...attributes }, parent);

  function axis(spec, values, low, high) {
    const log = Boolean(spec.log);
    const known = values.filter((v) => Number.isFinite(v) && (!log || v > 0));
    let min = spec.min ?? (known.length ? Math.min(...known) : log ? 1e-3 : 0);
    let max = spec.max ?? (known.length ? Math.max(...known) : 1);
    const f = log ? Math.log10 : (v) => v;
    let a = f(min), b = f(max);
    const pad = (b - a || 1) * 0.04;
    if (spec.min === undefined) a -= pad;
    if (spec.max === undefined) b += pad;
    if (spec.reverse) [a, b] = [b, a];
    const at = (v) => low + ((f(v) - a) / (b - a)) * (high - low);
    const inside = (v) => (f(v) - a) * (f(v) - b) <= 1e-9;
    const clamp = (v) => {
      const place = log && !(v > 0) ? (spec.reverse ? high : low) : at(v);
      return Math.max(Math.min(low, high), Math.min(Math.max(low, high), place));
    };
    return { at, inside, clamp, ticks: ticks(log, Math.min(a, b), Math.max(a, b), Math.abs(high - low)) };
  }

  function ticks(log, a, b, length) {
    const room = Math.max(2, Math.floor(length / 52));
    if (log && b - a >= 1) {
      const step = Math.ceil((Math.floor(b) - Math.ceil(a) + 1) / room) || 1;
      const found = [];
      for (let e = Math.ceil(a / step) * step; e <= b; e += step) found.push({ v: 10 ** e, base: "10", exponent: e });
      return found;
    }
    if (log) [a, b] = [10 ** a, 10 ** b];
    const raw = (b - a) / room, unit = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((m) => m * unit).find((s) => s >= raw);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const found = [];
    for (let k = Math.ceil(a / step - 1e-9); k * step <= b + 1e-9 * step; k++)
      found.push({ v: k * step, base: (k * step).toFixed(digits).replace("-", "−") });
    return found;
  }

  function tickLabel(tick, attributes, parent) {
    const text = node("text", { ...attributes, class: "tick" }, parent, tick.base);
    if (tick.exponent !== undefined)
      node("tspan", { dy: -5, class: "power" }, text, String(tick.exponent).replace("-", "−"));
  }

  // Text in which X_y stands for a subscript.
  function label(text, attributes, parent) {
    const made = node("text", { ...attributes, class: "label" }, parent);
    let low = false;
    for (const part of text.split(/_(max|min|[a-z])\b/)) {
      node("tspan", low ? { dy: 3, class: "power" } : made.childNodes.length ? { dy: -3 } : {}, made, part);
      low = !low;
    }
  }

  // Draws spec into the figure, and draws again when its width changes. Returns { update(spec), place(x, y) }.
  function chart(figure, spec) {
    const holder = html("div", { className: "plot" });
    figure.insertBefore(holder, figure.querySelector("figcaption"));
    let view = null, current = null;
    const tip = html("div", { className: "tip", hidden: true });
    tip.setAttribute("role", "status");

    function draw() {
      const width = Math.max(280, Math.floor(holder.clientWidth || 600));
      const height = spec.square ? Math.min(width, 460) : Math.round(Math.min(520, Math.max(300, 0.6 * width)));
      const strip = spec.strip && spec.strip.points.length ? STRIP : 0;
      const points = spec.series.flatMap((s) => s.points);
      const strips = strip ? spec.strip.points.map((p) => p[0]) : [];
      const x = axis(spec.x, points.map((p) => p[0]).concat(strips), MARGIN.left, width - MARGIN.right);
      const y = axis(spec.y, points.map((p) => p[1]), height - MARGIN.bottom, MARGIN.top + strip);
      const svg = node("svg", { viewBox: `0 0 ${width} ${height}`, tabindex: 0, role: "img", "aria-label": spec.label +
        ". Arrow keys go from point to point." });
      frame(svg, x, y, width, height, strip);
      const flat = [];
      if (spec.front) path(svg, spec.front, x, y, { class: "line front" });
      spec.series.forEach((s, row) => drawSeries(node("g", { class: "series" }, svg), s, row, x, y, flat));
      if (strip) drawStrip(svg, x, flat, spec.series.length);
      view = { svg, x, y, flat, ring: node("circle", { r: 9, class: "ring", visibility: "hidden" }, svg),
        dot: node("circle", { r: 6, class: "dot", visibility: "hidden" }, svg) };
      listen(svg, width);
      holder.replaceChildren(svg, tip);
      tip.hidden = true;
      current = null;
    }

    function frame(svg, x, y, width, height, strip) {
      const grid = node("g", {}, svg), bottom = height - MARGIN.bottom, top = MARGIN.top + strip;
      for (const t of x.ticks) {
        node("line", { x1: x.at(t.v), x2: x.at(t.v), y1: top, y2: bottom, class: "grid" }, grid);
        tickLabel(t, { x: x.at(t.v), y: bottom + 18, "text-anchor": "middle" }, grid);
      }
      for (const t of y.ticks) {
        node("line", { x1: MARGIN.left, x2: width - MARGIN.right, y1: y.at(t.v), y2: y.at(t.v), class: "grid" }, grid);
        tickLabel(t, { x: MARGIN.left - 8, y: y.at(t.v) + 4, "text-anchor": "end" }, grid);
      }
      node("rect", { x: MARGIN.left, y: top, width: width - MARGIN.left - MARGIN.right, height: bottom - top,
        class: "frame" }, svg);
      label(spec.x.label, { x: (MARGIN.left + width) / 2, y: height - 6, "text-anchor": "middle" }, svg);
      label(spec.y.label, { transform: `translate(13 ${(top + bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, svg);
      for (const line of spec.lines || []) path(svg, line.points, x, y, { stroke: line.color, class: "line",
        "stroke-dasharray": line.dash || "", "stroke-width": line.width || 1 });
      for (const rule of (spec.rules || []).filter((rule) => x.inside(rule.x)))
        node("line", { stroke: rule.color, "stroke-dasharray": "2 3", "stroke-width": 1.4,
          x1: x.clamp(rule.x), x2: x.clamp(rule.x), y1: top, y2: bottom }, svg);
    }

    function path(svg, points, x, y, attributes) {
      const clip = "c" + Math.random().toString(36).slice(2);
      const area = node("clipPath", { id: clip }, svg), box = (svg.ownerSVGElement || svg).querySelector(".frame");
      node("rect", Object.fromEntries(["x", "y", "width", "height"].map((k) => [k, box.getAttribute(k)])), area);
      const d = points.map(([a, b]) => x.at(a).toFixed(1) + " " + y.at(b).toFixed(1)).join("L");
      node("path", { d: "M" + d, fill: "none", "clip-path": `url(#${clip})`, ...attributes }, svg);
    }

    function drawSeries(svg, s, row, x, y, flat) {
      const good = s.points.filter((p) => p[0] !== null && p[1] !== null);
      if (s.line) path(svg, good.filter((p) => (!spec.x.log || p[0] > 0) && (!spec.y.log || p[1] > 0)), x, y,
        { stroke: s.color, "stroke-dasharray": s.dash || "", "stroke-width": s.width || 1.4, class: "line" });
      if (!s.mark) return;
      for (const [a, b, text] of good) {
        const px = x.clamp(a), py = y.clamp(b), out = !(x.inside(a) && y.inside(b));
        mark(s.mark, px, py, { fill: out ? "var(--paper)" : s.color, stroke: s.color }, svg);
        flat.push({ px, py, text, row });
      }
    }

    function drawStrip(svg, x, flat, row) {
      const py = MARGIN.top + STRIP / 2 - 4, taken = new Map();
      node("text", { x: MARGIN.left, y: py + 4, class: "tick" }, svg, spec.strip.label);
      spec.strip.points.forEach(([a, color, shape, text]) => {
        const place = x.clamp(a), others = taken.get(place) || 0;
        taken.set(place, others + 1);
        const px = Math.max(MARGIN.left + 70, place - 10 * others);
        mark(shape, px, py, { fill: "var(--paper)", stroke: color, "stroke-width": 1.3 }, svg);
        flat.push({ px, py, text, row });
      });
    }

    function show(point) {
      current = point;
      tip.hidden = !point;
      view.ring.setAttribute("visibility", point ? "visible" : "hidden");
      // The others step back while one line is looked at.
      view.svg.classList.toggle("faded", Boolean(point) && point.row < spec.series.length && spec.series.length > 1);
      view.svg.querySelectorAll(".series").forEach((group, row) => group.classList.toggle("chosen", point?.row === row));
      if (!point) return;
      view.ring.setAttribute("cx", point.px);
      view.ring.setAttribute("cy", point.py);
      tip.textContent = point.text;
      const scale = holder.clientWidth / view.svg.viewBox.baseVal.width;
      const left = point.px * scale, room = holder.clientWidth - tip.offsetWidth - 4;
      tip.style.left = Math.max(4, Math.min(room, left + (left > room - 14 ? -tip.offsetWidth - 14 : 14))) + "px";
      tip.style.top = Math.max(4, point.py * scale - tip.offsetHeight - 10) + "px";
    }

    function listen(svg, width) {
      const point = (event) => {
        const box = svg.getBoundingClientRect(), scale = width / box.width;
        const mx = (event.clientX - box.left) * scale, my = (event.clientY - box.top) * scale;
        let best = null, least = NEAR * NEAR;
        for (const p of view.flat) {
          const far = (p.px - mx) ** 2 + (p.py - my) ** 2;
          if (far < least) [best, least] = [p, far];
        }
        if (best !== current) show(best);
      };
      svg.addEventListener("pointermove", point);
      svg.addEventListener("pointerdown", point);
      // A finger leaves as soon as it is lifted: what it chose stays.
      svg.addEventListener("pointerleave", (event) => event.pointerType === "touch" || show(null));
      svg.addEventListener("dblclick", () => spec.isolate?.(current && spec.series[current.row]?.name));
      svg.addEventListener("blur", () => show(null));
      svg.addEventListener("keydown", (event) => {
        const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key], turn = { ArrowDown: 1, ArrowUp: -1 }[event.key];
        if (event.key === "Escape") show(null);
        if (event.key === "Enter") spec.isolate?.(current && spec.series[current.row]?.name);
        if ((!step && !turn) || !view.flat.length) return;
        event.preventDefault();
        show(neighbour(step, turn));
      });
    }

    function neighbour(step, turn) {
      if (!current) return view.flat[0];
      const rows = [...new Set(view.flat.map((p) => p.row))];
      const row = turn ? rows[(rows.indexOf(current.row) + turn + rows.length) % rows.length] : current.row;
      const own = view.flat.filter((p) => p.row === row).sort((p, q) => p.px - q.px);
      if (turn) return own.reduce((a, b) => (Math.abs(a.px - current.px) <= Math.abs(b.px - current.px) ? a : b));
      return own[Math.max(0, Math.min(own.length - 1, own.indexOf(current) + step))];
    }

    draw();
    let last = holder.clientWidth;
    new ResizeObserver(() => {
      if (holder.clientWidth === last) return;
      last = holder.clientWidth;
      requestAnimationFrame(() => {
        draw();
        figure.dispatchEvent(new Event("redrawn"));
      });
    }).observe(holder);
    return {
      update(next) { spec = next; draw(); },
      place(a, b) {
        view.dot.setAttribute("visibility", "visible");
        view.dot.setAttribute("cx", view.x.at(a));
        view.dot.setAttribute("cy", view.y.at(b));
      },
    };
  }

  function swatch(s) {
    const svg = node("svg", { viewBox: "-12 -7 24 14", width: 24, height: 14, "aria-hidden": "true" });
    if (s.line) node("line", { x1: -12, x2: 12, y1: 0, y2: 0, stroke: s.color, "stroke-dasharray": s.dash || "" }, svg);
    if (s.mark) mark(s.mark, 0, 0, { fill: s.color, stroke: s.color }, svg);
    return svg;
  }

  function read(id) {
    return JSON.parse(document.getElementById(id).textContent);
  }

  return { chart, html, swatch, read };
})();
