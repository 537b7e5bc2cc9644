// Curves: small ones as SVG, which follow a slider within a frame, and large ones by plotly in the style of the report.
import { state, svg, el } from "./core.js";

const W = 220, H = 130, PAD = 4;

/** Magnitude and phase [deg] of real and imaginary parts in turn; the phase follows `like`, else itself. */
export function polar(values, like) {
  const magnitude = [], phase = [];
  for (let k = 0; k + 1 < values.length; k += 2) {
    magnitude.push(Math.hypot(values[k], values[k + 1]));
    const angle = Math.atan2(values[k + 1], values[k]) * 180 / Math.PI;
    const near = like ? like[k / 2] : phase[phase.length - 1];
    phase.push(Number.isFinite(near) ? angle + 360 * Math.round((near - angle) / 360) : angle);
  }
  return { magnitude, phase };
}

const wide = f => f.length > 1 && f.every(v => v > 0) && Math.max(...f) > 30 * Math.min(...f);

/** What a small plot shows of a curve: abscissa, and how values become ordinates. */
function frame(curve) {
  const frf = curve.kind === "frf";
  const logY = frf, logX = (frf || curve.kind === "table") && wide(curve.abscissa);
  const raw = curve.kind === "loop" && curve.x.length ? curve.x : (curve.abscissa.length ? curve.abscissa : curve.measured.map((_, k) => k + 1));
  const x = logX ? raw.map(Math.log10) : raw;
  const y = values => frf ? polar(values).magnitude.map(m => Math.log10(Math.max(m, 1e-300))) : values;
  return { x, y, closed: curve.kind === "loop" && curve.x.length > 0, logY };
}

const range = values => values.reduce(([a, b], v) => Number.isFinite(v) ? [Math.min(a, v), Math.max(b, v)] : [a, b], [Infinity, -Infinity]);

/** A small plot of one curve; `update(computed)` redraws the model. The frame holds the values of `also` too: plots beside each other have one scale. */
export function thumb(curve, before, also) {
  const f = frame(curve);
  const [x0, x1] = range(f.x), m = f.y(curve.measured), c = f.y(curve.computed);
  let [y0, y1] = range(m);
  const [c0, c1] = range(also ? [...c, ...f.y(also)] : c), span = (y1 - y0) || 1;
  // The model is seen as far as the measurement is high once more.
  y0 = Math.min(y0, Math.max(c0, y0 - 0.5 * span)); y1 = Math.max(y1, Math.min(c1, y1 + 0.5 * span));
  const sx = (W - 2 * PAD) / ((x1 - x0) || 1), sy = (H - 2 * PAD) / ((y1 - y0) || 1);
  const path = values => {
    let d = "", pen = "M";
    for (let k = 0; k < values.length; k++) {
      if (!Number.isFinite(values[k])) { pen = "M"; continue; }
      const v = Math.min(Math.max(H - PAD - (values[k] - y0) * sy, -H), 2 * H);
      d += pen + (PAD + (f.x[k] - x0) * sx).toFixed(1) + " " + v.toFixed(1);
      pen = "L";
    }
    return d + (f.closed && d ? "Z" : "");
  };
  const dots = curve.kind === "table";
  const parts = [svg("path", { class: dots ? "measured dots" : "measured", d: path(m) })];
  const old = before ? svg("path", { class: "old", d: path(f.y(before)) }) : null;
  const computed = svg("path", { class: "computed", d: path(c) });
  const picture = svg("svg", { viewBox: `0 0 ${W} ${H}`, class: "thumb", role: "img", "aria-label": `${curve.label}: measured and computed`, preserveAspectRatio: "none" }, parts, old, computed);
  return { node: picture, update: values => computed.setAttribute("d", path(f.y(values))) };
}

let loading = null;
/** plotly, loaded when a large plot is first asked for. */
export function plotly() {
  loading ??= new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = "/page/plotly.js";
    script.onload = () => done(window.Plotly);
    script.onerror = () => failed(new Error("plotly cannot be loaded"));
    document.head.append(script);
  });
  return loading;
}

/** Gives a large plot the size of its frame whenever that changes; in a tab that is hidden a frame has none, and a plot that is drawn there another size. */
const fitted = new ResizeObserver(frames => { for (const f of frames) if (f.contentRect.width && f.target.data) window.Plotly.Plots.resize(f.target); });

const plain = text => String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const titled = (name, unit) => plain(unit && unit !== "1" ? `${name} [${unit}]` : name);

function axis(kind, title, more = {}) {
  const base = structuredClone(state.style[kind]);
  base.title = { ...(base.title || {}), text: title, font: { size: 12, color: css("--ink") } };
  base.tickfont = { size: 12, color: css("--ink") };
  base.gridcolor = css("--grid");
  return { ...base, ...more };
}

function layout(axes) {
  const base = structuredClone(state.style.layout);
  delete base.xaxis; delete base.yaxis;
  base.paper_bgcolor = base.plot_bgcolor = css("--paper");
  base.font = { ...base.font, color: css("--ink") };
  return { ...base, ...axes };
}

