// Compare: every test measured and computed, small; one of them large.
import { state, el, of, api, on, emit, attempt, ask, percent, digits, splitWords, say, remember, node, modelName, runTime } from "./core.js";
import { thumb, drawLarge } from "./plots.js";

const view = document.getElementById("view-compare");
let cards = new Map();

/** Curves of the model, whole; and those of the model it was made from, to be seen behind them. */
export async function load() {
  const model = state.model;
  const found = await api(of("compare"), { model, whole: true });
  const parent = state.about.models.find(m => m.id === model)?.parent;
  let before = null;
  if (parent) {
    const old = await api(of("compare"), { model, before: true });
    before = new Map(old.tests.map(t => [t.id, (t.curves || []).map(c => c.computed)]));
  }
  // The model beside it, where one was chosen and is still there.
  const beside = state.about?.models.some(m => m.id === state.beside) && state.beside !== model ? state.beside : null;
  const other = beside ? await api(of("compare"), { model: beside }) : null;
  if (model !== state.model) return;
  state.beside = beside;
  state.besideTests = other && new Map(other.tests.map(t => [t.id, t]));
  state.tests = found.tests; state.before = before; state.values = {};
  emit("tests");
}

/** Computed values at the sliders' values, or of a fit that runs; only what is on the page. */
let asking = false, again = null;
export async function move(model, values, shown, begun = performance.now()) {
  // The last position counts; those between two answers are passed over.
  if (asking) { again = [model, values, shown, begun]; return; }
  asking = true;
  await attempt(async () => {
    const found = await api(of("compare"), { model, values, tests: shown });
    for (const t of found.tests) if (!t.sealed) emit("moved", t);
    await new Promise(done => requestAnimationFrame(() => setTimeout(done, 0)));
    performance.measure("slider", { start: begun });
  });
  asking = false;
  if (again) { const next = again; again = null; move(...next); }
}

/** The curves of the model that is shown, in place of those of a fit that came to no model. */
export function restore() {
  if (Object.keys(state.values).length) return move(state.model, state.values, visibleTests().map(t => t.id));
  for (const t of visibleTests()) emit("moved", t);
}

export const visibleTests = () => state.tests.filter(t => !t.sealed);

/** A card of a test. */
export function card(t, { click, large = false, old = state.before?.get(t.id), also } = {}) {
  if (t.sealed) {
    return { node: el("div", { class: "card sealed" }, el("h2", {}, t.id), el("p", {}, "Sealed: held out. ", el("span", { class: "soft" }, t.about))), update() {} };
  }
  const score = el("span", { class: "score" });
  const bar = el("span", { class: "bar" });
  const pictures = t.curves.slice(0, large ? 9 : 2).map((c, k) => ({ ...thumb(c, old?.[k], also?.[k]), label: c.label, unit: c.unit }));
  const told = (error, floor) => {
    const ratio = error / floor;
    score.textContent = `${percent(error)}, ${digits(ratio, 3)} × floor`;
    bar.style.setProperty("--part", Math.min(1, Math.log10(Math.max(ratio, 1)) / 2));
    bar.classList.toggle("good", ratio < 1.5);
  };
  told(t.error, t.floor);
  const body = [el("h2", {}, t.id, " ", el("span", { class: "tag " + t.split }, splitWords[t.split])), bar, score,
    ...pictures.map(p => el("div", { class: "panel" }, p.node, el("span", { class: "soft" }, `${p.label} [${p.unit}]`)))];
  const node = click
    ? el("button", { type: "button", class: "card", onclick: click, title: "Enlarge" }, ...body)
    : el("div", { class: "card" }, ...body);
  return { node, update(moved) { moved.curves.forEach((c, k) => pictures[k]?.update(c.computed)); told(moved.error, moved.floor); } };
}

function draw() {
  cards = new Map();
  const large = el("div", { id: "large" });
  const grid = el("div", { class: state.beside ? "grid pairs" : "grid" });
  if (state.beside) grid.append(...heads());
  for (const t of state.tests) {
    const other = state.besideTests?.get(t.id);
    const c = card(t, { click: () => enlarge(state.detail === t.id ? null : t.id), also: other?.curves?.map(c => c.computed) });
    cards.set(t.id, c);
    grid.append(c.node);
    if (other) grid.append(besides(t, other));
  }
  const sealed = state.tests.filter(t => t.sealed).length;
  const open = sealed ? el("p", { class: "note" }, `${sealed} held-out tests are sealed: they are for the last word on a model. `,
    el("button", { type: "button", onclick: openHeldOut }, "Open the held-out tests")) : null;
  const opened = state.about.held_out_opened.length && state.about.study.tests.some(t => t.split === "held_out")
    ? el("p", { class: "note" }, `The held-out tests were opened (${state.about.held_out_opened.map(o => o.by === "ladder" ? "by a ladder" : "by the reader").join(", ")}); that stands in the results from then on.`) : null;
  const legend = el("p", { class: "legend" }, el("span", { class: "key measured" }, "measured"), el("span", { class: "key computed" }, "computed"),
    state.before ? el("span", { class: "key old" }, "before") : null, el("span", { class: "soft" }, "error: rms(measured − computed) / rms(measured − mean); floor: the noise alone would give this; bar: from the floor to a hundred times the floor, logarithmic, blue below one and a half times"));
  view.replaceChildren(legend, chooser(), ...[open, opened].filter(Boolean), large, grid);
  enlarge(state.detail, false);
}

