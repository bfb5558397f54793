"use strict";
// An axis on the unit sphere, drawn on a canvas, beside the plane of L_z and E; both follow one slider.
(() => {
  const { chart, html, read } = polhode;
  const motions = read("motion-data");
  const place = document.getElementById("motion");
  if (!motions.length) return;
  const BLACK = "#111", ORANGE = "#D55E00", BLUE = "#0072B2", PINK = "#CC79A7", GREY = "#8a8f98";
  const TRAIL = 150, SECONDS = 20;

  const choice = html("label", { className: "field" }, place);
  html("span", { textContent: "motion" }, choice);
  const select = html("select", {}, choice);
  motions.forEach((m, i) => html("option", { value: i, textContent: m.name }, select));
  const pair = html("div", { className: "pair" }, place);
  const canvas = html("canvas", { tabIndex: 0 }, html("figure", { className: "sphere" }, pair));
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "Axis on the unit sphere. Arrow keys turn the view.");
  const plane = html("figure", { className: "chart" }, pair);
  html("figcaption", {}, plane);
  const controls = html("div", { className: "controls" }, place);
  const play = html("button", { type: "button", textContent: "Play" }, controls);
  const slider = html("input", { type: "range", min: 0, value: 0, step: 1 }, controls);
  slider.setAttribute("aria-label", "time");
  const readout = html("output", {}, controls);
  let motion = motions[0], view = { turn: 0.6, tilt: 0.35 }, drawn = null, playing = 0;

  function spec() {
    const pairs = (flat) => Array.from({ length: flat.length / 2 }, (_, i) => [flat[2 * i], flat[2 * i + 1]]);
    const full = pairs(motion.plane), all = full.concat(pairs(motion.averaged)).map((p) => p[0]);
    const low = Math.min(...all, 0), high = Math.max(...all, 0), pad = 0.05 * (high - low || 1);
    const grid = Array.from({ length: 81 }, (_, i) => low - pad + ((high - low + 2 * pad) * i) / 80);
    const series = [{ name: "full equations", color: BLUE, line: true, mark: "", width: 1, points: full }];
    if (motion.averaged.length) series.push({ name: "averaged equations", color: PINK, line: true, mark: "", width: 2.4,
      points: pairs(motion.averaged) });
    return {
      label: "Plane of L_z and E", square: true, series, x: { label: "L_z / I_max" }, y: { label: "E / I_max", min: 0 },
      lines: motion.parabolas.map((factor, i) => ({ points: grid.map((v) => [v, (v * v * factor) / 2]), color: GREY,
        dash: i ? "5 3" : "2 3" })),
    };
  }

  function project([x, y, z]) {
    // The vorticity axis z points up; `turn` goes round it, `tilt` looks down on it.
    const [c, s] = [Math.cos(view.turn), Math.sin(view.turn)], [u, v] = [Math.cos(view.tilt), Math.sin(view.tilt)];
    const depth = -s * x + c * y;
    return [c * x + s * y, u * z + v * depth, u * depth - v * z];
  }

  const at = (flat, i) => [flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]];

  function paint() {
    const size = Math.min(canvas.parentElement.clientWidth, 460), density = window.devicePixelRatio || 1;
    canvas.style.width = canvas.style.height = size + "px";
    canvas.width = canvas.height = Math.round(size * density);
    const pen = canvas.getContext("2d"), R = size * 0.42;
    pen.setTransform(density, 0, 0, density, (size / 2) * density, (size / 2) * density);
    pen.clearRect(-size, -size, 2 * size, 2 * size);
    pen.lineCap = "round";
    const shade = pen.createRadialGradient(-R / 3, -R / 3, R / 8, 0, 0, R);
    shade.addColorStop(0, "#ffffff");
    shade.addColorStop(1, "#e9edf2");
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
    for (const [name, end] of [["x flow", [1.22, 0, 0]], ["y gradient", [0, 1.22, 0]], ["z vorticity", [0, 0, 1.16]]]) {
      line([[0, 0, 0], end.map((v) => v * 0.94)], "#9aa3af", 0.9);
      const [px, py] = project(end);
      pen.fillStyle = "#5b6470";
      pen.font = "12px system-ui, sans-serif";
      pen.textAlign = Math.abs(px) < 0.3 ? "center" : px > 0 ? "right" : "left";
      pen.fillText(name, Math.max(-size / 2 + 2, Math.min(size / 2 - 2, px * R * 1.02)), -py * R);
    }
    const now = Number(slider.value), n = motion.samples;
    const range = (flat, from, to) => Array.from({ length: Math.max(0, to - from + 1) }, (_, i) => at(flat, from + i));
    line(range(motion.axis, 0, n - 1), ORANGE, 0.7, () => 0.16);
    const from = Math.max(0, now - TRAIL);
    line(range(motion.axis, from, now), ORANGE, 2, (i) => 0.15 + (0.85 * i) / (now - from || 1));
    line(range(motion.L, 0, now), BLACK, 1.2, () => 0.5);
    line(cone(now), BLUE, 1.3);
    arrow(pen, R, at(motion.L, now), BLACK, "L̂");
    arrow(pen, R, at(motion.axis, now), ORANGE, "");
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
    plane.querySelector("figcaption").textContent = "Solved in the form " + motion.how + ".";
    if (drawn) drawn.update(spec());
    else drawn = chart(plane, spec());
    follow();
  }

  function run(began, start) {
    const frame = (now) => {
      if (!playing) return;
      const share = start + (now - began) / 1000 / SECONDS;
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
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    view.turn -= event.movementX * 0.01;
    view.tilt = Math.max(-1.57, Math.min(1.57, view.tilt + event.movementY * 0.01));
    paint();
  });
  canvas.addEventListener("keydown", (event) => {
    const move = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (!move) return;
    event.preventDefault();
    view = { turn: view.turn + move[0], tilt: Math.max(-1.57, Math.min(1.57, view.tilt + move[1])) };
    paint();
  });
  take();
})();
