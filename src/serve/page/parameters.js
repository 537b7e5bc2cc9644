// Parameters: values with intervals, and sliders that move the curves.
import { state, el, svg, on, emit, digits } from "./core.js";
import { card, move, visibleTests } from "./compare.js";
import { run } from "./models.js";

const view = document.getElementById("view-parameters");
let cards = new Map(), chosen = "";

/** Slider positions 0 ... 1000 and values: logarithmic for what is positive, else linear about the value. */
function scale(p) {
  const v = p.value;
  if (v > 0 && (p.positive || p.min === 0 || p.min === null || p.min > 0)) {
    let low = Math.max(v / 10, p.min > 0 ? p.min : 0), high = Math.min(v * 10, p.max ?? Infinity);
    if (!(high > low)) [low, high] = [v / 10, v * 10];
    const l = Math.log(high / low);
    return { to: s => low * Math.exp(l * s / 1000), from: x => 1000 * Math.log(Math.max(x, low) / low) / l };
  }
  const reach = Math.abs(v) || p.factor || 1;
  const low = Math.max(p.min ?? -Infinity, v - reach), high = Math.min(p.max ?? Infinity, v + reach);
  return { to: s => low + (high - low) * s / 1000, from: x => 1000 * (x - low) / ((high - low) || 1) };
}

const shown = () => chosen ? [chosen] : visibleTests().map(t => t.id);
const send = () => move(state.model, state.values, shown());

function word(p) {
  if (!p.free) return "fixed";
  if (p.at_bound) return "at its bound";
  if (p.identifiable === true) return p.interval?.[0] <= 0 && p.interval?.[1] >= 0 ? "not told from zero" : "identified";
  if (p.identifiable === false) return "not identified";
  return "not fitted yet";
}

const RISE = 1.92; // of the cost, at the ends of a 95 % interval of one parameter

/** The profile of a parameter: by how much the cost rises where it is held, all others refitted. */
function profile(p) {
  const f = p.profile, k = p.factor || 1, least = Math.min(...f.points.map(q => q[1]));
  const points = f.points.map(([v, c]) => [v / k, c - least]).filter(q => q[1] < 40 * RISE);
  const wide = points.length > 1 && points.every(q => q[0] > 0) && points[points.length - 1][0] > 30 * points[0][0];
  const W = 420, H = 120, top = Math.max(2 * RISE, Math.min(6 * RISE, ...[Math.max(...points.map(q => q[1]))]));
  const X = v => wide ? Math.log10(v) : v, x0 = X(points[0][0]), x1 = X(points[points.length - 1][0]);
  const sx = v => 8 + (W - 16) * (X(v) - x0) / ((x1 - x0) || 1), sy = c => H - 8 - (H - 16) * Math.min(c, 1.1 * top) / top;
  const end = (v, bound, open) => v === null ? open : digits(v / k, 5) + (bound ? " (its bound)" : "");
  const told = `95 % interval by profile: ${end(f.interval[0], f.at_bound[0], "no lower end")} to ${end(f.interval[1], f.at_bound[1], "no upper end")} ${p.unit}`;
  return el("figure", { class: "profile" },
    svg("svg", { viewBox: `0 0 ${W} ${H}`, class: "thumb", role: "img", "aria-label": told },
      svg("line", { class: "level", x1: 0, x2: W, y1: sy(RISE), y2: sy(RISE) }), svg("text", { class: "level", x: 4, y: sy(RISE) - 3 }, "95 %"),
      svg("path", { class: "computed", d: points.map(([v, c], i) => `${i ? "L" : "M"}${sx(v).toFixed(1)} ${sy(c).toFixed(1)}`).join("") }),
      ...points.map(([v, c]) => svg("circle", { class: "dot", cx: sx(v).toFixed(1), cy: sy(c).toFixed(1), r: 2.5 }))),
    el("figcaption", {}, `Rise of the cost over ${p.name}, ${digits(points[0][0], 5)} to ${digits(points[points.length - 1][0], 5)} ${p.unit}${wide ? ", logarithmic" : ""}. ${told}.`,
      f.better !== null ? " A better fit was met on the way: fit again from these values." : ""));
}

/** A name of several places may go on in another line behind each of them. */
const breakable = name => name.split(/(?<=[.,])/).flatMap((part, k) => k ? [el("wbr"), part] : [part]);