/** Which model stands beside the one that is shown. */
function chooser() {
  const others = state.about.models.filter(m => m.id !== state.model);
  if (!others.length) return "";
  const select = el("select", { "aria-label": "Model beside this one", onchange: e => attempt(async () => { state.beside = e.target.value || null; remember(); await load(); }) },
    el("option", { value: "" }, "none"), ...others.map(m => el("option", { value: m.id, selected: m.id === state.beside }, `${modelName(m)}${runTime(m.id) ? `, ${runTime(m.id)}` : ""}`)));
  return el("p", { class: "buttons" }, el("label", {}, "Beside it ", select));
}

/** Names and errors of the two models, over their columns. */
function heads() {
  return [node(), node(state.beside)].map(m => el("div", { class: "pair-head" }, el("h2", {}, modelName(m)),
    ...["fit", "select", "held_out"].filter(s => m.errors?.[s]).map(s => el("div", {}, `${splitWords[s]} ${percent(m.errors[s].error)}, ${digits(m.errors[s].error / m.errors[s].floor, 3)} × floor`)),
    m.cost ? el("div", { class: "soft" }, `cost of the fit ${digits(m.cost, 4)}`) : null));
}

/** The card of a test with the curves of the other model. */
function besides(t, other) {
  if (t.sealed) return card(t).node;
  const theirs = { ...t, error: other.error, floor: other.floor, curves: t.curves.map((c, k) => ({ ...c, computed: other.curves[k].computed })) };
  return card(theirs, { old: null, also: t.curves.map(c => c.computed) }).node;
}

async function openHeldOut() {
  if (!await ask("Open the held-out tests? They are then no longer unseen, and every result written from now on says so.")) return;
  await attempt(async () => { await api(of("open"), { model: state.model }); emit("reload"); });
}

async function enlarge(id, scroll = true) {
  state.detail = state.tests.some(t => t.id === id && !t.sealed) ? id : null;
  remember();
  const large = document.getElementById("large");
  const t = state.tests.find(t => t.id === state.detail);
  for (const [k, c] of cards) c.node.classList.toggle("chosen", k === state.detail);
  if (!large) return;
  if (!t) { large.replaceChildren(); return; }
  const figures = el("div", { class: "figures" });
  large.replaceChildren(el("div", { class: "large-head" }, el("h2", {}, t.id), el("span", { class: "soft" }, t.about),
    el("span", {}, `farthest point: ${t.worst}`), el("button", { type: "button", onclick: () => enlarge(null) }, "Close")), figures);
  await attempt(() => drawLarge(figures, t.curves, t.curves.map(c => c.computed), state.before?.get(t.id)));
  if (scroll) large.scrollIntoView({ block: "nearest" });
}

on("tests", draw);
on("moved", async moved => {
  cards.get(moved.id)?.update(moved);
  if (moved.id === state.detail && state.view === "compare") {
    const t = state.tests.find(t => t.id === moved.id);
    const figures = document.querySelector("#large .figures");
    if (t && figures) await drawLarge(figures, t.curves, moved.curves.map(c => c.computed), state.before?.get(t.id));
  }
});

/** Errors of the tests that have followed the sliders, by test. */
let followed = new Map(), telling = null;

/** The first line: does it fit? */
export function answer() {
  telling = null;
  const all = visibleTests(), moved = Object.keys(state.values).length > 0;
  if (!all.length) return say("No test can be shown.");
  const seen = moved && followed.size < all.length ? all.filter(t => followed.has(t.id)) : all;
  if (!seen.length) return;
  const pooled = split => {
    const here = seen.filter(t => t.split === split);
    if (!here.length) return null;
    const rms = f => Math.sqrt(here.reduce((s, t) => s + f(moved ? followed.get(t.id) : t) ** 2, 0) / here.length);
    return { error: rms(t => t.error), floor: rms(t => t.floor) };
  };
  const words = ["fit", "select", "held_out"].map(s => [s, pooled(s)]).filter(p => p[1]);
  const worst = Math.max(...words.map(([, p]) => p.error / p.floor));
  const verdict = worst < 1.3 ? "The model agrees with the tests to within the noise." : worst < 3 ? "The model is close, and more than the noise is left." : "The model fails: the error is many times the noise.";
  const unfitted = moved ? " These are the sliders' values, not a fit." : state.model === "study" ? " These are its starting values, not a fit." : "";
  const those = seen.length < all.length ? ` Of ${seen.map(t => t.id).join(", ")} alone, which follows the sliders:` : "";
  say(`${verdict}${unfitted}${those} Error ${words.map(([s, p]) => `${percent(p.error)} on the ${splitWords[s]} tests (floor ${percent(p.floor)})`).join(", ")}.`);
}
on("tests", () => { followed = new Map(); answer(); });
on("moved", t => {
  // The curves of a fit that runs are told by its cost.
  if (state.job && !state.job.ended) return;
  if (Object.keys(state.values).length) {
    followed.set(t.id, t);
    // Four times a second at most: it is read aloud.
    telling ??= setTimeout(answer, 250);
  } else if (followed.size) {
    followed = new Map();
    answer();
  }
});
