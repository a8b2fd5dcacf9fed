"use strict";
// The edges of the fitted band, to take hold of in the picture of the FRFs: with a mouse, or with the arrow keys and Enter.
(() => {
  const { whenDrawn, change } = window.workbench;
  const NAMES = ["Lower edge of the band that is fitted", "Upper edge of the band that is fitted"];
  const FINEST = 1000; // steps of the arrow keys over what is seen
  const form = document.querySelector("#band-form");

  function start(plot) {
    const figure = plot.closest("figure");
    const known = [form.dataset.low, form.dataset.high].map(Number);
    const ends = [...known];
    let held = -1; // which edge a mouse has taken hold of
    const handles = NAMES.map((name, k) => {
      const handle = document.createElement("div");
      handle.className = "edge";
      handle.append(document.createElement("span"));
      const state = { role: "slider", tabindex: 0, "aria-label": name, "aria-orientation": "horizontal" };
      Object.entries(state).forEach(([key, value]) => handle.setAttribute(key, value));
      figure.append(handle);
      listen(handle, k);
      return handle;
    });
    figure.classList.add("with-edges");

    // What a long measurement shows at first is a part of it: edges go as far as there are lines.
    function limits(k) {
      const lines = [Number(form.dataset.lowest), Number(form.dataset.highest)];
      return k === 0 ? [lines[0], ends[1]] : [ends[0], lines[1]];
    }

    function place() {
      const { xaxis, _size: size } = plot._fullLayout;
      handles.forEach((handle, k) => {
        const there = xaxis.d2p(ends[k]);
        handle.hidden = k !== held && !(there >= -1 && there <= xaxis._length + 1);
        const at = Math.min(Math.max(there, 0), xaxis._length);
        const { style } = handle;
        style.left = `${plot.offsetLeft + xaxis._offset + at}px`;
        style.top = `${plot.offsetTop + size.t}px`;
        style.height = `${size.h}px`;
        const [low, high] = limits(k);
        const text = `${Number(ends[k].toPrecision(5))} Hz`;
        handle.firstChild.textContent = text;
        const values = { "aria-valuemin": low, "aria-valuemax": high, "aria-valuenow": ends[k], "aria-valuetext": text };
        Object.entries(values).forEach(([key, value]) => handle.setAttribute(key, value));
        handle.classList.toggle("moved", ends[k] !== known[k]);
      });
    }

    function move(k, hertz) {
      const [low, high] = limits(k);
      ends[k] = Math.min(Math.max(hertz, low), high);
      place();
    }

    function settle() {
      if (ends[0] < ends[1] && ends.some((end, k) => end !== known[k])) change({ kind: "band", low_hz: ends[0], high_hz: ends[1] });
    }

    function reset() {
      ends.splice(0, 2, ...known);
      place();
    }

    function listen(handle, k) {
      const inPlot = (event) => plot._fullLayout.xaxis.p2d(event.clientX - plot.getBoundingClientRect().left - plot._fullLayout.xaxis._offset);
      handle.addEventListener("pointerdown", (event) => {
        handle.setPointerCapture(event.pointerId);
        held = k;
        handle.focus({ preventScroll: true });
        event.preventDefault();
      });
      handle.addEventListener("pointermove", (event) => { if (held === k) move(k, inPlot(event)); });
      handle.addEventListener("pointerup", () => { held = -1; settle(); });
      handle.addEventListener("pointercancel", () => { held = -1; reset(); });
      handle.addEventListener("keydown", (event) => {
        const { xaxis } = plot._fullLayout;
        const step = ((event.shiftKey ? 10 : 1) * xaxis._length) / FINEST;
        const steps = { ArrowLeft: -step, ArrowDown: -step, ArrowRight: step, ArrowUp: step };
        if (event.key in steps) move(k, xaxis.p2d(xaxis.d2p(ends[k]) + steps[event.key]));
        else if (event.key === "Enter") settle();
        else if (event.key === "Escape") reset();
        else return;
        event.preventDefault();
      });
    }

    plot.on("plotly_afterplot", place);
    document.addEventListener("frf-ipz-refused", reset);
    place();
  }

  if (form) whenDrawn("frf", start);
})();