function row(p) {
  const s = scale(p), k = p.factor || 1, now = state.values[p.key] ?? p.value;
  const inUnit = v => digits(v / k, 5);
  const slider = el("input", { type: "range", min: 0, max: 1000, step: 0.05, value: s.from(now), "aria-label": `${p.name}, slider` });
  const number = el("input", { type: "text", inputmode: "decimal", size: 9, value: inUnit(now), "aria-label": `${p.name} in ${p.unit || "its unit"}` });
  // What is sent is what is shown and told, within the bounds.
  const round = v => Math.min(Math.max(+(v / k).toPrecision(5) * k, p.min ?? -Infinity), p.max ?? Infinity);
  const set = v => { state.values = { ...state.values, [p.key]: v }; slider.closest("tr").classList.add("moved"); emit("values"); send(); };
  slider.addEventListener("input", () => { const v = round(s.to(+slider.value)); number.value = inUnit(v); slider.setAttribute("aria-valuetext", `${inUnit(v)} ${p.unit}`); set(v); });
  number.addEventListener("change", () => { const v = parseFloat(number.value.replace(",", ".")) * k; if (Number.isFinite(v)) { slider.value = s.from(v); set(v); } });
  const [a, b] = p.interval || [];
  const interval = p.at_bound ? "-" : p.identifiable ? `${inUnit(a)} to ${inUnit(b)}` : p.identifiable === false ? "the data do not say" : "-";
  const range = el("span", { class: "interval" });
  // The interval as it lies on the slider.
  if (p.identifiable && !p.at_bound && Number.isFinite(a) && Number.isFinite(b)) {
    const clip = x => Math.min(100, Math.max(0, s.from(x) / 10));
    range.style.setProperty("--from", clip(a) + "%");
    range.style.setProperty("--to", clip(b) + "%");
  } else range.classList.add(p.identifiable === false ? "open" : "none");
  const ask = p.free ? el("button", { type: "button", title: "Refits all others with this one held at values around it", "aria-label": `Profile of ${p.name}`, onclick: () => run({ verb: "profile", parameter: p.name }) }, "Profile") : null;
  const main = el("tr", { title: p.doc, class: p.key in state.values ? "moved" : null }, el("th", { scope: "row" }, ...breakable(p.name)), el("td", { class: "n" }, number, " ", p.unit), el("td", {}, slider, range), el("td", { class: "soft" }, interval), el("td", { class: p.identifiable === false ? "warn" : "soft" }, word(p)), el("td", {}, ask));
  return p.profile ? [main, el("tr", { class: "profile" }, el("td", { colspan: 6 }, profile(p)))] : [main];
}

function draw() {
  const d = state.described;
  if (!d || !state.tests.length) return;
  cards = new Map();
  const tests = visibleTests();
  if (!tests.some(t => t.id === chosen)) chosen = tests.length > 12 ? (state.detail && tests.some(t => t.id === state.detail) ? state.detail : tests[0].id) : "";
  const select = el("select", { "aria-label": "Tests that follow the sliders", onchange: e => { chosen = e.target.value; draw(); send(); } },
    el("option", { value: "" }, `all ${tests.length} tests`), ...tests.map(t => el("option", { value: t.id, selected: t.id === chosen }, t.id)));
  const grid = el("div", { class: "grid" });
  for (const t of tests.filter(t => !chosen || t.id === chosen)) { const c = card(t, { large: !!chosen }); cards.set(t.id, c); grid.append(c.node); }
  const table = list => el("div", { class: "scroll" }, el("table", {}, el("thead", {}, el("tr", {}, ...["Parameter", "Value", "Move", "95 % interval", "State", "Profile"].map(h => el("th", { scope: "col" }, h)))), el("tbody", {}, ...list.flatMap(row))));
  const free = d.parameters.filter(p => p.free), fixed = d.parameters.filter(p => !p.free);
  view.replaceChildren(table(free.length ? free : fixed),
    free.length && fixed.length ? el("details", {}, el("summary", {}, `${fixed.length} fixed values`), table(fixed)) : "",
    el("p", { class: "buttons" }, el("button", { type: "button", onclick: () => { state.values = {}; draw(); emit("values"); send(); } }, "Put back"),
      el("button", { type: "button", onclick: () => run({ verb: "fit" }) }, "Fit from these values"), el("label", {}, "Curves of ", select)), el("h2", {}, "Tests"), grid);
}

on("tests", draw);
on("described", draw);
on("moved", t => cards.get(t.id)?.update(t));
