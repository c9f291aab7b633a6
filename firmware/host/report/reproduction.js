"use strict";
// The plots of a reproduction: for each figure, the force of each run over time, and the override.
(() => {
  const figures = JSON.parse(document.getElementById("data").textContent);
  const wanted = new URLSearchParams(location.search).get("theme");
  if (wanted === "dark" || wanted === "light") document.documentElement.dataset.theme = wanted;

  const inks = ["blue", "orange", "green", "purple", "amber", "sky"];
  const color = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const font = "12px system-ui, -apple-system, 'Segoe UI', Roboto, 'Liberation Sans', sans-serif";

  function numbers(text) {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let k = 0; k < raw.length; ++k) bytes[k] = raw.charCodeAt(k);
    return Array.from(new Float32Array(bytes.buffer), x => Number.isNaN(x) ? null : x);
  }
  function element(tag, attributes, ...children) {
    const out = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes || {}))
      if (name in out && name !== "style") out[name] = value; else out.setAttribute(name, value);
    out.append(...children);
    return out;
  }
  function axes(unit) {
    const line = { stroke: color("grid"), width: 1 };
    const common = { stroke: color("muted"), font, grid: line, ticks: { show: false } };
    const last = (ticks, k, word) => k === ticks.length - 1 ? " " + word : "";
    return [
      { ...common, space: 70, size: 26, gap: 6, values: (u, t) => t.map((x, k) => +x.toFixed(6) + last(t, k, "s")) },
      { ...common, space: 34, size: 64, gap: 6, values: (u, t) => t.map((x, k) => +x.toFixed(6) + last(t, k, unit)) },
    ];
  }
  function drawReference(u, reference) {
    const { ctx, bbox } = u, dpr = devicePixelRatio || 1;
    const y = Math.round(u.valToPos(reference, "y", true)) + .5;
    if (y < bbox.top || y > bbox.top + bbox.height) return;
    ctx.save();
    ctx.strokeStyle = color("muted");
    ctx.lineWidth = dpr;
    ctx.setLineDash([5 * dpr, 4 * dpr]);
    ctx.beginPath(); ctx.moveTo(bbox.left, y); ctx.lineTo(bbox.left + bbox.width, y); ctx.stroke();
    ctx.restore();
  }

  const plots = [], observers = [];
  function makePlot(holder, figure, key, unit, height, sync) {
    const time = Array.from({ length: figure.time.count }, (_, k) => figure.time.from_s + k * figure.time.step_s);
    const columns = [time, ...figure.runs.map(run => numbers(run[key]))];
    const series = figure.runs.map((run, k) => ({
      stroke: color(inks[k % inks.length]) + "d0", width: 1.5, points: { show: false }, show: !run.hidden,
      paths: key === "override" ? uPlot.paths.stepped({ align: 1 }) : undefined,
    }));
    const plot = new uPlot({
      width: Math.max(holder.clientWidth, 120), height, pxAlign: 0, legend: { show: false },
      cursor: { y: false, points: { size: 6 }, drag: { x: true, y: false, dist: 5 }, sync: { key: sync, scales: ["x", null] } },
      scales: { x: { time: false }, y: { range: (u, low, high) => [Math.min(0, low), key === "force" ? Math.max(high, figure.reference_n) * 1.05 : Math.max(high * 1.05, 1)] } },
      series: [{}, ...series], axes: axes(unit), padding: [10, 14, 0, 0],
      hooks: { draw: key === "force" ? [u => drawReference(u, figure.reference_n)] : [] },
    }, columns, holder);
    const observer = new ResizeObserver(() => {
      if (holder.clientWidth !== plot.width) plot.setSize({ width: Math.max(holder.clientWidth, 120), height });
    });
    observer.observe(holder);
    observers.push(observer);
    plots.push(plot);
    return plot;
  }
  function legend(figure, own) {
    const key = element("div", { className: "key" });
    figure.runs.forEach((run, k) => {
      const swatch = element("i");
      swatch.style.color = color(inks[k % inks.length]);
      const toggle = element("button", { type: "button", title: run.scenario }, swatch, run.name);
      toggle.setAttribute("aria-pressed", String(!run.hidden));
      toggle.addEventListener("click", () => {
        run.hidden = !run.hidden;
        toggle.setAttribute("aria-pressed", String(!run.hidden));
        for (const plot of own) plot.setSeries(k + 1, { show: !run.hidden });
      });
      key.append(toggle);
    });
    return key;
  }
  function render() {
    for (const observer of observers.splice(0)) observer.disconnect();
    for (const plot of plots.splice(0)) plot.destroy();
    figures.forEach((figure, k) => {
      const holder = document.getElementById("plots-" + figure.name);
      holder.replaceChildren();
      const own = [];
      const force = element("div", { className: "plot", role: "img", ariaLabel: "Force over time" });
      const override = element("div", { className: "plot", role: "img", ariaLabel: "Override over time" });
      holder.append(legend(figure, own), element("h3", {}, "Cutting force; dashed: the force to hold"), force,
                    element("h3", {}, "Feed override"), override);
      own.push(makePlot(force, figure, "force", "N", 260, "figure-" + k), makePlot(override, figure, "override", "%", 150, "figure-" + k));
    });
  }
  render();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
})();
