// Models: the tree, work under way, the ladder, saving.
import { state, el, svg, of, api, on, emit, attempt, percent, digits, say, command, node, modelName, effectName, found, runTime, failureText, splitWords } from "./core.js";
import { move, restore, visibleTests } from "./compare.js";
import { thumb } from "./plots.js";

const tree = document.getElementById("tree"), jobBox = document.getElementById("job");
const models = document.getElementById("view-models"), ladder = document.getElementById("view-ladder");

/** Starts a verb on the model that is shown. */
export async function run(order) {
  await attempt(async () => {
    // Scores are about the fit of the model; a run that is gone on with has its own values.
    const values = ["score", "resume"].includes(order.verb) ? {} : state.values;
    const begun = await api(of("run"), { model: state.model, values, ...order });
    command(begun.command);
    state.job = { id: begun.job, verb: begun.verb, model: begun.model, lines: [], cost: [], ended: null, order };
    drawJob();
    if (order.verb === "ladder") drawLadder();
    // A job that fails at once may have ended before this page knew its number.
    emit("reload-tree");
  });
}

/** It ends within a step of the model, which may take seconds: until then the page says so. */
export const stop = () => {
  if (!state.job) return;
  state.job.stopping = true;
  drawJob();
  if (state.view === "ladder") drawLadder();
  attempt(() => api(of("stop"), { job: state.job.id }));
};
const stopButton = words => el("button", { type: "button", disabled: !!state.job.stopping, onclick: stop }, state.job.stopping ? "Stopping after this step …" : words);

let drawing = false, picture = null;
/** The worst test, followed while a fit runs. */
function follow() {
  const worst = [...visibleTests()].sort((a, b) => b.error / b.floor - a.error / a.floor)[0];
  return worst || null;
}

export function event(e) {
  if (e.type === "tree") return emit("reload-tree");
  const job = state.job;
  if (!job || job.id !== e.job) return emit("reload-tree");
  if (e.type === "line") job.lines.push(e.line);
  if (e.type === "cost") job.cost.push(e.cost);
  if (e.type === "point") {
    const shown = state.view === "compare" ? visibleTests().map(t => t.id) : [follow()?.id].filter(Boolean);
    if (shown.length && node() && job.model === state.model) move("job:" + job.id, {}, shown);
  }
  if (e.type === "end") settle(e.ended);
  if (!drawing) { drawing = true; requestAnimationFrame(() => { drawing = false; drawJob(); if (state.view === "ladder") drawLadder(); }); }
}

/** The end of the job, once: by its event, or by the state of the study, whichever is read first. */
export function settle(end) {
  if (!state.job || state.job.ended) return;
  state.job.ended = end;
  ended(state.job);
}

async function ended(job) {
  const end = job.ended;
  if (job.model === state.model && !["add", "fit", "ladder"].includes(job.verb) || end.status === "failed") restore();
  if (end.status === "failed") { say(`${job.verb}: ${failureText(end.error)}`, true); return; }
  if (job.verb === "score") { if (end.result?.candidates && state.described && job.model === state.model) { state.described.scored = end.result.candidates; emit("described"); emit("view", "structure"); if (end.status === "done") scored(end.result); } return; }
  if (job.verb === "profile" && end.result) { emit("reload-model"); return; }
  if (end.result?.beside_failed) say(`The second effect: ${failureText(end.result.beside_failed)}`, true);
  if (end.result?.beside) { state.beside = end.result.beside; emit("view", "compare"); }
  if (job.verb === "export" && end.result) { state.exported = end.result; drawModels(); return; }
  if (end.result?.model) { const old = node(job.model); emit("go", { model: end.result.model, from: old, verb: job.verb }); }
}

/** What the scores come to, and the error of the fit that they are about, which need not be a model of the tree. */
function scored({ candidates, errors }) {
  const worth = candidates.filter(m => m.promises).length;
  const told = ["fit", "select", "held_out"].filter(s => errors?.[s]).map(s => `${ratio(errors[s])} on the ${splitWords[s]} tests`).join(", ");
  say(`${worth ? `${worth} of ${candidates.length} candidates ${worth === 1 ? "is" : "are"} worth a refit.` : "Nothing is worth a refit: no effect may gain as much as it costs."} All were scored about the fit of this model, whose error is ${told}${state.model === "study" ? "; the curves are those of the starting values" : ""}.`);
}

