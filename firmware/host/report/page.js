"use strict";
// The plots of a run report. All data stand in the page; times are in seconds.
(() => {
  const run = JSON.parse(document.getElementById("run").textContent);
  const wanted = new URLSearchParams(location.search).get("theme");
  if (wanted === "dark" || wanted === "light") document.documentElement.dataset.theme = wanted;

  function bytes(text) {
    const raw = atob(text);
    const out = new Uint8Array(raw.length);
    for (let k = 0; k < raw.length; ++k) out[k] = raw.charCodeAt(k);
    return out.buffer;
  }
  const time = run.time.float64 !== undefined
    ? Array.from(new Float64Array(bytes(run.time.float64)))
    : Array.from({ length: run.time.count }, (_, k) => run.time.from_s + k * run.time.step_s);

  const cache = new Map();
  function series(key) {
    if (!(key in run.series)) return null;
    if (!cache.has(key))
      cache.set(key, Array.from(new Float32Array(bytes(run.series[key])), x => Number.isNaN(x) ? null : x));
    return cache.get(key);
  }
  const combine = (a, b, f) => a && b ? a.map((x, k) => x === null || b[k] === null ? null : f(x, b[k])) : null;
  const color = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const whole = [time[0], time[time.length - 1]];

  // What the run says of itself: force where there is one, else torque.
  const byForce = series("0.cutting_force_n") !== null;
  const load = byForce
    ? { word: "Cutting force", unit: "N", value: "cutting_force_n", sigma: "cutting_force_sigma_n", truth: "r.true_cutting_force_n" }
    : { word: "Cutting torque", unit: "N m", value: "cutting_torque_nm", sigma: "cutting_torque_sigma_nm", truth: "r.true_cutting_torque_nm" };

  const curve = (label, unit, data, ink, more) => ({ label, unit, data, ink, ...more });
  // Truth lies under the estimate as a broad pale line, so that both are seen where they agree.
  const truthCurve = (label, unit, key, ink = "truth") => curve(label, unit, series(key), ink, { width: 6, pale: true });
  function banded(name, ink, trace) {
    const value = series(trace + "." + load.value), sigma = series(trace + "." + load.sigma);
    return [
      { ...curve("2-sigma band", load.unit, value && sigma, ink), band: [
        combine(value, sigma, (x, s) => x + 2 * s), combine(value, sigma, (x, s) => x - 2 * s)] },
      curve(name, load.unit, value, ink),
    ];
  }

  const mainName = run.traces[0];
  const plots = [
    { title: "Power, computed from voltages and currents and as the drive reports it", height: 220, curves: [
      curve("Measured power", "W", series("0.measured_power_w"), "orange"),
      curve("Computed air-gap power", "W", series("0.airgap_power_w"), "blue")] },
    { title: "Which estimate fed the output, state and faults", strips: true },
    { title: "Torque at the motor: in the air gap, of all loads, and of cutting", height: 260, curves: [
      truthCurve("True air-gap", "N m", "r.true_airgap_torque_nm", "orange"),
      truthCurve("True load", "N m", "r.true_load_torque_nm", "green"),
      truthCurve("True cutting", "N m", "r.true_cutting_torque_nm", "blue"),
      curve("Air-gap", "N m", series("0.airgap_torque_nm"), "orange"),
      curve("Load", "N m", series("0.load_torque_nm"), "green"),
      curve("Cutting", "N m", series("0.cutting_torque_nm"), "blue")] },
    { title: load.word + " with its uncertainty", height: 280, curves: [
      truthCurve("Truth", load.unit, load.truth),
      curve("Dynamometer", "N", byForce ? series("r.measured_force_n") : null, "green"),
      ...banded("Estimate (" + mainName + ")", "blue", "0")] },
    { title: "Error of the estimate, and the uncertainty it claims", height: 200, curves: errorCurves() },
    { title: "Feed override", height: 180, curves: [
      curve("Reported by the CNC", "%", series("r.override_pct"), "orange", { stepped: true }),
      curve("Commanded", "%", series("0.override_pct"), "blue", { stepped: true })] },
  ];
  function errorCurves() {
    const truth = series(load.truth), value = series("0." + load.value), sigma = series("0." + load.sigma);
    return [
      { ...curve("2-sigma band around zero", load.unit, truth && sigma, "grey"), band: [
        truth && sigma && sigma.map(s => s === null ? null : 2 * s), truth && sigma && sigma.map(s => s === null ? null : -2 * s)] },
      curve("Estimate less truth", load.unit, combine(value, truth, (a, b) => a - b), "blue"),
    ];
  }
  // P3 draws the cutting force from computed power in Fig. 1 and from the synthesized monitor in Fig. 2.
  const pictures = [
    ["computed", "P3 Fig. 1: estimate from computed power", "orange"],
    ["synthesized", "P3 Fig. 2: estimate from the synthesized monitor", "green"],
  ].map(([name, title, ink]) => ({ name, title, ink, trace: run.traces.indexOf(name) }))
    .filter(p => p.trace >= 0 && series(p.trace + "." + load.value));

  // ---- drawing -------------------------------------------------------------------------------
  const linked = [];
  const cleanups = [];
  let view = whole.slice();
  let busy = false;

  function show(from, to) {
    const span = Math.max(to - from, 1e-3);
    view = [Math.max(whole[0], from), Math.min(whole[1], Math.max(from, whole[0]) + span)];
    busy = true;
    for (const plot of linked) plot.setScale("x", { min: view[0], max: view[1] });
    busy = false;
  }
  function followZoom(plot, key) {
    if (key !== "x" || busy || !linked.includes(plot)) return;
    const { min, max } = plot.scales.x;
    if (min !== view[0] || max !== view[1]) show(min, max);
  }

  function formatted(x) {
    if (x === null || x === undefined) return "–";
    const size = Math.abs(x);
    return x.toFixed(size >= 1000 ? 0 : size >= 100 ? 1 : size >= 10 ? 2 : 3);
  }
  function element(tag, attributes, ...children) {
    const out = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes || {}))
      if (name in out && name !== "style") out[name] = value; else out.setAttribute(name, value);
    out.append(...children);
    return out;
  }
  const axisFont = "12px system-ui, -apple-system, 'Segoe UI', Roboto, 'Liberation Sans', sans-serif";
  function axes(unit, more) {
    const common = { stroke: color("muted"), font: axisFont, grid: { stroke: color("grid"), width: 1 }, ticks: { show: false } };
    return [
      { ...common, space: 70, size: 26, gap: 6, values: (u, ticks) => ticks.map((t, k) => (+t.toFixed(6)) + (k === ticks.length - 1 ? " s" : "")) },
      { ...common, space: 34, size: 58, gap: 6, values: (u, ticks) => ticks.map((t, k) => (+t.toFixed(6)) + (k === ticks.length - 1 && unit ? " " + unit : "")), ...more },
    ];
  }
  function drawEvents(plot, numbered) {
    const { ctx, bbox } = plot;
    const dpr = devicePixelRatio || 1;
    ctx.save();
    ctx.strokeStyle = color("muted"); ctx.fillStyle = color("muted");
    ctx.lineWidth = dpr; ctx.setLineDash([3 * dpr, 4 * dpr]);
    ctx.font = 11 * dpr + "px sans-serif"; ctx.textBaseline = "top";
    let lastLabel = -Infinity;
    run.events.forEach((event, k) => {
      const x = Math.round(plot.valToPos(event.t_s, "x", true)) + .5;
      if (x < bbox.left || x > bbox.left + bbox.width) return;
      ctx.globalAlpha = .7;
      ctx.beginPath(); ctx.moveTo(x, bbox.top); ctx.lineTo(x, bbox.top + bbox.height); ctx.stroke();
      if (!numbered || x - lastLabel < 14 * dpr) return;
      lastLabel = x;
      const right = x + 16 * dpr > bbox.left + bbox.width;
      ctx.textAlign = right ? "right" : "left";
      ctx.globalAlpha = 1; ctx.fillText(String(k + 1), x + (right ? -3 : 3) * dpr, bbox.top + 2 * dpr);
    });
    ctx.restore();
  }

  function touch(plot) {
    // One finger moves the cursor, two fingers zoom.
    const over = plot.over, fingers = new Map();
    let spread = null;
    const place = event => event.clientX - over.getBoundingClientRect().left;
    const listen = (name, f) => over.addEventListener(name, f, { passive: true });
    listen("pointerdown", e => { if (e.pointerType === "touch") { fingers.set(e.pointerId, place(e)); spread = null; } });
    listen("pointermove", e => {
      if (!fingers.has(e.pointerId)) return;
      fingers.set(e.pointerId, place(e));
      if (fingers.size === 1) plot.setCursor({ left: place(e), top: 10 });
      if (fingers.size !== 2) return;
      const [a, b] = [...fingers.values()].sort((p, q) => p - q);
      const now = { a: plot.posToVal(a, "x"), b: plot.posToVal(b, "x"), pixels: [a, b] };
      if (!spread) { spread = now; return; }
      const scale = (spread.b - spread.a) / Math.max(b - a, 10);
      const from = spread.a - a * scale;
      show(from, from + over.clientWidth * scale);
    });
    for (const name of ["pointerup", "pointercancel", "pointerleave"]) listen(name, e => { fingers.delete(e.pointerId); spread = null; });
  }

  function button(item, plotsOf, indices) {
    const swatch = element("i", { className: item.band ? "band" : item.pale ? "pale" : "" });
    swatch.style.color = color(item.ink);
    const out = element("output");
    const toggle = element("button", { type: "button" }, swatch, item.label + (item.band ? "" : ", " + item.unit));
    if (!item.band) toggle.append(out);
    toggle.setAttribute("aria-pressed", String(!item.hidden));
    toggle.addEventListener("click", () => {
      item.hidden = !item.hidden;
      toggle.setAttribute("aria-pressed", String(!item.hidden));
      for (const plot of plotsOf()) for (const index of indices) plot.setSeries(index, { show: !item.hidden });
    });
    return { toggle, out };
  }

  // Series of uPlot: time first; a band is two invisible lines with the space between them filled.
  function layout(curves) {
    const columns = [time], options = [{}], bands = [], places = [];
    for (const item of curves) {
      const first = columns.length;
      if (item.band) {
        const fill = color(item.ink) + "38";
        columns.push(item.band[0], item.band[1]);
        for (let k = 0; k < 2; ++k) options.push({ stroke: "transparent", width: 0, points: { show: false }, show: !item.hidden });
        bands.push({ series: [first, first + 1], fill });
        places.push([first, first + 1]);
      } else {
        columns.push(item.data);
        options.push({
          stroke: color(item.ink) + (item.pale ? item.ink === "truth" ? "b0" : "70" : ""), width: item.width || 1.6,
          points: { show: false }, show: !item.hidden,
          paths: item.stepped ? uPlot.paths.stepped({ align: -1 }) : undefined,
        });
        places.push([first]);
      }
    }
    return { columns, options, bands, places };
  }

  function makePlot(holder, made, unit, height, range, hooks, isLinked) {
    const plot = new uPlot({
      width: Math.max(holder.clientWidth, 120), height, pxAlign: 0,
      legend: { show: false },
      cursor: { y: false, points: { size: 7 }, drag: { x: true, y: false, dist: 5 }, sync: isLinked ? { key: "run" } : undefined },
      scales: { x: { time: false, min: range[0], max: range[1] } },
      series: made.options, bands: made.bands, axes: axes(unit),
      padding: [10, 14, 0, 0],
      hooks: { draw: [u => drawEvents(u, isLinked)], setScale: isLinked ? [followZoom] : [], ...hooks },
    }, made.columns, holder);
    if (isLinked) { linked.push(plot); touch(plot); }
    const observer = new ResizeObserver(() => {
      const width = Math.max(holder.clientWidth, 120);
      if (width !== plot.width) plot.setSize({ width, height: plot.height });
    });
    observer.observe(holder);
    cleanups.push(() => { observer.disconnect(); plot.destroy(); });
    return plot;
  }

  function saver(title, canvases) {
    const out = element("button", { type: "button", title: "Save this picture as PNG" }, "PNG");
    out.addEventListener("click", () => {
      const list = canvases(), head = 34 * (devicePixelRatio || 1);
      const canvas = element("canvas");
      canvas.width = list.reduce((sum, c) => sum + c.width, 0);
      canvas.height = head + Math.max(...list.map(c => c.height));
      const ctx = canvas.getContext("2d");
      ctx.fillStyle = color("panel"); ctx.fillRect(0, 0, canvas.width, canvas.height);
      ctx.fillStyle = color("ink"); ctx.font = "600 " + 15 * (devicePixelRatio || 1) + "px sans-serif";
      ctx.fillText(title, head * .4, head * .65);
      let left = 0;
      for (const c of list) { ctx.drawImage(c, left, head); left += c.width; }
      element("a", { href: canvas.toDataURL("image/png"), download: title.replace(/[^\w]+/g, "-") + ".png" }).click();
    });
    return out;
  }
  function panel(title, canvases) {
    const section = element("section", {}, element("div", { className: "figure-head" }, element("h2", {}, title), saver(title, canvases)));
    document.getElementById("plots").append(section);
    return section;
  }
  function holderIn(parent, label) {
    const holder = element("div", { className: "plot", role: "img", ariaLabel: label });
    parent.append(holder);
    return holder;
  }
  function keyOf(section, curves, plotsOf, places) {
    const key = element("div", { className: "key" });
    const outs = curves.map((item, k) => {
      const { toggle, out } = button(item, plotsOf, places[k]);
      key.append(toggle);
      return out;
    });
    section.append(key);
    return u => curves.forEach((item, k) => {
      if (item.band) return;
      const index = u.cursor.idx;
      outs[k].textContent = index === null || index === undefined ? "" : formatted(item.data[index]);
    });
  }

  function drawPlot(spec) {
    const curves = spec.curves.filter(c => c.data);
    if (!curves.length) return;
    let plot;
    const section = panel(spec.title, () => [plot.ctx.canvas]);
    const made = layout(curves);
    const values = keyOf(section, curves, () => [plot], made.places);
    plot = makePlot(holderIn(section, spec.title), made, curves[0].unit, spec.height, view, { setCursor: [values] }, true);
  }

  function drawPicture(spec) {
    const title = spec.title;
    const curves = [truthCurve("Truth", load.unit, load.truth), ...banded("Estimate (" + spec.name + ")", spec.ink, String(spec.trace))].filter(c => c.data);
    const made = () => layout(curves);
    const views = [["Whole run", whole]];
    if (run.entry_s !== null) views.push(["Entry", [run.entry_s - .1, run.entry_s + .4]]);
    if (run.exit_s !== null) views.push(["Exit", [run.exit_s - .15, run.exit_s + .35]]);
    const made_plots = [];
    const section = panel(title, () => made_plots.map(p => p.ctx.canvas));
    keyOf(section, curves, () => made_plots, made().places);
    const grid = element("div", { className: views.length === 3 ? "trio" : "" });
    section.append(grid);
    for (const [name, range] of views) {
      const cell = element("div", {}, element("h3", {}, name));
      grid.append(cell);
      made_plots.push(makePlot(holderIn(cell, title + ", " + name), made(), load.unit, 250, range, {}, false));
    }
  }

  // ---- strips --------------------------------------------------------------------------------
  const wordInk = {
    measured: "orange", computed: "sky", fused: "blue", synthesized: "green", dynamometer: "purple", none: "grey",
    starting: "grey", no_estimate: "grey", air: "sky", cut: "blue", refused: "orange",
  };
  const wordText = { no_estimate: "no estimate" };
  const spare = ["amber", "purple", "green", "sky"];
  const inkOf = (kind, word) => kind === "fault" ? "orange" : wordInk[word] || spare[[...word].reduce((n, c) => n + c.charCodeAt(0), 0) % spare.length];

  function drawStrips(spec) {
    const rows = [];
    run.traces.forEach((name, k) => {
      const runs = run.strips[k + ".source"];
      if (!runs || !runs.length) return;
      const words = new Set(runs.map(r => r[2]).filter(word => word !== "none"));
      if (k === 0 || words.size > 1) rows.push({ kind: "source", label: run.traces.length > 1 ? "Source of " + name : "Source", runs });
    });
    for (const [kind, label] of [["state", "State"], ["fault", "Fault"]]) {
      const runs = run.strips["0." + kind];
      if (runs && runs.length) rows.push({ kind, label, runs: runs.filter(r => r[2] !== "none" || kind !== "fault") });
    }
    if (!rows.length) return;
    let plot;
    const section = panel(spec.title, () => [plot.ctx.canvas]);
    const reading = element("output", { className: "reading" });
    section.querySelector("h2").after(reading);
    const band = 46;
    const draw = u => {
      const { ctx, bbox } = u, dpr = devicePixelRatio || 1, high = bbox.height / rows.length;
      ctx.save();
      ctx.beginPath(); ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height); ctx.clip();
      ctx.font = 12 * dpr + "px sans-serif"; ctx.textBaseline = "middle"; ctx.textAlign = "left";
      rows.forEach((row, n) => {
        const top = bbox.top + n * high + 18 * dpr, height = high - 22 * dpr;
        ctx.globalAlpha = 1;
        ctx.fillStyle = color("muted");
        ctx.fillText(row.label, bbox.left, top - 8 * dpr);
        for (const [from, to, word] of row.runs) {
          const a = Math.max(u.valToPos(from, "x", true), bbox.left), b = Math.min(u.valToPos(to, "x", true), bbox.left + bbox.width);
          if (b <= a) continue;
          ctx.fillStyle = color(inkOf(row.kind, word));
          ctx.globalAlpha = word === "none" || word === "starting" ? .35 : .85;
          ctx.fillRect(a, top, Math.max(b - a, dpr), height);
          ctx.globalAlpha = 1;
          const text = wordText[word] || word;
          if (ctx.measureText(text).width + 12 * dpr > b - a) continue;
          ctx.fillStyle = word === "none" || word === "starting" ? color("ink") : color("panel");
          ctx.fillText(text, a + 6 * dpr, top + height / 2);
        }
      });
      ctx.restore();
    };
    const values = u => {
      const t = u.cursor.idx === null || u.cursor.idx === undefined ? null : time[u.cursor.idx];
      const words = rows.map(row => row.runs.find(r => t !== null && r[0] < t + 1e-9 && t <= r[1] + 1e-9));
      reading.textContent = t === null ? "" : [t.toFixed(3) + " s", ...words.filter(r => r).map(r => wordText[r[2]] || r[2])].join(" · ");
    };
    const made = { columns: [time, time.map(() => null)], options: [{}, { points: { show: false } }], bands: [] };
    const holder = holderIn(section, spec.title);
    const [x, y] = axes("");
    plot = new uPlot({
      width: Math.max(holder.clientWidth, 120), height: band * rows.length + 34, pxAlign: 0, legend: { show: false },
      cursor: { y: false, points: { show: false }, drag: { x: true, y: false, dist: 5 }, sync: { key: "run" } },
      scales: { x: { time: false, min: view[0], max: view[1] }, y: { range: [0, rows.length] } },
      series: made.options, padding: [6, 14, 0, 0],
      axes: [x, { ...y, grid: { show: false }, values: () => [] }],
      hooks: { draw: [draw, u => drawEvents(u, false)], setCursor: [values], setScale: [followZoom] },
    }, made.columns, holder);
    linked.push(plot);
    touch(plot);
    const observer = new ResizeObserver(() => { if (holder.clientWidth !== plot.width) plot.setSize({ width: Math.max(holder.clientWidth, 120), height: plot.height }); });
    observer.observe(holder);
    cleanups.push(() => { observer.disconnect(); plot.destroy(); });
  }

  function tools() {
    const nav = document.getElementById("tools");
    const add = (text, f, title) => {
      const b = element("button", { type: "button", title: title || "" }, text);
      b.addEventListener("click", f);
      nav.append(b);
    };
    const around = (t) => () => show(t - .1, t + .4);
    const scaled = factor => () => {
      const middle = (view[0] + view[1]) / 2, half = (view[1] - view[0]) / 2 * factor;
      show(middle - half, middle + half);
    };
    const moved = part => () => {
      const shift = Math.min(Math.max((view[1] - view[0]) * part, whole[0] - view[0]), whole[1] - view[1]);
      show(view[0] + shift, view[1] + shift);
    };
    add("Whole run", () => show(...whole));
    if (run.entry_s !== null) add("Entry", around(run.entry_s));
    if (run.exit_s !== null) add("Exit", around(run.exit_s));
    add("−", scaled(2), "Zoom out");
    add("+", scaled(.5), "Zoom in");
    add("‹", moved(-.5), "Earlier");
    add("›", moved(.5), "Later");
    nav.append(element("span", { className: "hint" }, "Drag across a plot to zoom, double-click for the whole run"));
    nav.hidden = false;
  }

  function render() {
    for (const f of cleanups.splice(0)) f();
    linked.length = 0;
    document.getElementById("plots").replaceChildren();
    for (const spec of plots) if (spec.strips) drawStrips(spec); else drawPlot(spec);
    for (const spec of pictures) drawPicture(spec);
    show(...view);
  }
  if (time.length < 2) return;
  tools();
  render();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
  // On paper: light, and nothing folded away.
  let before = null;
  addEventListener("beforeprint", () => {
    before = document.documentElement.dataset.theme;
    document.documentElement.dataset.theme = "light";
    for (const d of document.querySelectorAll("main details")) d.open = true;
    render();
  });
  addEventListener("afterprint", () => {
    if (before) document.documentElement.dataset.theme = before; else delete document.documentElement.dataset.theme;
    render();
  });
})();
