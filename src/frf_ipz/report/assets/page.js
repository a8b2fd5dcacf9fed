"use strict";
// Draws the pictures of the page: those on the screen at once, the others when the browser has time.
(() => {
  const page = JSON.parse(document.getElementById("page-data").textContent);
  const root = document.documentElement;
  const THEMES = {
    light: {
      ink: "#1b1f24", muted: "#59636e", grid: "#e4e8ec", paper: "#ffffff",
      measured: "#1b1f24", nominal: "#b45f00", updated: "#0072b2", reference: "#1b1f24", good: "#00795a", bad: "#c44601",
      c0: "#0072b2", c1: "#c44601", c2: "#00795a", c3: "#a3408a", c4: "#8a6a00", c5: "#4b4fc4", c6: "#59636e",
    },
    dark: {
      ink: "#e6e9ed", muted: "#a3adb8", grid: "#2c343d", paper: "#14181d",
      measured: "#e6e9ed", nominal: "#f0a03c", updated: "#5cb8f2", reference: "#e6e9ed", good: "#35c79f", bad: "#ff8a4c",
      c0: "#5cb8f2", c1: "#ff8a4c", c2: "#35c79f", c3: "#e88fc6", c4: "#e8d04a", c5: "#a9abff", c6: "#a3adb8",
    },
  };
  const NO_CLOUD = { displaylogo: false, showSendToCloud: false, plotlyServerURL: "" }; // measurements stay on this machine
  const PRINT_WIDTH = 680, PRINT_SHARE = 0.8; // of the height on a screen: paper is narrower
  const PX_A_TICK = { x: 60, y: 26 }, PX_BESIDE = { x: 118, y: 90 }; // of labels; of margins and legend
  const PX_A_LETTER = 6.5; // of a title, on average
  const MOST_FOR_NAMES = 0.4; // of the width, for the names beside bars
  const FEW_TICKS = 5; // plotly takes no fewer by itself
  const DECADES_A_TICK = 0.31; // plotly: labels 1, 2 and 5 of each decade for more than 0.3 decades a tick
  const MOST_ROWS_TO_OPEN = 40; // longer tables under pictures are for the screen: on paper they would fill pages
  const NARROW_PX = 480, FEW_ENTRIES = 6; // a legend of so many entries there is one entry a row
  const decoded = [];
  const drawn = new Map(); // pictures and places by the name of the place, which may hold one of several pictures
  let theme = "light";
  let hidden = new Set(page.hiddenFrfs);
  let range = null;
  let scale = page.frequencyScale;
  let printing = false;

  function array(index) {
    if (!decoded[index]) {
      const packed = page.arrays[index];
      const text = atob(packed.bytes || packed);
      const buffer = Uint8Array.from(text, (c) => c.charCodeAt(0)).buffer;
      if (packed.bytes) {
        // numbers of 16 bits, evenly spaced, or their logarithms; the largest stands for none
        const value = (k) => (k === 65535 ? NaN : packed.low + packed.step * k);
        decoded[index] = Float32Array.from(new Uint16Array(buffer), packed.log ? (k) => Math.exp(value(k)) : value);
      } else {
        decoded[index] = new Float32Array(buffer);
      }
    }
    return decoded[index];
  }

  function colour(text) {
    const [name, opacity] = text.slice(1).split("/");
    const hex = THEMES[theme][name] || THEMES[theme].muted;
    if (!opacity) return hex;
    const part = (from) => parseInt(hex.slice(from, from + 2), 16);
    return `rgba(${part(1)},${part(3)},${part(5)},${opacity})`;
  }

  function unpack(node) {
    if (typeof node === "string") return node[0] === "@" ? colour(node) : node;
    if (Array.isArray(node)) return node.map(unpack);
    if (node === null || typeof node !== "object") return node;
    if ("$" in node) return array(node.$);
    return Object.fromEntries(Object.entries(node).map(([key, value]) => [key, unpack(value)]));
  }

  function themed(layout, element) {
    const { ink, muted, grid, paper } = THEMES[theme];
    const base = {
      paper_bgcolor: paper, plot_bgcolor: paper, font: { family: "system-ui, sans-serif", size: 12.5, color: ink },
      margin: { l: 74, r: 44, t: 12, b: 46 }, modebar: { orientation: "v", bgcolor: "rgba(0,0,0,0)", color: muted, activecolor: ink }, hovermode: "closest", dragmode: "zoom", autosize: true,
      legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, font: { size: 11.5 }, tracegroupgap: 0, bgcolor: "rgba(0,0,0,0)" },
      hoverlabel: { bgcolor: paper, bordercolor: muted, font: { color: ink, size: 12 }, namelength: -1 },
    };
    const full = { ...base, ...layout };
    full.width = printing ? PRINT_WIDTH : undefined;
    for (const key of Object.keys(full).filter((name) => /^[xy]axis\d*$/.test(name))) {
      const line = { gridcolor: grid, linecolor: muted, zerolinecolor: grid, tickcolor: muted, showline: true, ticklabeloverflow: "allow" };
      const text = wrapped(full[key].title?.text, key, full[key], element);
      const hasNames = "ticktext" in full[key] || full[key].type === "category";
      // Margins hold numbers and a title of one line: to measure those would take a third of the time.
      const automargin = hasNames || text !== full[key].title?.text;
      full[key] = { ...line, automargin, ticks: "outside", ...full[key], title: { ...full[key].title, text } };
      if (hasNames && key === "yaxis") Object.assign(full[key], shortNames(full[key], element));
      const room = Math.max(roomForTicks(key, full[key], element), 1);
      if (full[key].nticks || (room < FEW_TICKS && !hasNames)) full[key].nticks = Math.min(full[key].nticks || room, room);
    }
    if ("frequency" in element.dataset) {
      const shown = range || layout.xaxis.range;
      const labels = scale === "log" ? ".10~g" : ""; // 20, 50, 100, 200: else plotly writes 2, 5, 100, 2
      full.xaxis = { ...full.xaxis, type: scale, tickformat: labels, nticks: mostTicks(shown, element), range: scale === "log" ? shown.map(logarithm) : [...shown] };
    }
    return full;
  }

  // As many ticks as make 20, 50, 100, 200 of a logarithmic axis: with more, plotly labels 30, 40, 60 to 90 too.
  function mostTicks(ends, figure) {
    const decades = Math.log10(ends[1] / Math.max(ends[0], page.lowestHz));
    if (scale !== "log" || decades < 1) return 0; // its own choice
    return Math.max(Math.floor(Math.min(decades / DECADES_A_TICK, roomForTicks("xaxis", {}, figure))), 1);
  }

  function roomForTicks(key, { domain = [0, 1] }, figure) {
    const plot = figure.querySelector(".plot");
    const size = key[0] === "y" ? plot.clientHeight : printing ? PRINT_WIDTH : plot.clientWidth;
    return Math.floor((size - PX_BESIDE[key[0]]) * (domain[1] - domain[0]) / PX_A_TICK[key[0]]);
  }

  // A title that is longer than its axis goes on in a second line.
  function wrapped(text, key, { domain = [0, 1] }, figure) {
    const plot = figure.querySelector(".plot");
    const size = key[0] === "x" ? (printing ? PRINT_WIDTH : plot.clientWidth) : plot.clientHeight * (domain[1] - domain[0]);
    return inTwoLines(text, size - PX_BESIDE[key[0]]);
  }

  // Names beside bars leave room for the bars.
  function shortNames({ ticktext, tickvals }, figure) {
    const names = ticktext || [...new Set(pictureIn(figure).data.flatMap(({ y }) => (Array.isArray(y) ? y : [])))];
    if (!names.length) return {};
    const most = figure.querySelector(".plot").clientWidth * MOST_FOR_NAMES;
    return { tickvals: tickvals || names, ticktext: names.map((name) => inTwoLines(name, most)) };
  }

  function inTwoLines(text, size) {
    if (!text || text.length * PX_A_LETTER < size || text.includes("<br>")) return text;
    const spaces = [...text.matchAll(/ /g)].map(({ index }) => index);
    const [middle] = spaces.sort((a, b) => Math.abs(a - text.length / 2) - Math.abs(b - text.length / 2));
    return middle ? `${text.slice(0, middle)}<br>${text.slice(middle + 1)}` : text;
  }

  const choiceIn = (figure) => figure.querySelector("select");
  const pictureIn = (figure) => page.pictures[choiceIn(figure)?.value ?? figure.id];

  const logarithm = (value) => Math.log10(Math.max(value, page.lowestHz));

  // Only FRFs that are shown are unpacked and handed over: hundreds that are not would take seconds.
  function traces(picture, before) {
    const off = new Set((before || []).filter(({ visible }) => visible === "legendonly").map(({ uid }) => uid)); // in the legend
    const named = picture.data.map((packed, place) => ({ packed, uid: `${place}` }));
    return named.filter(({ packed }) => !hidden.has(packed.meta?.frf)).map(({ packed, uid }) => ({ ...unpack(packed), uid, ...(off.has(uid) && { visible: "legendonly" }) }));
  }

  // On a narrow screen a long legend takes half of a picture: it gets the height of another half.
  function legendShare(plot, picture) {
    const entries = new Set(picture.data.filter((trace) => trace.showlegend !== false && trace.name).map((trace) => trace.legendgroup || trace.name));
    return plot.clientWidth < NARROW_PX && entries.size > FEW_ENTRIES ? 1.6 : 1;
  }

  function draw(name) {
    const figure = document.getElementById(name);
    const picture = pictureIn(figure);
    const plot = figure.querySelector(".plot");
    figure.querySelector(".drawn").textContent = picture.drawn || "";
    plot.dataset.height ??= parseFloat(plot.style.height);
    plot.style.height = `${plot.dataset.height * (printing ? PRINT_SHARE : legendShare(plot, picture))}px`;
    const config = { responsive: !printing, ...NO_CLOUD, modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"] };
    Plotly.react(plot, traces(picture, drawn.has(name) && plot.data), themed(unpack(picture.layout), figure), config);
    if (!drawn.has(name)) {
      drawn.set(name, plot);
      plot.on("plotly_relayout", (change) => follow(name, change));
      plot.on("plotly_afterplot", () => openLegend(plot));
      plot.addEventListener("keydown", (event) => steer(event, name));
      choiceIn(figure)?.addEventListener("change", () => choosePicture(figure));
      openLegend(plot);
    }
  }

  function choosePicture(figure) {
    const { title, alt } = choiceIn(figure).selectedOptions[0].dataset;
    figure.querySelector("figcaption").textContent = title;
    figure.querySelector(".plot").setAttribute("aria-label", alt);
    draw(figure.id);
  }

  // Names are escaped for plotly, which takes some tags in them for markup.
  const plain = (text) => text.replace(/&lt;/g, "<").replace(/&gt;/g, ">").replace(/&amp;/g, "&");

  // The entries of a legend are drawn by plotly for a mouse only: make them buttons for the keyboard too.
  function openLegend(plot) {
    plot.querySelectorAll(".legend .traces").forEach((entry) => {
      const { trace } = entry.__data__[0];
      const state = { tabindex: 0, role: "button", "aria-label": plain(trace.name), "aria-pressed": trace.visible === true };
      Object.entries(state).forEach(([key, value]) => entry.setAttribute(key, value));
      entry.onkeydown = (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        event.stopPropagation();
        toggleEntry(plot, trace.index);
      };
    });
  }

  async function toggleEntry(plot, index) {
    const { legendgroup, visible } = plot.data[index];
    const places = [...plot.data.keys()].filter((k) => k === index || (legendgroup && plot.data[k].legendgroup === legendgroup));
    await Plotly.restyle(plot, { visible: visible === "legendonly" ? true : "legendonly" }, places);
    openLegend(plot);
    const entries = [...plot.querySelectorAll(".legend .traces")];
    entries.find((entry) => entry.__data__[0].trace.index === index).focus(); // plotly may have drawn it anew
  }

  function redraw() {
    for (const name of drawn.keys()) draw(name);
  }

  // Linked frequency axes: what one picture shows, all show.
  function follow(name, change) {
    const figure = document.getElementById(name);
    if (!("frequency" in figure.dataset)) return;
    if (change["xaxis.autorange"]) show(null);
    else if (change["xaxis.range[0]"] !== undefined) {
      const ends = [change["xaxis.range[0]"], change["xaxis.range[1]"]];
      show(scale === "log" ? ends.map((end) => 10 ** end) : ends);
    }
  }

  function show(ends) {
    range = ends;
    for (const [name, plot] of drawn) {
      const figure = document.getElementById(name);
      if (!("frequency" in figure.dataset)) continue;
      const shown = range || pictureIn(figure).layout.xaxis.range;
      plot.layout.xaxis.range = scale === "log" ? shown.map(logarithm) : [...shown];
      plot.layout.xaxis.autorange = false;
      plot.layout.xaxis.nticks = mostTicks(shown, figure);
      Plotly.redraw(plot);
    }
  }

  function steer(event, name) {
    const figure = document.getElementById(name);
    const moves = { ArrowLeft: [-0.15, -0.15], ArrowRight: [0.15, 0.15], "+": [0.15, -0.15], "=": [0.15, -0.15], "-": [-0.2, 0.2] };
    const plot = drawn.get(name);
    if (event.key === "0") {
      if ("frequency" in figure.dataset) show(null);
      else Plotly.react(plot, plot.data, themed(unpack(pictureIn(figure).layout), figure));
    } else if (event.key in moves && plot.layout.xaxis) {
      const [low, high] = plot.layout.xaxis.range;
      const [left, right] = moves[event.key].map((part) => part * (high - low));
      Plotly.relayout(plot, { "xaxis.range[0]": low + left, "xaxis.range[1]": high + right });
    } else return;
    event.preventDefault();
  }

  function setTheme(name) {
    theme = name;
    root.dataset.theme = name;
    document.querySelectorAll(".swatch").forEach((mark) => { mark.style.background = colour(mark.dataset.colour); });
    redraw();
  }

  function setScale(name) {
    scale = name;
    document.getElementById("scale").textContent = name === "log" ? "Frequency: log" : "Frequency: linear";
    redraw();
  }

  function choose() {
    const boxes = [...document.querySelectorAll(".chooser input")];
    hidden = new Set(boxes.filter((box) => !box.checked).map((box) => Number(box.value)));
    document.getElementById("shown").textContent = `${boxes.length - hidden.size} of ${boxes.length}`;
    redraw();
  }

  function listen() {
    document.getElementById("theme").addEventListener("click", () => setTheme(theme === "light" ? "dark" : "light"));
    document.getElementById("scale").addEventListener("click", () => setScale(scale === "log" ? "linear" : "log"));
    document.getElementById("print").addEventListener("click", () => window.print());
    document.querySelectorAll(".chooser input").forEach((box) => box.addEventListener("change", choose));
    document.querySelectorAll(".chooser button").forEach((button) => button.addEventListener("click", () => {
      document.querySelectorAll(".chooser input").forEach((box) => { box.checked = button.dataset.all === "1"; });
      choose();
    }));
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") document.querySelectorAll(".chooser[open]").forEach((list) => { list.open = false; });
    });
    window.addEventListener("beforeprint", beforePrint);
    window.addEventListener("afterprint", afterPrint);
  }

  let screenTheme = "light";
  function beforePrint() {
    if (printing) return;
    printing = true;
    screenTheme = theme;
    theme = "light";
    root.dataset.theme = "light";
    document.querySelectorAll("main details").forEach((list) => {
      list.dataset.was = list.open;
      list.open = list.open || list.querySelectorAll("tr").length <= MOST_ROWS_TO_OPEN;
    });
    places().forEach(draw);
  }

  function afterPrint() {
    printing = false;
    document.querySelectorAll("main details").forEach((list) => { list.open = list.dataset.was === "true"; });
    setTheme(screenTheme);
  }

  const places = () => [...document.querySelectorAll("figure[id]")].filter(pictureIn).map((figure) => figure.id);

  // A page that is sent on carries the library packed; the policy of the page lets no other script run.
  async function unpackLibrary() {
    const packed = document.getElementById("library");
    const bytes = Uint8Array.from(atob(packed.textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  }

  function start() {
    setTheme(window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    setScale(scale);
    listen();
    const waiting = new Set(places());
    const take = (name) => { if (waiting.delete(name)) draw(name); };
    const observer = new IntersectionObserver((entries) => {
      entries.filter((entry) => entry.isIntersecting).forEach((entry) => take(entry.target.id));
    }, { rootMargin: "200px" });
    waiting.forEach((name) => observer.observe(document.getElementById(name)));
    const whenIdle = window.requestIdleCallback || ((work) => setTimeout(work, 30));
    const next = () => {
      const [name] = waiting;
      if (name === undefined) { root.dataset.drawn = "all"; return; }
      take(name);
      whenIdle(next);
    };
    whenIdle(next);
  }

  if (window.Plotly) start();
  else unpackLibrary().then(start, () => {
    document.querySelectorAll(".plot").forEach((plot) => { plot.textContent = "This browser is too old to draw here: one of 2023 or later does."; });
  });
})();