const line = (x, y, name, colour, more = {}) => ({ type: "scatter", mode: "lines", x, y, name, line: { color: colour, width: 1.8 }, ...more });
const points = (x, y, name, colour, more = {}) => ({ type: "scatter", mode: "markers", x, y, name, marker: { color: colour, size: 4, opacity: 0.75 }, ...more });
const band = (x, low, high, more = {}) => ({
  type: "scatter", mode: "lines", x: [...x, ...[...x].reverse()], y: [...high, ...[...low].reverse()], name: "± 2 σ of the measurement",
  line: { color: state.style.grey, width: 0 }, fill: "toself", fillcolor: "rgba(128,128,128,0.25)", hoverinfo: "skip", ...more,
});
const closed = (values, yes) => yes && values.length ? [...values, values[0]] : values;
const whitened = (c, computed) => c.measured.map((m, k) => c.kind === "table" ? (m > 0 && computed[k] > 0 ? Math.log(m / computed[k]) * m / c.sigma[k] : null) : (m - computed[k]) / c.sigma[k]);

/** Large plots of a curve: `[{node, data(computed), draw()}]`. */
export function large(curve, computed, before) {
  const ink = css("--measured"), blue = css("--computed"), orange = css("--old");
  const figures = [];
  const add = (caption, height, traces, axes) => figures.push({ caption, height, traces, layout: layout(axes) });
  const r = whitened(curve, computed);
  const name = titled(curve.label, curve.unit);
  if (curve.kind === "frf") {
    const x = wide(curve.abscissa) ? "frequencies" : "linear";
    const m = polar(curve.measured), c = polar(computed, m.phase), o = before && polar(before, m.phase);
    const sigma = curve.sigma.filter((_, k) => k % 2 === 0);
    const traces = [
      band(curve.abscissa, m.magnitude.map((v, k) => Math.max(v - 2 * sigma[k], 0.01 * v)), m.magnitude.map((v, k) => v + 2 * sigma[k])),
      points(curve.abscissa, m.magnitude, "measured", ink), points(curve.abscissa, m.phase, "measured", ink, { yaxis: "y2", showlegend: false }),
      ...(o ? [line(curve.abscissa, o.magnitude, "before", orange), line(curve.abscissa, o.phase, "before", orange, { yaxis: "y2", showlegend: false })] : []),
      line(curve.abscissa, c.magnitude, "computed", blue), line(curve.abscissa, c.phase, "computed", blue, { yaxis: "y2", showlegend: false }),
      points(curve.abscissa, r.filter((_, k) => k % 2 === 0), "residual, real", blue, { yaxis: "y3" }),
      points(curve.abscissa, r.filter((_, k) => k % 2 === 1), "residual, imaginary", orange, { yaxis: "y3" }),
    ];
    // One abscissa for the three: a zoom in one is a zoom in all.
    add("magnitude, phase, residual against frequency", 620, traces, {
      xaxis: axis(x, "frequency [Hz]", { anchor: "y3" }), yaxis: axis("decades", name, { domain: [0.55, 1] }),
      yaxis2: axis("linear", "phase [deg]", { domain: [0.29, 0.5] }), yaxis3: axis("linear", "residual / σ", { domain: [0, 0.24] }),
    });
    return figures;
  }
  const loop = curve.kind === "loop" && curve.x.length > 0;
  const x = loop ? curve.x : (curve.abscissa.length ? curve.abscissa : curve.measured.map((_, k) => k + 1));
  const low = curve.measured.map((m, k) => m - 2 * curve.sigma[k]), high = curve.measured.map((m, k) => m + 2 * curve.sigma[k]);
  const over = { loop: loop ? titled(curve.driven, curve.x_unit) : "phase in the cycle [deg]", record: "time [s]", table: curve.over?.startsWith("amplitude") ? curve.over : "frequency [Hz], or row" }[curve.kind];
  add(loop ? "over the drive: the loop" : `against ${over}`, 420, [
    band(closed(x, loop), closed(low, loop), closed(high, loop)),
    curve.kind === "record" ? line(x, curve.measured, "measured", ink) : points(x, curve.measured, "measured", ink),
    ...(before ? [line(closed(x, loop), closed(before, loop), "before", orange)] : []),
    line(closed(x, loop), closed(computed, loop), "computed", blue),
  ], { xaxis: axis("linear", over), yaxis: axis("linear", name) });
  const against = (values, title, caption) => values.length === r.length && values.length &&
    add(caption, 260, [points(values, r, "residual", blue, { showlegend: false })], { xaxis: axis("linear", title), yaxis: axis("linear", "residual / σ") });
  against(curve.abscissa, curve.kind === "loop" ? "phase in the cycle [deg]" : over, curve.kind === "loop" ? "residual against phase" : "residual against " + over);
  against(curve.v, curve.x_unit === "SI" ? "velocity [SI]" : `velocity [${curve.x_unit}/s]`, "residual against velocity");
  if (loop) against(curve.x, over, "residual against the drive");
  return figures;
}

/** Draws large plots into `into`, or again where they stand already. */
export async function drawLarge(into, curves, computed, before) {
  const P = await plotly();
  let k = 0;
  for (const [c, curve] of curves.entries()) {
    for (const f of large(curve, computed[c], before?.[c])) {
      let figure = into.children[k];
      if (!figure) {
        figure = el("figure", {}, el("figcaption", {}), el("div"));
        into.append(figure);
        fitted.observe(figure.lastChild);
      }
      figure.firstChild.replaceChildren(el("b", {}, curve.label), " " + f.caption);
      figure.lastChild.style.height = f.height + "px";
      await P.react(figure.lastChild, f.traces, { ...f.layout, uirevision: "keep" }, { displaylogo: false, displayModeBar: false });
      k++;
    }
  }
  while (into.children.length > k) into.lastChild.remove();
}
