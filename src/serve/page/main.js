// The page: studies, views, the model that is shown, events of the server.
import { state, el, api, of, on, emit, attempt, say, command, node, modelName, effectName, quoted, percent, digits, remember } from "./core.js";
import { load } from "./compare.js";
import "./structure.js";
import "./parameters.js";
import { run, event, settle } from "./models.js";
import "./new.js";

// The token is in the cookie now; in the address it would be seen and kept.
const hash = new URLSearchParams(location.hash.slice(1));
if (location.search) history.replaceState(null, "", "/" + location.hash);

const views = ["compare", "structure", "parameters", "ladder", "models", "new"];
const tabs = views.map(v => document.getElementById("tab-" + v));

function show(view) {
  state.view = !state.study ? "new" : views.includes(view) ? view : "compare";
  for (const v of views) {
    const chosen = v === state.view, tab = document.getElementById("tab-" + v);
    document.getElementById("view-" + v).hidden = !chosen;
    tab.setAttribute("aria-selected", chosen);
    tab.tabIndex = chosen ? 0 : -1;
  }
  if (state.study) remember();
  suggest();
}
tabs.forEach((tab, k) => {
  tab.addEventListener("click", () => show(tab.dataset.view));
  tab.addEventListener("keydown", e => {
    const to = { ArrowRight: k + 1, ArrowLeft: k - 1, Home: 0, End: tabs.length - 1 }[e.key];
    if (to === undefined) return;
    const next = tabs[(to + tabs.length) % tabs.length];
    show(next.dataset.view); next.focus(); e.preventDefault();
  });
});

/** The command line of what is shown, as long as nothing was set going. */
function suggest() {
  if (!state.about || state.view === "new" || (state.job && !state.job.ended)) return;
  const own = state.studies.find(s => s.id === state.study)?.path, path = state.model === "study" ? own : `${state.about.study.runs}/${state.model}`;
  // Scores are about the fit of the model, wherever its sliders stand.
  const starts = state.view === "structure" ? "" : moved().map(s => ` --start ${quoted(s)}`).join("");
  command(`misfit ${{ compare: "compare", structure: "diagnose", parameters: "fit", ladder: "ladder", models: "report" }[state.view]} ${quoted(path)}${state.view === "structure" ? " --scores" : ""}${starts}${state.about.study.options}`);
}

/** The values that sliders were moved to, as `--start` takes them. */
function moved() {
  const all = state.described?.parameters || [];
  return all.filter(p => p.key in state.values).map(p => `${p.name}=${+(state.values[p.key] / (p.factor || 1)).toPrecision(12)} ${p.unit}`.trim());
}
on("values", suggest);

let source = null;
async function openStudy(id, model, view) {
  state.study = id; state.model = "study"; state.about = null; state.described = null; state.tests = []; state.job = null; state.exported = null; state.place = null; state.before = null;
  document.getElementById("study").value = id;
  // Nothing of the study before is this one's: it may turn out that its data cannot be read.
  source?.close();
  emit("about");
  const study = state.studies.find(s => s.id === id);
  command(`misfit check ${quoted(study.path)}${study.options}`);
  readable(true);
  say("Reading the study …");
  await attempt(async () => {
    state.about = await api(of(""));
    const running = state.about.jobs.find(j => !j.ended);
    if (running) { state.job = running; command(running.command); }
    if (model && node(model)) state.model = model;
    document.title = `${state.about.study.title} - misfit`;
    listen();
    emit("about");
    show(view);
    await showModel();
  });
  if (state.study === id && !state.tests.length) readable(false);
}

/** What shows or computes a model, where its data can be read; else the line that answers says why not. */
function readable(yes) {
  for (const id of ["do-fit", "do-score"]) document.getElementById(id).disabled = !yes;
  for (const tab of tabs) if (tab.dataset.view !== "new") tab.disabled = !yes;
  if (!yes) for (const v of views) if (v !== "new") document.getElementById("view-" + v).replaceChildren();
}

function listen() {
  source?.close();
  source = new EventSource(`/api/${of("events")}`);
  let lost = false;
  source.onmessage = m => event(JSON.parse(m.data));
  source.onerror = () => { lost = true; };
  // A server that was started again knows the runs; a job that it did not survive is told as it stands.
  source.onopen = () => { if (lost) { lost = false; state.job = null; refresh().then(showModel); } };
}

let refreshing = null, stale = false;
/** The tree and the jobs as they are now; what is asked meanwhile is asked once more at the end. */
function refresh() {
  if (refreshing) { stale = true; return refreshing; }
  refreshing = look().finally(() => { refreshing = null; if (stale) { stale = false; refresh(); } });
  return refreshing;
}

