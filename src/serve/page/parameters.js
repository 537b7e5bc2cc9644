// Parameters: values with intervals, and sliders that move the curves.
import { state, el, of, api, on, emit, digits, percent } from "./core.js";
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
  if (p.identifiable === true) return "identified";
  if (p.identifiable === false) return "not identified";
  return "not fitted yet";
}

function row(p) {
  const s = scale(p), k = p.factor || 1;
  const inUnit = v => digits(v / k, 5);
  const slider = el("input", { type: "range", min: 0, max: 1000, step: 1, value: Math.round(s.from(p.value)), "aria-label": `${p.name}, slider` });
  const number = el("input", { type: "text", inputmode: "decimal", size: 9, value: inUnit(p.value), "aria-label": `${p.name} in ${p.unit || "its unit"}` });
  const set = v => { state.values = { ...state.values, [p.key]: v }; slider.closest("tr").classList.add("moved"); send(); };
  slider.addEventListener("input", () => { const v = s.to(+slider.value); number.value = inUnit(v); slider.setAttribute("aria-valuetext", `${inUnit(v)} ${p.unit}`); set(v); });
  number.addEventListener("change", () => { const v = parseFloat(number.value.replace(",", ".")) * k; if (Number.isFinite(v)) { slider.value = Math.round(s.from(v)); set(v); } });
  const [a, b] = p.interval || [];
  const interval = p.identifiable ? `${inUnit(a)} to ${inUnit(b)}` : p.identifiable === false ? "the data do not say" : "-";
  const range = el("span", { class: "interval" });
  // The interval as it lies on the slider.
  if (p.identifiable && Number.isFinite(a) && Number.isFinite(b)) {
    const clip = x => Math.min(100, Math.max(0, s.from(x) / 10));
    range.style.setProperty("--from", clip(a) + "%");
    range.style.setProperty("--to", clip(b) + "%");
  } else range.classList.add(p.identifiable === false ? "open" : "none");
  return el("tr", { title: p.doc }, el("th", { scope: "row" }, p.name), el("td", { class: "n" }, number, " ", p.unit), el("td", {}, slider, range), el("td", { class: "soft" }, interval), el("td", { class: p.identifiable === false ? "warn" : "soft" }, word(p)));
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
  const table = list => el("div", { class: "scroll" }, el("table", {}, el("thead", {}, el("tr", {}, ...["Parameter", "Value", "Move", "95 % interval", "State"].map(h => el("th", { scope: "col" }, h)))), el("tbody", {}, ...list.map(row))));
  const free = d.parameters.filter(p => p.free), fixed = d.parameters.filter(p => !p.free);
  view.replaceChildren(table(free.length ? free : fixed),
    free.length && fixed.length ? el("details", {}, el("summary", {}, `${fixed.length} fixed values`), table(fixed)) : "",
    el("p", { class: "buttons" }, el("button", { type: "button", onclick: () => { state.values = {}; draw(); send(); } }, "Put back"),
      el("button", { type: "button", onclick: () => run({ verb: "fit", values: state.values }) }, "Fit from these values"), el("label", {}, "Curves of ", select)), el("h2", {}, "Tests"), grid);
}

on("tests", draw);
on("described", draw);
on("moved", t => cards.get(t.id)?.update(t));
