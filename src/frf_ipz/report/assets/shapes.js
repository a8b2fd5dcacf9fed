"use strict";
// The structure in space and in motion: measured beside the models, turned with the mouse or the arrow keys.
(() => {
  const figure = document.getElementById("shape");
  if (!figure) return;
  const CYCLE_MS = 1600;
  const VIEWS = { space: [-60, 24], front: [-90, 0], side: [0, 0], top: [-90, 90] }; // azimuth and elevation, degrees
  const TURN = 10, PER_PX = 0.5; // degrees: by a key, by a pixel that the pointer moves
  const find = (selector) => figure.querySelector(selector);
  const canvas = find("canvas");
  const state = { structure: null, shape: null, phase: 0, size: 1, azimuth: -60, elevation: 24, isPlaying: false, isSeen: false, last: 0 };

  // --- From space to the screen -----------------------------------------------------------------------------------

  function camera() {
    const [a, e] = [state.azimuth, state.elevation].map((angle) => (angle * Math.PI) / 180);
    const [ca, sa, ce, se] = [Math.cos(a), Math.sin(a), Math.cos(e), Math.sin(e)];
    // across, up, towards the eye
    return ([x, y, z]) => [ca * y - sa * x, ce * z - se * (ca * x + sa * y), ce * (ca * x + sa * y) + se * z];
  }

  function frame(seen) {
    const { reach } = state.structure;
    const ends = (k) => [Math.min(...seen.map((p) => p[k])) - reach, Math.max(...seen.map((p) => p[k])) + reach];
    const [[left, right], [low, high]] = [ends(0), ends(1)];
    const { width, height } = canvas;
    const scale = Math.min(width / (right - left), height / (high - low));
    return ([x, y, depth]) => [width / 2 + scale * (x - (left + right) / 2), height / 2 - scale * (y - (low + high) / 2), depth];
  }

  function placed(motion) {
    const [c, s] = [state.size * Math.cos(state.phase), -state.size * Math.sin(state.phase)];
    return motion.rows.map((row, k) => state.structure.at[row].map((at, axis) => at + c * motion.real[k][axis] + s * motion.imag[k][axis]));
  }

  // --- Drawing -----------------------------------------------------------------------------------------------------

  const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

  function polyline(pen, points, lines) {
    pen.beginPath();
    for (const [a, b] of lines) { pen.moveTo(points[a][0], points[a][1]); pen.lineTo(points[b][0], points[b][1]); }
    pen.stroke();
  }

  // Faces from the back to the front, the lighter the more they face the eye.
  function surface(pen, points, faces, colour, paper) {
    const depth = faces.map((face) => face.reduce((sum, k) => sum + points[k][2], 0) / face.length);
    for (const place of [...faces.keys()].sort((a, b) => depth[a] - depth[b])) {
      const corners = faces[place].map((k) => points[k]);
      const [p, q, r] = corners;
      const [u, v] = [0, 1, 2].reduce(([m, n], k) => [[...m, q[k] - p[k]], [...n, r[k] - p[k]]], [[], []]);
      const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const facing = Math.abs(normal[2]) / (Math.hypot(...normal) || 1);
      pen.fillStyle = `color-mix(in srgb, ${colour} ${Math.round(75 - 45 * facing)}%, ${paper})`;
      pen.beginPath();
      corners.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      pen.closePath();
      pen.fill();
      pen.stroke();
    }
  }

  const SYMBOLS = {
    sensor: (pen, x, y, r) => pen.rect(x - r, y - r, 2 * r, 2 * r),
    input: (pen, x, y, r) => { pen.moveTo(x, y + r); pen.lineTo(x - r, y - r); pen.lineTo(x + r, y - r); pen.closePath(); },
    point: (pen, x, y, r) => {
      for (let k = 0; k < 10; k += 1) {
        const [angle, radius] = [(k * Math.PI) / 5, k % 2 ? 0.5 * r : 1.3 * r];
        pen.lineTo(x + radius * Math.sin(angle), y - radius * Math.cos(angle));
      }
      pen.closePath();
    },
  };

  // A port stands amid the nodes that it joins, with a line to each.
  function marks(pen, ground, ratio) {
    const colours = { sensor: ink("updated"), input: ink("alert"), point: ink("good") };
    for (const { kind, rows, text } of state.structure.marks) {
      const joined = rows.map((row) => ground[row]);
      const middle = [0, 1].map((k) => joined.reduce((sum, p) => sum + p[k], 0) / joined.length);
      pen.strokeStyle = colours[kind];
      pen.fillStyle = rows.length > 1 ? ink("paper") : colours[kind];
      pen.lineWidth = 1.5 * ratio;
      pen.setLineDash([2 * ratio, 3 * ratio]);
      if (rows.length > 1) joined.forEach(([x, y]) => { pen.beginPath(); pen.moveTo(...middle); pen.lineTo(x, y); pen.stroke(); });
      pen.setLineDash([]);
      pen.beginPath();
      SYMBOLS[kind](pen, ...middle, 5 * ratio);
      pen.fill();
      pen.stroke();
      if (state.structure.marks.length > 24) continue; // more labels would cover each other
      pen.fillStyle = colours[kind];
      pen.font = `${12 * ratio}px system-ui, sans-serif`;
      pen.textAlign = kind === "point" ? "right" : "left";
      pen.fillText(text, middle[0] + (kind === "point" ? -9 : 9) * ratio, middle[1] + (kind === "input" ? -9 : 15) * ratio);
    }
  }

  // Lines that are no side of a face: frames beside a surface.
  function looseLines() {
    const { structure } = state;
    if (!structure.looseLines) {
      const key = (a, b) => (a < b ? `${a} ${b}` : `${b} ${a}`);
      const sides = new Set(structure.faces.flatMap((face) => face.map((corner, k) => key(corner, face[(k + 1) % face.length]))));
      structure.looseLines = structure.lines.filter(([a, b]) => !sides.has(key(a, b)));
    }
    return structure.looseLines;
  }

  function draw() {
    const { structure, shape } = state;
    if (!structure || !shape || !structure.at.length) return;
    const ratio = window.devicePixelRatio || 1;
    const box = canvas.getBoundingClientRect();
    if (box.width) [canvas.width, canvas.height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    const pen = canvas.getContext("2d");
    const seen = camera();
    const turned = structure.at.map(seen);
    const screen = frame(turned);
    const ground = turned.map(screen);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.lineJoin = "round";
    Object.assign(pen, { strokeStyle: ink("line"), lineWidth: 1.5 * ratio });
    polyline(pen, ground, structure.lines);
    // The first one that moves all nodes is the surface; the others are dashed, behind a surface or over lines.
    const whole = shape.motions.filter((motion) => motion.isWhole);
    const isSurface = structure.faces.length > 0;
    const order = isSurface ? [...whole.keys()].reverse() : [...whole.keys()];
    for (const place of order) {
      const points = placed(whole[place]).map((point) => screen(seen(point)));
      const colour = ink(whole[place].name === "measured" ? "ink" : whole[place].name);
      Object.assign(pen, { strokeStyle: colour, lineWidth: (place ? 1.2 : isSurface ? 0.7 : 3) * ratio });
      pen.setLineDash(place ? [6 * ratio, 4 * ratio] : []);
      if (!place && isSurface) surface(pen, points, structure.faces, colour, ink("paper"));
      polyline(pen, points, place || !isSurface ? structure.lines : looseLines());
    }
    pen.setLineDash([]);
    for (const motion of shape.motions.filter((one) => !one.isWhole)) {
      const colour = ink(motion.name === "measured" ? "ink" : motion.name);
      Object.assign(pen, { strokeStyle: colour, fillStyle: colour, lineWidth: 1.2 * ratio });
      placed(motion).forEach((point, k) => {
        const [x, y] = screen(seen(point));
        pen.beginPath();
        pen.moveTo(...ground[motion.rows[k]].slice(0, 2));
        pen.lineTo(x, y);
        pen.stroke();
        pen.beginPath();
        pen.arc(x, y, 4 * ratio, 0, 2 * Math.PI);
        pen.fill();
      });
    }
    if (find("#marks").checked) marks(pen, ground, ratio);
    find("#phase").value = Math.round((state.phase * 180) / Math.PI) % 360;
  }

  // --- What is shown -----------------------------------------------------------------------------------------------

  function show(structure, shape) {
    const isNew = !state.structure;
    Object.assign(state, { structure, shape });
    if (isNew) setView(structure.isRow ? "front" : "space");
    find("figcaption").textContent = shape.title;
    canvas.setAttribute("aria-label", `${shape.title}: ${shape.motions.map((motion) => motion.title).join("; ")}`);
    const legend = find("#shape-legend");
    legend.textContent = "";
    for (const motion of shape.motions) {
      const [item, key] = [document.createElement("li"), document.createElement("span")];
      key.className = `key ${motion.name}`;
      item.append(key, motion.title);
      legend.append(item);
    }
    draw();
  }

  function setView(name) {
    [state.azimuth, state.elevation] = VIEWS[name];
    draw();
  }

  function turn(azimuth, elevation) {
    state.azimuth = (state.azimuth + azimuth) % 360;
    state.elevation = Math.max(-90, Math.min(90, state.elevation + elevation));
    draw();
  }

  function tick(now) {
    if (!state.isPlaying || !state.isSeen) return;
    if (state.last) state.phase = (state.phase + (2 * Math.PI * (now - state.last)) / CYCLE_MS) % (2 * Math.PI);
    state.last = now;
    draw();
    requestAnimationFrame(tick);
  }

  function play(isOn, isSeen = state.isSeen) {
    const stood = !state.isPlaying || !state.isSeen;
    Object.assign(state, { isPlaying: isOn, isSeen });
    const button = find("#play");
    button.textContent = isOn ? "Pause" : "Play";
    button.setAttribute("aria-pressed", isOn);
    if (stood && isOn && isSeen) { state.last = 0; requestAnimationFrame(tick); }
  }

  function steer(event) {
    const turns = { ArrowLeft: [-TURN, 0], ArrowRight: [TURN, 0], ArrowUp: [0, TURN], ArrowDown: [0, -TURN] };
    if (event.key === "0") setView(state.structure.isRow ? "front" : "space");
    else if (event.key in turns) turn(...turns[event.key]);
    else return;
    event.preventDefault();
  }

  function listen() {
    find("#phase").addEventListener("input", (event) => {
      play(false);
      state.phase = (event.target.value * Math.PI) / 180;
      draw();
    });
    find("#size").addEventListener("input", (event) => { state.size = Number(event.target.value); draw(); });
    find("#marks").addEventListener("change", draw);
    find("#play").addEventListener("click", () => play(!state.isPlaying));
    figure.querySelectorAll("[data-view]").forEach((button) => button.addEventListener("click", () => setView(button.dataset.view)));
    canvas.addEventListener("keydown", steer);
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (canvas.hasPointerCapture(event.pointerId)) turn(-PER_PX * event.movementX, PER_PX * event.movementY);
    });
    new ResizeObserver(draw).observe(canvas);
    new MutationObserver(draw).observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
    new IntersectionObserver(([entry]) => play(state.isPlaying, entry.isIntersecting)).observe(figure);
    state.isPlaying = !window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    play(state.isPlaying);
  }

  function startFromPage() {
    const held = document.getElementById("shape-data");
    if (!held) return; // the server is asked
    const { structure, shapes } = JSON.parse(held.textContent);
    const modes = find("[name=mode]");
    modes.addEventListener("change", () => show(structure, shapes[modes.value]));
    show(structure, shapes[modes.value]);
  }

  listen();
  startFromPage();
  globalThis.frfIpzShape = { show, draw };
})();
