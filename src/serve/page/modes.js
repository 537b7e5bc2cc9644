// Modes: natural frequencies of the model that is shown, and their shapes moving over the picture of the structure.
import { state, el, of, api, on, emit, attempt, percent, digits } from "./core.js";

const still = matchMedia("(prefers-reduced-motion: reduce)");
/** Seconds of a period, whatever the frequency: a shape is looked at. */
const PERIOD = 1.8;
const shown = { of: null, found: null, test: "", mode: -1, plays: !still.matches, frame: 0 };
let posing = null, button = null;

still.addEventListener("change", () => { shown.plays = !still.matches; emit("modes"); });

/** The modes of the model that is shown, at the conditions of a test. */
async function load() {
  const model = state.model;
  const found = await attempt(() => api(of("modes"), { model, test: shown.test || null }));
  if (model !== state.model) return;
  Object.assign(shown, { of: found && `${state.study} ${model}`, found, test: found?.test || "", mode: found?.modes.length ? Math.min(Math.max(shown.mode, 0), found.modes.length - 1) : -1 });
  emit("modes");
}

const current = () => shown.of === `${state.study} ${state.model}` ? shown.found : null;

/** The line of controls above the picture. */
export function controls() {
  const found = current();
  if (!found) return el("p", { class: "buttons" }, el("button", { type: "button", id: "show-modes", onclick: load }, "Show the modes"), el("span", { class: "soft" }, "natural frequencies and shapes of this model"));
  const label = (m, k) => `${k + 1}: ${digits(m.frequency, 4)} Hz, damping ${percent(m.damping)}${m.family ? `, ${m.family}` : ""}`;
  const choose = el("select", { id: "mode", onchange: e => { shown.mode = +e.target.value; emit("modes", "mode"); } },
    el("option", { value: -1 }, "none"), ...found.modes.map((m, k) => el("option", { value: k, selected: k === shown.mode }, label(m, k))));
  if (!found.modes.length) return el("p", { class: "buttons" }, el("span", { class: "soft" }, "The model has no mode that oscillates: nothing with a mass is free to move."));
  const tests = state.about.study.tests;
  const at = tests.length > 1 ? el("label", {}, "under ", el("select", { id: "mode-test", onchange: e => { shown.test = e.target.value; load(); } },
    ...tests.map(t => el("option", { value: t.id, selected: t.id === found.test }, t.id)))) : null;
  button = el("button", { type: "button", id: "play", disabled: shown.mode < 0, onclick: () => { shown.plays = !shown.plays; emit("modes", "play"); } }, shown.plays ? "Pause" : "Play");
  return el("p", { class: "buttons" }, el("label", {}, "Mode ", choose), button, at,
    el("span", { class: "soft" }, `${found.conditions ? `at ${found.conditions}; ` : ""}amplitudes are scaled to be seen`));
}

/** A complex amplitude at a phase. */
const at = ([re, im], phase) => re * Math.cos(phase) - im * Math.sin(phase);

/** The phase at which most of a shape is real and positive: the shape as it is drawn at rest. */
function largest(numbers) {
  const [re, im] = numbers.reduce((a, b) => Math.hypot(...b) > Math.hypot(...a) ? b : a, [0, 0]);
  return -Math.atan2(im, re);
}

/** Displacements of the bodies of a mode at a phase, in the picture's own units: `{dx, dy, turn}`, of parts with two ends `{ends}`. */
function displaced(mode, phase, scale) {
  const all = new Map();
  for (const p of mode.parts) {
    if (p.ends) { all.set(p.body, { ends: p.ends.map(([x, y]) => [at(x, phase) * scale, -at(y, phase) * scale]) }); continue; }
    const by = at(p.by, phase), d = all.get(p.body) || { dx: 0, dy: 0, turn: 0 };
    // Seen from above x, with z aslant.
    if (p.axis === "x") d.dx += 22 * by;
    else if (p.axis === "y") d.dy -= 22 * by;
    else if (p.axis === "z") { d.dx += 11 * by; d.dy -= 16 * by; }
    else d.turn += 18 * by;
    all.set(p.body, d);
  }
  return all;
}

/** Lets a picture move: `pose(displacements)` puts its bodies where they are; `scale` takes the page's millimetres to the picture. */
export function move(pose, scale) {
  cancelAnimationFrame(shown.frame);
  posing = pose;
  const mode = current()?.modes[shown.mode];
  if (!mode) return;
  const from = largest(mode.parts.flatMap(p => p.ends ? p.ends.flat() : [p.by]));
  const begun = performance.now();
  const step = now => {
    if (posing !== pose) return;
    const phase = shown.plays ? 2 * Math.PI * (now - begun) / 1000 / PERIOD : 0;
    if (state.view === "structure") pose(displaced(mode, from + phase, scale));
    if (shown.plays) shown.frame = requestAnimationFrame(step);
  };
  step(begun);
}

/** The largest displacement of any mode in the picture: the frame is the same for all of them. */
export function reach(scale) {
  if (!moving()) return 0;
  const phases = [...Array(16).keys()].map(k => k * Math.PI / 16);
  const sizes = current().modes.flatMap(m => phases.flatMap(p => [...displaced(m, p, scale).values()].flatMap(d => (d.ends || [[d.dx, d.dy]]).map(e => Math.hypot(...e)))));
  return Math.max(0, ...sizes);
}

export const moving = () => Boolean(current()?.modes[shown.mode]);

on("described", () => { if (shown.of?.startsWith(`${state.study} `) && !current()) load(); });
