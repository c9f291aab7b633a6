"use strict";
// The plots of a tuning page. All data stand in the page; every plot is a list of curves over one
// time grid, named by the element that it belongs into.
(() => {
  const plots = JSON.parse(document.getElementById("tuning").textContent);
  const wanted = new URLSearchParams(location.search).get("theme");
  if (wanted === "dark" || wanted === "light") document.documentElement.dataset.theme = wanted;
  const color = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const font = "12px system-ui, -apple-system, 'Segoe UI', Roboto, 'Liberation Sans', sans-serif";
  let drawn = [];

  function axes(unit) {
    const common = { stroke: color("muted"), font, grid: { stroke: color("grid"), width: 1 }, ticks: { show: false } };
    const last = word => (u, ticks) => ticks.map((t, k) => (+t.toFixed(6)) + (k === ticks.length - 1 ? " " + word : ""));
    return [
      { ...common, space: 60, size: 26, gap: 6, values: last("s") },
      { ...common, space: 34, size: 62, gap: 6, values: last(unit) },
    ];
  }
  // Dashed: where something happens, upright, and what is to be held, level.
  function marks(spec) {
    return plot => {
      const { ctx, bbox } = plot, dpr = devicePixelRatio || 1;
      ctx.save();
      ctx.strokeStyle = color("muted"); ctx.lineWidth = dpr; ctx.setLineDash([3 * dpr, 4 * dpr]);
      for (const t of spec.at_s || []) {
        const x = Math.round(plot.valToPos(t, "x", true)) + .5;
        ctx.beginPath(); ctx.moveTo(x, bbox.top); ctx.lineTo(x, bbox.top + bbox.height); ctx.stroke();
      }
      if (spec.level !== undefined) {
        const y = Math.round(plot.valToPos(spec.level, "y", true)) + .5;
        ctx.beginPath(); ctx.moveTo(bbox.left, y); ctx.lineTo(bbox.left + bbox.width, y); ctx.stroke();
      }
      ctx.restore();
    };
  }
  function draw(spec) {
    const holder = document.getElementById(spec.holder);
    holder.replaceChildren();
    const time = Array.from({ length: spec.curves[0].values.length }, (_, k) => spec.time ? spec.time[k] : spec.from_s + k * spec.step_s);
    const plot = new uPlot({
      width: Math.max(holder.clientWidth, 120), height: spec.height, pxAlign: 0, legend: { show: false },
      cursor: { y: false, points: { size: 6 }, drag: { x: true, y: false, dist: 5 }, sync: { key: spec.group } },
      scales: { x: { time: false } }, padding: [10, 14, 0, 0], axes: axes(spec.unit),
      series: [{}, ...spec.curves.map(c => ({
        stroke: color(c.ink), width: c.width || 1.8, points: { show: false },
        paths: c.stepped ? uPlot.paths.stepped({ align: 1 }) : undefined }))],
      hooks: { draw: [marks(spec)] },
    }, [time, ...spec.curves.map(c => c.values)], holder);
    drawn.push(plot);
    new ResizeObserver(() => {
      const width = Math.max(holder.clientWidth, 120);
      if (width !== plot.width) plot.setSize({ width, height: plot.height });
    }).observe(holder);
  }
  function render() {
    for (const plot of drawn.splice(0)) plot.destroy();
    for (const swatch of document.querySelectorAll("[data-ink]")) swatch.style.color = color(swatch.dataset.ink);
    for (const spec of plots) draw(spec);
  }
  render();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
})();