async function look() {
  await attempt(async () => {
    const about = await api(of(""));
    if (about.study.id !== state.study) return;
    state.about = about;
    const running = about.jobs.find(j => !j.ended);
    if (running && state.job?.id !== running.id) { state.job = running; command(running.command); }
    const known = about.jobs.find(j => j.id === state.job?.id);
    if (known?.ended) settle(known.ended);
    if (!node()) { state.model = "study"; await showModel(); }
    emit("about");
  });
}

async function showModel() {
  remember();
  await attempt(async () => {
    const model = state.model;
    await Promise.all([load(), api(of(`models/${model}`)).then(d => { if (model === state.model) { state.described = d; emit("described"); } })]);
    emit("about");
    readable(true);
    suggest();
  });
}

on("reload", () => refresh().then(showModel));
on("reload-tree", () => refresh());
/** What is known of the model that is shown, its curves as they are. */
on("reload-model", () => attempt(async () => { state.described = await api(of(`models/${state.model}`)); emit("described"); }));
on("view", show);
on("go", async ({ model, from, verb }) => {
  if (!state.about.models.some(m => m.id === model)) await refresh();
  state.model = model;
  await showModel();
  const now = node();
  if (verb === "add" && from && now?.errors?.fit) {
    const before = now.before || from.errors?.fit;
    say(`Added ${effectName(now.added)}: the error on the fit tests ${before ? `went from ${percent(before.error)} to` : "is now"} ${percent(now.errors.fit.error)} (${digits(now.errors.fit.error / now.errors.fit.floor, 3)} × floor)${now.errors.select ? `, on the select tests it is ${percent(now.errors.select.error)} (${digits(now.errors.select.error / now.errors.select.floor, 3)} × floor)` : ""}. ${now.errors.fit.error > 1.3 * now.errors.fit.floor ? "More than the noise is left. " : ""}Undo goes back.`);
  }
});

/** The studies that can be opened, and whether new ones can be made. */
function list(studies) {
  state.studies = studies.studies; state.folder = studies.folder;
  document.getElementById("study").replaceChildren(...state.studies.map(s => el("option", { value: s.id }, within(s))));
  emit("studies");
}

/** A study by its way from the folder that is served; one that is served alone by its name. */
const within = ({ id, path }) => state.folder && path.startsWith(state.folder) ? path.slice(state.folder.length).replace(/^[\\/]+/, "") : id;

/** What needs a study. */
function able(yes) {
  document.getElementById("study").disabled = !yes;
  document.getElementById("study").parentElement.hidden = !yes;
  readable(yes);
}

/** A folder without a study: the first one is made here. */
function none() {
  able(false);
  show("new");
  say("There is no study in this folder yet: drop the files of a test bench to make one.");
}

on("saved", () => attempt(async () => { list(await api("studies")); document.getElementById("study").value = state.study; emit("about"); }));
on("open-study", id => { state.beside = null; openStudy(id, null, "compare"); });
on("written", async ({ study, told, line }) => {
  await attempt(async () => {
    list(await api("studies"));
    able(true);
    const old = document.getElementById("answer").textContent;
    state.beside = null;
    await openStudy(study, null, "compare");
    const now = document.getElementById("answer");
    command(line);
    // What cannot be read yet has been said; what can is told first how it came about.
    if (now.textContent !== old) say(`${told} ${now.textContent}`, now.classList.contains("bad"));
  });
});

document.getElementById("study").addEventListener("change", e => { state.beside = null; openStudy(e.target.value, null, state.view === "new" ? "compare" : state.view); });
document.getElementById("undo").addEventListener("click", () => { const parent = node()?.parent; if (parent) emit("go", { model: parent }); });
document.getElementById("do-fit").addEventListener("click", () => run({ verb: "fit" }));
document.getElementById("do-score").addEventListener("click", () => { show("structure"); run({ verb: "score" }); });
document.getElementById("copy").addEventListener("click", () => navigator.clipboard?.writeText(document.getElementById("command").textContent));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => emit("tests"));

await attempt(async () => {
  const [studies, style] = await Promise.all([api("studies"), api("style")]);
  state.style = style; state.detail = hash.get("test"); state.beside = hash.get("beside");
  list(studies);
  const wanted = hash.get("study");
  if (state.studies.length) await openStudy(state.studies.some(s => s.id === wanted) ? wanted : state.studies[0].id, hash.get("model"), hash.get("view") || "compare");
  else none();
});
document.documentElement.dataset.ready = "true";
