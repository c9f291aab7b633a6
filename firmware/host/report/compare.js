"use strict";
// The plots of a comparison: force and override of each part, of the contenders that are chosen.
(() => {
  const cuts = JSON.parse(document.getElementById("cuts").textContent);
  const wanted = new URLSearchParams(location.search).get("theme");
  if (wanted === "dark" || wanted === "light") document.documentElement.dataset.theme = wanted;

  const inks = ["blue", "orange", "green", "purple", "amber", "sky"];
  const color = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const font = "12px system-ui, -apple-system, 'Segoe UI', Roboto, 'Liberation Sans', sans-serif";
  // The ones shown first have inks of their own, the same in every comparison; the rest take turns,
  // dashed.
  let turn = 0;
  const looks = cuts.contenders.map(c =>
    c.oracle ? { ink: "grey", dash: [5, 4] }
      : c.place < 3 ? { ink: inks[c.place], dash: [] }
      : cuts.contenders.length <= inks.length ? { ink: inks[3 + turn++ % 3], dash: [] }
      : { ink: inks[turn++ % inks.length], dash: [2, 3] });
  const shown = cuts.contenders.map(c => c.shown);
  const plots = [];

  function element(tag, attributes, ...children) {
    const out = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes || {}))
      if (name in out && name !== "style") out[name] = value; else out.setAttribute(name, value);
    out.append(...children);
    return out;
  }
  const ticks = unit => (u, values) => values.map((t, k) => +t.toFixed(6) + (k === values.length - 1 && unit ? " " + unit : ""));

  function series(what) {
    return cuts.contenders.map((c, k) => ({
      label: c.name, show: shown[k], stroke: () => color(looks[k].ink), dash: looks[k].dash,
      width: c.oracle ? 1.5 : 2, points: { show: false },
      paths: what === "override" ? uPlot.paths.stepped({ align: 1 }) : undefined }));
  }
  function reference(plot) {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.strokeStyle = color("muted"); ctx.globalAlpha = .6; ctx.lineWidth = devicePixelRatio || 1;
    const y = Math.round(plot.valToPos(cuts.reference_n, "y", true)) + .5;
    if (y >= bbox.top && y <= bbox.top + bbox.height) {
      ctx.beginPath(); ctx.moveTo(bbox.left, y); ctx.lineTo(bbox.left + bbox.width, y); ctx.stroke();
    }
    ctx.restore();
  }
  function draw(place, part, what, unit, height) {
    const longest = Math.max(...part.cuts.map(c => c[what].length));
    const time = Array.from({ length: longest }, (_, k) => k * cuts.step_s);
    const padded = part.cuts.map(c => c[what].concat(Array(longest - c[what].length).fill(null)));
    const axis = { stroke: () => color("muted"), font, grid: { stroke: () => color("grid"), width: 1 }, ticks: { show: false } };
    const plot = new uPlot({
      width: place.clientWidth, height, legend: { show: false }, cursor: { drag: { x: true, y: false }, sync: { key: part.name } },
      scales: { x: { time: false }, y: { range: (u, low, high) => [0, Math.max(1.05 * (high || 0), what === "force" ? 1.3 * cuts.reference_n : 60)] } },
      axes: [{ ...axis, space: 70, size: 26, gap: 6, values: ticks("s") }, { ...axis, space: 34, size: 62, gap: 6, values: ticks(unit) }],
      series: [{}, ...series(what)],
      hooks: what === "force" ? { draw: [reference] } : {},
    }, [time, ...padded], place);
    plots.push({ plot, place });
  }

  const key = element("div", { className: "key" });
  cuts.contenders.forEach((c, k) => {
    const line = element("i", { className: looks[k].dash.length ? "dashed" : "" });
    line.style.color = `var(--${looks[k].ink})`;
    const button = element("button", { type: "button", title: c.title, "aria-pressed": String(shown[k]) }, line, c.name);
    button.addEventListener("click", () => {
      shown[k] = !shown[k];
      button.setAttribute("aria-pressed", String(shown[k]));
      for (const { plot } of plots) plot.setSeries(k + 1, { show: shown[k] });
    });
    key.append(button);
  });
  document.getElementById("chosen").append(key);

  const root = document.getElementById("plots");
  for (const part of cuts.parts) {
    const force = element("div", { className: "plot" }), override = element("div", { className: "plot" });
    root.append(element("section", { id: "part-" + part.name },
      element("h2", {}, part.title), element("p", { className: "caption" }, part.name + ": force and override; seed 1. Drag to zoom, double-click for all."),
      force, override));
    draw(force, part, "force", "N", 220);
    draw(override, part, "override", "%", 130);
  }
  addEventListener("resize", () => {
    for (const { plot, place } of plots) plot.setSize({ width: place.clientWidth, height: plot.height });
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { for (const { plot } of plots) plot.redraw(); });
})();