function drawJob() {
  const job = state.job;
  // One work at a time on a study.
  for (const id of ["do-fit", "do-score"]) document.getElementById(id).disabled = !!job && !job.ended;
  if (!job) { jobBox.replaceChildren(); return; }
  const running = !job.ended, failed = job.ended?.error;
  const recent = job.cost.slice(-300);
  let chart = null;
  if (recent.length > 1) {
    const log = recent.map(c => Math.log10(Math.max(c, 1e-300)));
    const low = Math.min(...log), high = Math.max(...log);
    chart = svg("svg", { class: "thumb cost", viewBox: "0 0 220 60", role: "img", "aria-label": "cost over iterations" },
      svg("path", { class: "computed", d: log.map((v, k) => `${k ? "L" : "M"}${(4 + 212 * k / (log.length - 1)).toFixed(1)} ${(56 - 52 * (v - low) / ((high - low) || 1)).toFixed(1)}`).join("") }));
  }
  const test = running && state.view !== "compare" ? follow() : null;
  if (test && picture?.id !== test.id) picture = { id: test.id, ...thumb(test.curves[0]) };
  jobBox.replaceChildren(el("div", { class: "job" + (running ? " running" : "") }, el("h2", {}, running ? `${job.verb} is running` : `${job.verb}: ${job.ended.status} after ${job.ended.seconds.toFixed(1)} s`),
    el("p", { class: failed ? "line warn" : "line", "aria-live": "polite" }, running ? job.lines.at(-1) || "begins" : failed ? failureText(failed) : ""), chart, recent.length ? el("p", { class: "soft" }, `cost ${digits(recent[recent.length - 1], 5)}`) : null,
    test ? el("div", { class: "panel" }, picture.node, el("span", { class: "soft" }, test.id)) : null,
    running ? stopButton("Stop") : null, job.ended?.status === "stopped" && job.ended.result?.model ? goOn(job.ended.result.model) : null));
}
on("moved", t => { if (picture?.id === t.id) picture.update(t.curves[0].computed); });

/** Goes on with a run that was stopped or killed. */
const goOn = id => el("button", { type: "button", onclick: () => run({ verb: "resume", model: "study", resume: id }) }, "Go on");

const ratio = e => e ? `${percent(e.error)} (${digits(e.error / e.floor, 2)} × floor)` : "-";

function drawTree() {
  const all = state.about?.models || [];
  const below = parent => all.filter(m => m.parent === parent);
  const branch = m => el("li", {}, el("button", { type: "button", class: "node" + (m.id === state.model ? " chosen" : ""), "aria-current": m.id === state.model ? "true" : null, onclick: () => emit("go", { model: m.id }) },
    el("b", {}, modelName(m)), el("span", { class: "soft" }, [runTime(m.id), m.errors?.fit ? `fit ${percent(m.errors.fit.error)}` : "", m.errors?.select ? `select ${percent(m.errors.select.error)}` : ""].filter(Boolean).join(", "))),
    below(m.id).length ? el("ul", {}, ...below(m.id).map(branch)) : null);
  tree.replaceChildren(el("ul", { class: "tree" }, ...all.filter(m => !m.parent).map(branch)));
  const now = node();
  document.getElementById("model-name").textContent = modelName(now);
  document.getElementById("undo").disabled = !now?.parent;
}

function drawModels() {
  const row = m => el("tr", { class: m.id === state.model ? "chosen" : null },
    el("th", { scope: "row" }, el("button", { type: "button", class: "link", onclick: () => emit("go", { model: m.id }) }, modelName(m)), el("div", { class: "soft" }, m.id)),
    ...["fit", "select", "held_out"].map(s => el("td", {}, ratio(m.errors?.[s]))),
    el("td", {}, m.id === "study" ? "not fitted" : m.termination || "", m.verb === "ladder" && m.verdict && !m.stopped ? ` ${m.verdict.replaceAll("_", " ")}` : "", m.stopped ? [" ", goOn(m.id)] : ""),
    el("td", {}, m.id === "study" ? "" : ["report.html", "study.toml", "result.json", "residuals.parquet"].flatMap(f => [el("a", { href: `/api/${of("runs")}/${m.id}/${f}`, target: "_blank", rel: "noopener" }, f), " "])));
  const name = el("input", { type: "text", id: "save-name", pattern: "[A-Za-z0-9_\\-]{1,64}", maxlength: 64, required: true, title: "letters, digits, - and _, at most 64", placeholder: "with-friction", "aria-label": "Name of the study" });
  const save = async e => {
    e.preventDefault();
    await attempt(async () => { const done = await api(of("save"), { model: state.model, name: name.value }); command(done.command); say(`Saved as ${done.file}: your study.toml with its comments, ${done.moved ? "the values of this model" : "its own values"}, and ${done.added.map(effectName).join(", ") || "nothing added"}.${done.kept.length ? ` Not written in that file, and therefore as they were: ${done.kept.join(", ")}.` : ""} It can be opened at the top of the page.`); emit("saved"); });
  };
  const file = state.about.study.file;
  models.replaceChildren(el("div", { class: "scroll" }, el("table", {}, el("thead", {}, el("tr", {}, ...["Model", "Fit", "Select", "Held out", "Ended", "Files of its run"].map(h => el("th", { scope: "col" }, h)))), el("tbody", {}, ...[...state.about.models].sort((a, b) => (a.parent ? 1 : 0) - (b.parent ? 1 : 0) || (a.id < b.id ? 1 : -1)).map(row)))),
    el("form", { class: "save", onsubmit: save }, el("h2", {}, "Save this model as a study"), el("p", { class: "soft" }, `A copy of ${file} with its comments, with the values of this model and the effects that were added, beside it, under this name.`),
      el("label", {}, "Name ", name), " ", el("button", { type: "submit" }, "Save")),
    ...saved(),
    el("h2", {}, "Export this model"), el("p", { class: "buttons" }, ...["json", "csv", "parquet", "adams", "exudyn"].map(f => el("label", {}, el("input", { type: "checkbox", class: "format", value: f, checked: f === "json" || f === "csv" }), " " + f)),
      el("button", { type: "button", onclick: () => { const to = [...models.querySelectorAll("input.format:checked")].map(i => i.value); to.length ? run({ verb: "export", to }) : say("Choose a format.", true); } }, "Export")),
    state.exported ? el("p", {}, "Written: ", ...state.exported.files.flatMap(f => { const name = f.split(/[\\/]/).pop(); return [el("a", { href: `/api/${of("runs")}/${state.exported.run}/${name}`, target: "_blank", rel: "noopener" }, name), " "]; }), ...state.exported.notes.map(n => el("span", { class: "soft" }, n + "; "))) : "",
    ...unfinished());
}

