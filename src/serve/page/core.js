// State of the page, requests, and small helpers. Text of files and names reaches the page as text nodes alone, never as markup.

export const state = {
  studies: [], study: null, about: null, model: "study", view: "compare",
  folder: null,     // where new studies are written
  beside: null,     // model whose curves stand beside those of the one shown
  besideTests: null, // its tests by id
  tests: [],        // curves of the model, whole
  before: null,     // computed values of the model it was made from, by test and curve
  detail: null,     // test that is enlarged
  place: null,      // place that is looked at
  job: null,        // job that runs or ran last
  described: null,  // structure and parameters of the model
  values: {},       // values moved by sliders
  style: null,
};

const listeners = new Map();
export function on(name, f) { listeners.set(name, [...(listeners.get(name) || []), f]); }
export function emit(name, detail) { for (const f of listeners.get(name) || []) f(detail); }

/** An element with attributes and children; strings become text. */
export function el(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key.startsWith("aria-") && typeof value === "boolean") node.setAttribute(key, String(value));
    else if (value === true) node.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(key, value);
  }
  node.append(...children.flat().filter(c => c !== null && c !== undefined && c !== false));
  return node;
}

/** The same of SVG. */
export function svg(name, attributes = {}, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (value !== null && value !== undefined) node.setAttribute(key, value);
  }
  node.append(...children.flat().filter(c => c !== null && c !== undefined));
  return node;
}

export class Failure extends Error {
  constructor(message, where = "") { super(message); this.where = where; }
}

/** A request; an error says what, where, and what would be accepted. */
export const api = (path, body) => request(path, body === undefined ? {} : { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) });

/** A file on its way to the server. */
export const send = (path, file) => request(path, { method: "POST", headers: { "content-type": "application/octet-stream" }, body: file });

async function request(path, options) {
  let response;
  try { response = await fetch("/api/" + path, options); } catch { throw new Failure("the server does not answer: is `misfit serve` still running?"); }
  const text = await response.text();
  let value;
  try { value = JSON.parse(text); } catch { throw new Failure(`the server answered ${response.status}`); }
  if (value.error) {
    const e = value.error;
    throw new Failure(failureText(e), e.where);
  }
  return value;
}

/** An error in one line. */
export const failureText = e => e.message + (e.where ? ` (${e.where})` : "") + (e.accepted ? `; accepted: ${e.accepted}` : "");

export const of = what => `studies/${state.study}${what ? "/" + what : ""}`;

/** Says something in the line that answers. */
export function say(text, bad = false) {
  const line = document.getElementById("answer");
  line.textContent = text;
  line.classList.toggle("bad", bad);
}

/** What failed stays in the line that answers until the reader does something else. */
for (const gesture of ["click", "input"]) document.addEventListener(gesture, () => { if (document.getElementById("answer").classList.contains("bad")) say(""); }, true);

/** Runs an action of the reader; its failure is said. */
export async function attempt(action) {
  try { return await action(); } catch (e) { say(e.message, true); if (!(e instanceof Failure)) console.error(e); return null; }
}

export function digits(v, n = 3) {
  if (v === null || v === undefined || !Number.isFinite(v)) return "-";
  if (v === 0) return "0";
  const power = Math.floor(Math.log10(Math.abs(v)));
  if (power < -3 || power > 5) return v.toExponential(n - 1);
  return v.toFixed(Math.max(0, n - 1 - power));
}
export const percent = f => (f === null || f === undefined || !Number.isFinite(f)) ? "-" : digits(100 * f, 3) + " %";
export const splitWords = { fit: "fit", select: "select", held_out: "held out" };

/** A question with two answers. */
export function ask(text) {
  const dialog = document.getElementById("ask");
  document.getElementById("ask-text").textContent = text;
  dialog.showModal();
  return new Promise(done => {
    const end = answer => { dialog.close(); done(answer); };
    document.getElementById("ask-yes").onclick = () => end(true);
    document.getElementById("ask-no").onclick = () => end(false);
    dialog.oncancel = () => done(false);
  });
}

/** A word as a shell takes it. */
export const quoted = word => /^[\w\-./:=+,@%]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
export function command(text) { document.getElementById("command").textContent = text; }
export function node(id = state.model) { return state.about?.models.find(m => m.id === id) || null; }

/** What a model is called: what was added, or how it was made; the later ones of a name are numbered in the order in which they were made. */
export function modelName(m) {
  if (!m) return "";
  const alike = (state.about?.models || []).filter(o => made(o) === made(m)).map(o => o.id).sort();
  const at = alike.indexOf(m.id);
  return made(m) + (at > 0 ? ` (${at + 1})` : "");
}

function made(m) {
  if (m.id === "study") return "the study as it stands";
  if (m.verb === "add" && m.added) return `+ ${effectName(m.added)}`;
  if (m.verb === "ladder") return `ladder${m.stopped ? ", stopped" : ""}: ` + found(m);
  return m.verb;
}
/** An effect with its place; a law over a condition with the parameter and the condition, since several may act at one place. */
export const effectName = e => `${e.effect} at ${e.at}${e.of ? ` (${e.of})` : ""}`;
/** What a ladder has found; one that was stopped with nothing has not said that nothing is missing. */
export const found = m => (m.missing || []).map(effectName).join(", ") || (m.stopped || m.interrupted ? "nothing added yet" : (m.verdict || "").replaceAll("_", " "));
export const runTime = id => /^\d{8}-\d{6}/.test(id) ? `${id.slice(0, 4)}-${id.slice(4, 6)}-${id.slice(6, 8)} ${id.slice(9, 11)}:${id.slice(11, 13)}` : "";

/** A model as it was chosen keeps its place in the address, so that a page that is reloaded shows it again. */
export function remember() {
  const hash = new URLSearchParams({ study: state.study, model: state.model, view: state.view });
  if (state.detail) hash.set("test", state.detail);
  if (state.beside) hash.set("beside", state.beside);
  history.replaceState(null, "", "/#" + hash);
}
