"use strict";
// What the user does on the page becomes a change of pipeline.toml; the server runs what depends on it, and the page follows.
(() => {
  const FIELDS = {
    pin: ["hz", "why"], reject: ["hz", "why"], exclude: ["low_hz", "high_hz"], band: ["low_hz", "high_hz"], point: ["dof"],
    sensor: ["dof"], retain: ["dofs"],
  };
  const MEMORY = "frf-ipz-show";
  const SOON_MS = 400, LATER_MS = 3000;
  const find = (selector) => document.querySelector(selector);
  const all = (selector) => [...document.querySelectorAll(selector)];
  const stamp = document.body.dataset.stamp;
  let wasRunning = false;
  let dragmode = "zoom";

  // --- Asking the server -------------------------------------------------------------------------------------------

  async function ask(address, wish) {
    const options = wish && { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(wish) };
    const answer = await fetch(address, options);
    const kind = answer.headers.get("content-type") || "";
    const said = kind.startsWith("application/json") ? await answer.json() : { error: await answer.text() };
    if (!answer.ok) throw new Error(said.error || answer.statusText);
    return said;
  }

  async function change(wish, address = "change") {
    complain("");
    try {
      showChoices((await ask(address, wish)).choices);
      wasRunning = true;
      follow();
    } catch (error) {
      complain(error.message);
      document.dispatchEvent(new Event("frf-ipz-refused"));
    }
  }

  function complain(text) {
    find("#problem span").textContent = text;
    find("#problem").hidden = !text;
  }

  function showChoices(html) {
    find("#choices").innerHTML = html; // written and escaped by the server
  }

  // --- Following the run -------------------------------------------------------------------------------------------

  let timer = 0;
  async function follow() {
    clearTimeout(timer);
    let state;
    try {
      state = await ask("state");
    } catch (error) {
      complain("The server does not answer any more. Start 'frf-ipz show' again.");
      return;
    }
    find("#status").hidden = !state.running;
    find("#progress").value = state.fraction;
    find("#doing").textContent = state.text;
    document.documentElement.dataset.running = state.running;
    if (!state.running && state.stamp !== stamp) {
      remember();
      location.reload();
      return;
    }
    if (!state.running && wasRunning) await settled(state);
    wasRunning = state.running;
    timer = setTimeout(follow, state.running ? SOON_MS : LATER_MS);
  }

  async function settled(state) {
    complain(state.error);
    document.dispatchEvent(new Event("frf-ipz-refused")); // or cancelled: nothing has changed
    showChoices((await ask("choices")).choices);
  }

  // --- What stays when the page is read anew -----------------------------------------------------------------------

  function remember() {
    const plot = find("#stabilisation .plot");
    const axis = plot && plot.layout && plot.layout.xaxis;
    const form = find("#shape-form");
    sessionStorage.setItem(MEMORY, JSON.stringify({
      axis: axis && { type: axis.type, range: axis.range }, dragmode,
      theme: document.documentElement.dataset.theme, scale: find("#scale").textContent,
      hidden: all(".chooser input").filter((box) => !box.checked).map((box) => box.value),
      shape: form && Object.fromEntries(new FormData(form)), records: Boolean(find("#record-choices[open]")),
    }));
  }

  const remembered = JSON.parse(sessionStorage.getItem(MEMORY) || "{}");
  sessionStorage.removeItem(MEMORY);

  function restoreLook() {
    if (!remembered.scale) return;
    if (document.documentElement.dataset.theme !== remembered.theme) find("#theme").click();
    if (find("#scale").textContent !== remembered.scale) find("#scale").click();
    const boxes = all(".chooser input");
    boxes.forEach((box) => { box.checked = !remembered.hidden.includes(box.value); });
    if (boxes.length) boxes[0].dispatchEvent(new Event("change"));
  }

  // --- Pictures ----------------------------------------------------------------------------------------------------

  function whenDrawn(name, then) {
    const plot = find(`#${name} .plot`);
    if (!plot) return;
    const look = () => (plot.on ? then(plot) : setTimeout(look, 60));
    look();
  }

  function listenToDiagram(plot) {
    plot.on("plotly_click", (event) => {
      const [point] = event.points.filter((one) => one.data.mode === "markers");
      if (point) fillPole(point.x);
    });
    plot.on("plotly_selected", (event) => {
      if (!event || !event.range || !event.range.x) return;
      const [low, high] = event.range.x.slice(0, 2).sort((a, b) => a - b);
      const form = find("#band-form");
      form.elements.low_hz.value = Math.max(low, 0).toPrecision(6);
      form.elements.high_hz.value = high.toPrecision(6);
      form.querySelector("button").focus({ preventScroll: true });
    });
    plot.on("plotly_afterplot", () => setDrag(dragmode));
    if (remembered.axis && remembered.axis.type === plot.layout.xaxis.type) {
      const [low, high] = remembered.axis.range;
      Plotly.relayout(plot, { "xaxis.range[0]": low, "xaxis.range[1]": high });
    }
    setDrag(remembered.dragmode || "zoom");
  }

  // The page holds of long FRFs what a screen can show; zoomed in, all lines of those that are shown are asked for.
  const zoom = { timer: 0, view: "", curve: null };

  function visibleFrfs(plot) {
    return [...plot.data.keys()].filter((k) => plot.data[k].visible !== false && plot.data[k].meta);
  }

  function viewOf(plot, places) {
    return JSON.stringify([plot.layout.xaxis.type, plot.layout.xaxis.range, places]);
  }

  function listenToFrfs(plot) {
    const first = visibleFrfs(plot);
    if (!first.length) return;
    Object.assign(zoom, { view: viewOf(plot, first), curve: plot.data[first[0]].x });
    plot.on("plotly_afterplot", () => {
      const places = visibleFrfs(plot);
      const isSharp = places.length && plot.data[places[0]].x === zoom.curve && viewOf(plot, places) === zoom.view;
      clearTimeout(zoom.timer);
      if (places.length && !isSharp) zoom.timer = setTimeout(() => sharpen(plot), 250);
    });
  }

  async function sharpen(plot) {
    const places = visibleFrfs(plot);
    const { range, type } = plot.layout.xaxis;
    const [low, high] = range.map((end) => (type === "log" ? 10 ** end : end));
    const frfs = [...new Set(places.map((k) => plot.data[k].meta.frf))];
    Object.assign(zoom, { view: viewOf(plot, places), curve: plot.data[places[0]].x });
    let traces;
    try {
      ({ traces } = await ask(`zoom?${new URLSearchParams({ low, high, frfs })}`));
    } catch (error) {
      return; // nothing was measured there: the picture stays as it is
    }
    if (traces.length !== places.length || viewOf(plot, visibleFrfs(plot)) !== zoom.view) return;
    zoom.curve = traces[0].x;
    Plotly.restyle(plot, { x: traces.map((trace) => trace.x), y: traces.map((trace) => trace.y) }, places);
    plot.dataset.sharp = `${low} ${high}`;
  }

  function setDrag(mode) {
    dragmode = mode;
    all("[data-drag]").forEach((button) => button.setAttribute("aria-pressed", button.dataset.drag === mode));
    const plot = find("#stabilisation .plot");
    if (plot && plot.layout && plot.layout.dragmode !== mode) Plotly.relayout(plot, { dragmode: mode, selectdirection: "h" });
  }

  function fillPole(hertz) {
    const form = find("#pole-form");
    form.elements.hz.value = Number(hertz).toPrecision(6);
    form.elements.why.focus({ preventScroll: true });
    form.classList.add("chosen");
  }

  function listenToStructure(plot) {
    plot.on("plotly_click", (event) => {
      const form = find("#point-form");
      const point = event.points.find((one) => /^(node )?\d+/.test(one.text || ""));
      if (!form || !point) return;
      const isNode = point.text.startsWith("node ");
      form.elements.dof.value = isNode ? `${point.text.slice(5)}:+${form.dataset.direction}` : point.text;
      form.classList.add("chosen");
    });
  }

  // Signs do not matter to a reduction: 18:-z is the motion that 18:z is.
  function toggleRetained() {
    const dof = find("#point-form").elements.dof.value.trim().replace(/:[+-]/, ":");
    if (!dof) return;
    const field = find("#reduce-form").elements.dofs;
    const names = listOf(field.value);
    field.value = (names.includes(dof) ? names.filter((name) => name !== dof) : [...names, dof]).join(" ");
    find("#reduce-form").classList.add("chosen");
  }

  const listOf = (text) => text.split(/[\s,]+/).filter(Boolean);

  // --- The structure in motion -------------------------------------------------------------------------------------

  async function loadShape() {
    const values = find("#shape-form").elements;
    const isOperating = values.mode.value === "";
    find("#operating").hidden = !isOperating;
    const asked = isOperating ? { hz: values.hz.value, input: values.input.value } : { mode: values.mode.value };
    try {
      const { structure, ...shape } = await ask(`shape?${new URLSearchParams(asked)}`);
      frfIpzShape.show(structure, shape);
      complain("");
    } catch (error) {
      complain(error.message);
    }
  }

  function startShapes() {
    const form = find("#shape-form");
    if (!form) return;
    Object.entries(remembered.shape || {}).forEach(([name, value]) => {
      const field = form.elements[name];
      if (field.tagName !== "SELECT" || [...field.options].some((one) => one.value === value)) field.value = value;
    });
    form.addEventListener("change", (event) => { if (event.target.name) loadShape(); });
    form.addEventListener("submit", (event) => event.preventDefault());
    loadShape();
  }

  // --- Forms and buttons -------------------------------------------------------------------------------------------

  function submit(event) {
    event.preventDefault();
    const kind = event.submitter && event.submitter.value;
    if (!(kind in FIELDS)) return;
    const fields = event.target.elements;
    const value = (name) => {
      const { type, value: text } = fields[name];
      return type === "number" ? Number(text) : name === "dofs" ? listOf(text) : text;
    };
    change({ kind, ...Object.fromEntries(FIELDS[kind].map((name) => [name, value(name)])) });
  }

  function click(event) {
    const button = event.target.closest("button");
    if (!button) return;
    const { change: wish, command, drag, fill, mode, allow } = button.dataset;
    if (wish) change(JSON.parse(wish));
    else if (command) change({}, command);
    else if (allow) change({ digest: allow }, "allow");
    else if (drag) setDrag(drag);
    else if (fill) fillPole(fill);
    else if (mode !== undefined) {
      find("#shape-form").elements.mode.value = mode;
      loadShape();
      find("#shapes").scrollIntoView();
    } else if (button.id === "toggle-dof") toggleRetained();
    else if (button.id === "read") complain("");
  }

  // Ctrl-Z and Ctrl-Y mean the pipeline, but in a field the text of that field.
  function undoByKey(event) {
    if (!(event.ctrlKey || event.metaKey) || event.target.closest("input, select, textarea")) return;
    const key = event.key.toLowerCase();
    const command = key === "y" || (key === "z" && event.shiftKey) ? "redo" : key === "z" ? "undo" : "";
    const button = command && find(`[data-command=${command}]`);
    if (!button || button.disabled) return;
    event.preventDefault();
    change({}, command);
  }

  function start() {
    document.addEventListener("submit", submit);
    document.addEventListener("keydown", undoByKey);
    document.addEventListener("click", click);
    document.addEventListener("change", (event) => {
      const { record } = event.target.dataset;
      if (record) change({ kind: "record", name: record, use: event.target.value });
    });
    if (remembered.records && find("#record-choices")) find("#record-choices").open = true;
    restoreLook();
    whenDrawn("stabilisation", listenToDiagram);
    whenDrawn("structure", listenToStructure);
    whenDrawn("frf", listenToFrfs);
    startShapes();
    follow();
  }

  window.workbench = { whenDrawn, change };
  start();
})();