/** The other studies of this folder, those that were saved here among them. */
function saved() {
  const others = state.studies.filter(s => s.id !== state.study && s.path.startsWith(state.about.study.folder));
  if (!others.length) return [];
  return [el("h2", {}, "Studies beside this one"), el("ul", {}, ...others.map(s => el("li", {}, el("button", { type: "button", class: "link", onclick: () => emit("open-study", s.id) }, s.path))))];
}

/** Runs that were killed, each with what can be done. */
function unfinished() {
  const all = state.about.unfinished;
  if (!all.length) return [];
  return [el("h2", {}, "Runs without a result"), el("p", { class: "soft" }, "They were killed, or another program is at work on them. A fit goes on from its best state, a ladder from its last rung; the others begin again."),
    el("ul", { class: "unfinished" }, ...all.map(u => el("li", {}, u.id, " ", u.goes_on ? goOn(u.id) : el("span", { class: "soft" }, "nothing of it was kept"))))];
}

function drawLadder() {
  const job = state.job?.verb === "ladder" ? state.job : null;
  const done = state.about.models.filter(m => m.verb === "ladder");
  const shown = done.find(m => m.id === state.model) || done[done.length - 1];
  const held = state.about.study.tests.some(t => t.split === "held_out");
  const parts = [el("p", {}, "The ladder fits the model, scores all effects at all places, refits the best, weighs them, adds what gains most, and takes out what has become superfluous, until nothing gains more than it costs.",
    held ? " At its end it reads the held-out tests: from then on they count as opened. Stopped before it has added anything, it does not read them." : ""),
    el("p", { class: "buttons" }, el("button", { type: "button", class: "main", disabled: !!state.job && !state.job.ended, onclick: () => run({ verb: "ladder" }) }, "Run the ladder from this model"),
      job && !job.ended ? stopButton("Stop and keep what it has") : null)];
  if (job) {
    const added = job.lines.filter(l => /added .* at .*: .* nats/.test(l));
    parts.push(el("h2", {}, job.ended ? "Last ladder" : "Under way"), added.length ? el("ol", {}, ...added.map(l => el("li", {}, l))) : "", el("pre", { class: "log", tabindex: 0, "aria-label": "Progress" }, job.lines.slice(-40).join("\n")));
  }
  if (shown?.rungs) {
    const words = e => e ? effectName(e) : "-";
    const h = shown.held_out;
    parts.push(el("h2", {}, `${shown.interrupted ? "So far" : "Found"}: ${found(shown)}`),
      el("div", { class: "scroll" }, el("table", {}, el("thead", {}, el("tr", {}, ...["Rung", "Added", "Removed", "Nats", "Fit", "Select", "Held out"].map(t => el("th", { scope: "col" }, t)))),
        el("tbody", {}, ...shown.rungs.map((r, k) => el("tr", {}, el("td", {}, String(k)), el("td", {}, words(r.added)), el("td", {}, (r.removed || []).map(words).join(", ") || "-"), el("td", { class: "n" }, Number.isFinite(r.nats) ? digits(r.nats, 3) : "-"), ...["fit", "select", "held_out"].map(s => el("td", {}, ratio(r.errors?.[s])))))))),
      shown.began_with?.length ? el("p", {}, `It began with a model that had ${shown.began_with.map(words).join(", ")} already.`) : "",
      shown.why ? el("p", {}, `${shown.proven ? "Proven" : "Not proven"}: ${shown.why}.`) : "", h?.after ? el("p", {}, `Held-out error: ${percent(h.before)} before, ${percent(h.after)} after, floor ${percent(h.floor)}.`) : "",
      ...(shown.missing || []).filter(m => m.tied_with?.length).map(m => el("p", {}, `${words(m)} cannot be told from ${m.tied_with.join(", ")} by these tests.`)),
      shown.next_test ? el("div", { class: "next-test" }, el("h3", {}, "The next test"), el("p", {}, shown.next_test.describe), el("button", { type: "button", onclick: () => window.print() }, "Print")) : "",
      shown.ended ? el("p", { class: "soft" }, `It ended because ${shown.ended}.`) : "");
  }
  ladder.replaceChildren(...parts);
}

on("about", () => { drawTree(); drawJob(); if (state.about) { drawModels(); drawLadder(); } });
