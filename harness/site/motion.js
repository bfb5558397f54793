"use strict";
// The particle in the shear, its axis on the unit sphere, and the plane of L_z and E; all follow one slider.
(() => {
  const { chart, html, read } = polhode;
  const motions = read("motion-data");
  const place = document.getElementById("motion");
  if (!motions.length) return;
  const ORANGE = "#D55E00", BLUE = "#0072B2", PINK = "#C07096", GREY = "#8a8f98";
  const TRAIL = 150, SECONDS = 20;

  const choice = html("label", { className: "field" }, place);
  html("span", { textContent: "motion" }, choice);
  const select = html("select", {}, choice);
  motions.forEach((m, i) => html("option", { value: i, textContent: m.name }, select));
  const says = html("p", {}, place);
  says.setAttribute("role", "status");
  const controls = html("div", { className: "controls" }, place);
  const pair = html("div", { className: "trio" }, place);
  const drawing = (label) => {
    const made = html("canvas", { tabIndex: 0 }, html("figure", { className: "sphere" }, pair));
    made.setAttribute("role", "img");
    made.setAttribute("aria-label", label + " Arrow keys turn the view.");
    return made;
  };
  const particle = drawing("The particle in the shear flow."), canvas = drawing("Axis on the unit sphere.");
  // A colour of the style sheet in the theme that is shown, as a canvas takes it.
  const look = (name) => {
    canvas.style.color = `var(${name})`;
    return getComputedStyle(canvas).color;
  };
  const plane = html("figure", { className: "chart" }, pair);
  html("figcaption", {}, plane);
  const play = html("button", { type: "button", textContent: "Play" }, controls);
  const slider = html("input", { type: "range", min: 0, value: 0, step: 1 }, controls);
  slider.setAttribute("aria-label", "time");
  const step = (text, label, by) => {
    const button = html("button", { type: "button", textContent: text }, controls);
    button.setAttribute("aria-label", label);
    button.addEventListener("click", () => { stop(); slider.value = Number(slider.value) + by; follow(); });
  };
  step("◂", "one sample back", -1);
  step("▸", "one sample on", 1);
  const pace = html("select", {}, controls);
  pace.setAttribute("aria-label", "speed");
  for (const value of [0.25, 0.5, 1, 2]) html("option", { value, textContent: value + " ×", selected: value === 1 }, pace);
  const readout = html("output", {}, controls);
  let motion = motions[0], view = { turn: 0.45, tilt: 0.3 }, drawn = null, playing = 0;

  function spec() {
    const pairs = (flat) => Array.from({ length: flat.length / 2 }, (_, i) => [flat[2 * i], flat[2 * i + 1]]);
    const full = pairs(motion.plane), all = full.concat(pairs(motion.averaged)).map((p) => p[0]);
    const low = Math.min(...all, 0), high = Math.max(...all, 0), pad = 0.05 * (high - low || 1);
    const grid = Array.from({ length: 81 }, (_, i) => low - pad + ((high - low + 2 * pad) * i) / 80);
    const series = [{ name: "full equations", color: BLUE, line: true, mark: "", width: 1.2, points: full }];
    if (motion.averaged.length) series.unshift({ name: "averaged equations", color: PINK, line: true, mark: "", width: 3,
      points: pairs(motion.averaged) });
    return {
      label: "Plane of L_z and E", square: true, series, x: { label: "L_z / I_max" }, y: { label: "E / I_max", min: 0 },
      lines: motion.parabolas.map((factor, i) => ({ points: grid.map((v) => [v, (v * v * factor) / 2]), color: GREY,
        dash: i ? "5 3" : "2 3" })),
    };
  }

  function project([x, y, z]) {
    // The gradient axis y points up, the flow to the right; `turn` goes round y, `tilt` looks down on it.
    const [c, s] = [Math.cos(view.turn), Math.sin(view.turn)], [u, v] = [Math.cos(view.tilt), Math.sin(view.tilt)];
    const depth = -s * x - c * z;
    return [c * x - s * z, u * y + v * depth, u * depth - v * y];
  }

  // A pen whose origin is the middle of a canvas of so many pixels.
  function paper(sheet, size) {
    const density = window.devicePixelRatio || 1, pen = sheet.getContext("2d");
    sheet.style.width = sheet.style.height = size + "px";
    sheet.width = sheet.height = Math.round(size * density);
    pen.setTransform(density, 0, 0, density, (size / 2) * density, (size / 2) * density);
    pen.clearRect(-size, -size, 2 * size, 2 * size);
    pen.lineCap = "round";
    return pen;
  }

  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const LATITUDES = 20, LONGITUDES = 40;

  // Body axes in space at a sample; of a spheroid any two beside its own, since nothing tells them apart.
  function bodyAxes(now) {
    if (motion.rows) {
      const [first, second] = [0, 3].map((k) => motion.rows.slice(6 * now + k, 6 * now + k + 3));
      return [first, second, cross(first, second)];
    }
    const p = at(motion.axis, now), aside = cross(p, Math.abs(p[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]);
    const length = Math.hypot(...aside), q = aside.map((v) => v / length), axes = [];
    axes[motion.symmetry] = p;
    axes[(motion.symmetry + 1) % 3] = q;
    axes[(motion.symmetry + 2) % 3] = cross(p, q);
    return axes;
  }

  function paintParticle(now) {
    const size = Math.min(particle.parentElement.clientWidth, 460), pen = paper(particle, size), R = size * 0.3;
    arrows(pen, R, look("--ink"));
    const axes = bodyAxes(now);
    const point = (i, j) => {
      const a = (Math.PI * i) / LATITUDES, b = (2 * Math.PI * j) / LONGITUDES;
      const u = [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
      // The pole of the mesh is the axis that the page follows.
      const k = motion.pole, own = [];
      [own[(k + 1) % 3], own[(k + 2) % 3], own[k]] = u;
      const add = (values) => [0, 1, 2].map((c) => values.reduce((sum, v, i) => sum + v * axes[i][c], 0));
      return [project(add(own.map((v, i) => v * motion.semi[i]))), project(add(own.map((v, i) => v / motion.semi[i])))];
    };
    for (let i = 0; i < LATITUDES; i++)
      for (let j = 0; j < LONGITUDES; j++) {
        const corners = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
        const normal = [0, 1, 2].map((c) => corners.reduce((sum, corner) => sum + corner[1][c], 0));
        if (normal[2] > 0) continue;
        const light = Math.max(0, (-0.5 * normal[0] + 0.6 * normal[1] - 0.62 * normal[2]) / Math.hypot(...normal));
        const cap = i < 3 || i >= LATITUDES - 3;
        const half = motion.rows && j % 20 < 10, shade = 0.35 + 0.75 * light;
        const colour = cap ? [213, 94, 0] : half ? [120, 165, 205] : [160, 195, 225];
        pen.fillStyle = pen.strokeStyle = `rgb(${colour.map((v) => Math.min(255, v * shade)).join(",")})`;
        pen.lineWidth = 0.7;
        pen.beginPath();
        corners.forEach(([[x, y]], k) => (k ? pen.lineTo(x * R, -y * R) : pen.moveTo(x * R, -y * R)));
        pen.closePath();
        pen.fill();
        pen.stroke();
      }
  }

  // The flow u = y along x, left and right of the particle.
  function arrows(pen, R, ink) {
    pen.strokeStyle = pen.fillStyle = ink;
    pen.globalAlpha = 0.55;
    pen.lineWidth = 1.2;
    const draw = (from, to) => {
      const [[a, b], [c, d]] = [project(from), project(to)], angle = Math.atan2(b - d, c - a);
      pen.beginPath();
      pen.moveTo(a * R, -b * R);
      pen.lineTo(c * R, -d * R);
      if (Math.hypot(c - a, d - b) > 0.05)
        for (const side of [-0.5, 0.5]) {
          pen.moveTo(c * R, -d * R);
          pen.lineTo(c * R - 6 * Math.cos(angle + side), -d * R - 6 * Math.sin(angle + side));
        }
      pen.stroke();
    };
    for (const x of [-1.25, 1.25]) {
      const line = [project([x, -1.25, 0]), project([x, 1.25, 0])];
      pen.beginPath();
      pen.moveTo(line[0][0] * R, -line[0][1] * R);
      pen.lineTo(line[1][0] * R, -line[1][1] * R);
      pen.stroke();
      for (let y = -1.2; y < 1.25; y += 0.3) draw([x, y, 0], [x + 0.38 * y, y, 0]);
    }
    pen.globalAlpha = 1;
  }

  const at = (flat, i) => [flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]];

  function paint() {
    paintParticle(Number(slider.value));
    const size = Math.min(canvas.parentElement.clientWidth, 460), pen = paper(canvas, size), R = size * 0.42;
    const shade = pen.createRadialGradient(-R / 3, -R / 3, R / 8, 0, 0, R);
    const ink = look("--ink");
    shade.addColorStop(0, look("--paper"));
    shade.addColorStop(1, look("--line"));
    pen.fillStyle = shade;
    pen.beginPath();
    pen.arc(0, 0, R, 0, 2 * Math.PI);
    pen.fill();
    pen.strokeStyle = "#c5ccd6";
    pen.stroke();

    const line = (points, color, width, fade) => {
      for (let i = 1; i < points.length; i++) {
        const [a, b] = [project(points[i - 1]), project(points[i])], behind = a[2] + b[2] > 0;
        pen.globalAlpha = (behind ? 0.22 : 1) * (fade ? fade(i) : 1);
        pen.strokeStyle = color;
        pen.lineWidth = width;
        pen.beginPath();
        pen.moveTo(a[0] * R, -a[1] * R);
        pen.lineTo(b[0] * R, -b[1] * R);
        pen.stroke();
      }
      pen.globalAlpha = 1;
    };
    const ring = (f) => Array.from({ length: 73 }, (_, i) => f((Math.PI * i) / 36));
    line(ring((a) => [Math.cos(a), Math.sin(a), 0]), "#b9c1cc", 0.8);
    line(ring((a) => [Math.cos(a), 0, Math.sin(a)]), "#dde2e9", 0.8);
    line(ring((a) => [0, Math.cos(a), Math.sin(a)]), "#dde2e9", 0.8);
    const axes = [["x flow", [1.22, 0, 0]], ["y gradient", [0, 1.14, 0]], ["z vorticity", [0, 0, 1.16]]];
    for (const [, end] of axes) line([[0, 0, 0], end.map((v) => v * 0.94)], "#9aa3af", 0.9);
    const now = Number(slider.value), n = motion.samples;
    const range = (flat, from, to) => Array.from({ length: Math.max(0, to - from + 1) }, (_, i) => at(flat, from + i));
    line(range(motion.axis, 0, n - 1), ORANGE, 0.7, () => 0.16);
    const from = Math.max(0, now - TRAIL);
    line(range(motion.axis, from, now), ORANGE, 2, (i) => 0.15 + (0.85 * i) / (now - from || 1));
    line(range(motion.L, 0, now), ink, 1.2, () => 0.5);
    line(cone(now), BLUE, 1.3);
    arrow(pen, R, at(motion.L, now), ink, "L̂");
    arrow(pen, R, at(motion.axis, now), ORANGE, "");
    // Names come last, each on a ground of its own: lines behind them end where they begin.
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = look("--soft");
    pen.strokeStyle = look("--paper");
    pen.lineWidth = 4;
    for (const [name, end] of axes) {
      const [px, py] = project(end);
      const x = Math.max(-size / 2 + 2, Math.min(size / 2 - 2, px * R * 1.02)), y = Math.max(12 - size / 2, -py * R);
      pen.textAlign = Math.abs(px) < 0.3 ? "center" : px > 0 ? "right" : "left";
      pen.strokeText(name, x, y);
      pen.fillText(name, x, y);
    }
  }

  function arrow(pen, R, tip, color, name) {
    const [px, py, depth] = project(tip);
    pen.globalAlpha = depth > 0 ? 0.45 : 1;
    pen.strokeStyle = pen.fillStyle = color;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(0, 0);
    pen.lineTo(px * R, -py * R);
    pen.stroke();
    pen.beginPath();
    pen.arc(px * R, -py * R, 4.5, 0, 2 * Math.PI);
    pen.fill();
    if (name) pen.fillText(name, px * R + 12, -py * R - 6);
    pen.globalAlpha = 1;
  }

  // The torque-free path from here: a circle about L̂ for a spheroid, one computed beforehand for an ellipsoid.
  function cone(now) {
    if (motion.circle) {
      const p = at(motion.axis, now), l = at(motion.L, now), c = p[0] * l[0] + p[1] * l[1] + p[2] * l[2];
      const u = p.map((v, i) => v - c * l[i]);
      const w = [l[1] * u[2] - l[2] * u[1], l[2] * u[0] - l[0] * u[2], l[0] * u[1] - l[1] * u[0]];
      return Array.from({ length: 61 }, (_, k) => {
        const a = (Math.PI * k) / 30;
        return [0, 1, 2].map((i) => c * l[i] + Math.cos(a) * u[i] + Math.sin(a) * w[i]);
      });
    }
    if (!motion.paths.length) return [];
    const path = motion.paths[Math.round(((motion.paths.length - 1) * now) / (motion.samples - 1))];
    return Array.from({ length: path.length / 3 }, (_, i) => at(path, i));
  }

  function follow() {
    const now = Number(slider.value), t = (motion.time * now) / (motion.samples - 1);
    paint();
    drawn.place(motion.plane[2 * now], motion.plane[2 * now + 1]);
    readout.innerHTML = `t = ${t.toFixed(1)}` + (motion.stokes ? `, t₂ = ${(t / motion.stokes).toFixed(3)}` : "") +
      `, L<sub>z</sub>/I<sub>max</sub> = ${motion.plane[2 * now].toFixed(3).replace("-", "−")}, ` +
      `E/I<sub>max</sub> = ${motion.plane[2 * now + 1].toFixed(3)}`;
  }

  function take() {
    motion = motions[Number(select.value)];
    slider.max = motion.samples - 1;
    slider.value = Math.round(motion.samples / 6);
    says.textContent = motion.says;
    plane.querySelector("figcaption").textContent = "Solved in the form " + motion.how + ".";
    if (drawn) drawn.update(spec());
    else drawn = chart(plane, spec());
    follow();
  }

  function run(began, start) {
    const frame = (now) => {
      if (!playing) return;
      const share = start + (Number(pace.value) * (now - began)) / 1000 / SECONDS;
      slider.value = Math.round(Math.min(1, share) * (motion.samples - 1));
      follow();
      if (share < 1) playing = requestAnimationFrame(frame);
      else stop();
    };
    playing = requestAnimationFrame(frame);
  }

  function stop() {
    cancelAnimationFrame(playing);
    playing = 0;
    play.textContent = "Play";
  }

  play.addEventListener("click", () => {
    if (playing) return stop();
    play.textContent = "Pause";
    const share = Number(slider.value) / (motion.samples - 1);
    run(performance.now(), share >= 1 ? 0 : share);
  });
  select.addEventListener("change", () => { stop(); take(); });
  slider.addEventListener("input", () => { stop(); follow(); });
  plane.addEventListener("redrawn", follow);
  window.addEventListener("resize", paint);
  // A canvas keeps the colours that it was painted with.
  new MutationObserver(paint).observe(document.body, { attributeFilter: ["data-theme"] });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  function turn(by, down) {
    view = { turn: view.turn + by, tilt: Math.max(-1.57, Math.min(1.57, view.tilt + down)) };
    paint();
  }
  for (const sheet of [particle, canvas]) {
    sheet.addEventListener("pointermove", (event) => event.buttons && turn(-event.movementX * 0.01, event.movementY * 0.01));
    sheet.addEventListener("keydown", (event) => {
      const move = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
      if (!move) return;
      event.preventDefault();
      turn(...move);
    });
  }
  take();
})();
