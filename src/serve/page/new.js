// New: files that are dropped here, what is found in them, to be confirmed or corrected by eye, and the study that is made of them.
import { state, el, svg, api, send, on, emit, ask, say, digits, failureText } from "./core.js";

const view = document.getElementById("view-new");
const ROLES = ["time", "displacement", "velocity", "acceleration", "force"];
const QUANTITIES = ["receptance", "mobility", "accelerance"];
const KINDS = ".csv,.txt,.tsv,.dat,.asc,.parquet,.pq,.uff,.unv,.uf,.mat";

let basket = null, looked = null, busy = "";
/** What the reader corrects, by file and thing; and the files that were confirmed. */
let corrections = new Map(), confirmed = new Set(), name = "";

const said = () => [...corrections.values()];

async function take(files) {
  if (!files.length) return;
  try {
    basket ??= (await api("baskets", {})).basket;
    for (const [k, f] of [...files].entries()) {
      busy = `Reading ${f.name}, ${k + 1} of ${files.length} …`;
      draw();
      const { file } = await api(`baskets/${basket}`, { name: f.name, bytes: f.size });
      await send(`files/${basket}/${file}`, f);
      confirmed.delete(f.name);
      for (const key of [...corrections.keys()]) if (corrections.get(key).file === f.name) corrections.delete(key);
    }
    await look();
  } catch (e) { failed(e); }
  busy = "";
  draw();
}

function failed(e) {
  // The server has been started again, or other pages have dropped files since.
  if (e.where === "basket") { basket = null; looked = null; corrections.clear(); confirmed.clear(); }
  say(e.message, true);
}

async function look() {
  looked = await api("look", { basket, corrections: said() });
  const tests = looked.files.length;
  say(`${tests} ${tests === 1 ? "file" : "files"} read. Look at each: are channels, units, cycles and start-up right? What is not can be changed here.`);
}

/** Changes what was found; a change that is refused is taken back. */
async function correct(file, item, change) {
  const key = `${file} ${item}`, old = corrections.get(key), now = old || { file, item };
  corrections.set(key, { ...now, ...change, columns: { ...now.columns, ...change.columns } });
  try { await look(); } catch (e) {
    if (old) corrections.set(key, old); else corrections.delete(key);
    failed(e);
  }
  const focus = document.activeElement?.id;
  draw();
  if (focus) document.getElementById(focus)?.focus();
}

const range = values => values.reduce(([a, b], v) => Number.isFinite(v) ? [Math.min(a, v), Math.max(b, v)] : [a, b], [Infinity, -Infinity]);

function frame(x, y, W, H) {
  const [x0, x1] = range(x), [y0, y1] = range(y);
  return { X: v => 4 + (W - 8) * (v - x0) / ((x1 - x0) || 1), Y: v => H - 4 - (H - 8) * (v - y0) / ((y1 - y0) || 1), x0, x1, y0, y1 };
}

const line = (x, y, f, c) => svg("path", { class: c, d: x.map((v, k) => `${k ? "L" : "M"}${f.X(v).toFixed(1)} ${f.Y(y[k]).toFixed(1)}`).join("") });

/** A column over the time; the start-up is shaded, and every cycle begins at a mark. */
function record(curve, item, unit) {
  const W = 460, H = 84, f = frame(curve.x, curve.y, W, H), { from, period, time_unit } = item.plot;
  const marks = [];
  if (period) {
    const end = from + item.start_up_cycles * period;
    if (item.start_up_cycles) marks.push(svg("rect", { class: "startup", x: f.X(from), y: 0, width: Math.max(0, f.X(end) - f.X(from)), height: H }));
    if (item.cycles <= 60) for (let k = 0; k <= item.cycles; k++) marks.push(svg("line", { class: "tick", x1: f.X(from + k * period), x2: f.X(from + k * period), y1: H - 8, y2: H }));
  }
  return el("figure", {}, svg("svg", { class: "thumb record", viewBox: `0 0 ${W} ${H}`, preserveAspectRatio: "none", role: "img", "aria-label": `${curve.column} over time` }, ...marks, line(curve.x, curve.y, f, "measured")),
    el("figcaption", {}, `${curve.column}: ${digits(f.y0, 4)} to ${digits(f.y1, 4)} ${unit || "(unit not given)"}, from ${digits(f.x0, 3)} to ${digits(f.x1, 4)} ${time_unit || "s"}`));
}

function loop(plot, units) {
  const W = 240, H = 200, x = [...plot.x, plot.x[0]], y = [...plot.y, plot.y[0]];
  return el("figure", { class: "loop" }, svg("svg", { class: "thumb loop", viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": "settled loop" }, line(x, y, frame(x, y, W, H), "measured")),
    el("figcaption", {}, `Settled loop, mean of ${plot.cycles} cycles: force ${units.force ? `[${units.force}]` : ""} over displacement ${units.displacement ? `[${units.displacement}]` : ""}`));
}

const options = (words, chosen) => words.map(w => el("option", { value: w, selected: w === chosen }, w || "not used"));

const short = v => String(+digits(v, 5));

/** A field with a label of its own in a table; empty, it has to be filled. */
function field(id, label, value, change) {
  return el("input", { type: "text", id, "aria-label": label, "aria-invalid": value ? null : "true", placeholder: "missing", value: value ?? "", onchange: e => change(e.target.value.trim()) });
}

function channels(file, k, item, id, roles) {
  const row = (c, n) => el("tr", {}, el("th", { scope: "row" }, c.column),
    el("td", {}, roles ? el("select", { id: `${id}-role-${n}`, "aria-label": `Role of ${c.column}`, onchange: e => correct(file, k, { columns: { [c.column]: { ...corrections.get(`${file} ${k}`)?.columns?.[c.column], role: e.target.value } } }) }, ...options(["", ...ROLES], c.role || "")) : c.role),
    el("td", {}, c.role === "coherence" ? null : field(`${id}-unit-${n}`, `Unit of ${c.column}`, c.unit, unit => correct(file, k, { columns: { [c.column]: { ...corrections.get(`${file} ${k}`)?.columns?.[c.column], unit } } }))),
    el("td", { class: "n" }, c.min === undefined ? "" : `${digits(c.min, 4)} to ${digits(c.max, 4)}`));
  return el("table", {}, el("thead", {}, el("tr", {}, ...["Column", "Channel", "Unit", roles ? "Values" : ""].map(h => el("th", { scope: "col" }, h)))), el("tbody", {}, ...item.channels.map(row)));
}

function history(file, k, item, id) {
  const units = Object.fromEntries(item.channels.filter(c => c.role).map(c => [c.role, c.unit]));
  const unit = column => item.channels.find(c => c.column === column)?.unit;
  const cycles = item.cycles ? el("p", { class: "buttons" },
    el("span", {}, `${item.cycles} cycles of ${short(item.frequency_hz)} Hz`),
    el("label", {}, "Start-up ", el("input", { type: "number", id: `${id}-start`, min: 0, max: item.cycles - 1, step: 1, value: item.start_up_cycles, onchange: e => correct(file, k, { start_up: Math.max(0, Math.round(+e.target.value) || 0) }) }), " cycles"),
    el("label", {}, "Control ", el("select", { id: `${id}-control`, onchange: e => e.target.value && correct(file, k, { control: e.target.value }) },
      // What was not recognised is an assumption until the reader says so.
      ...(item.control_recognised ? options(["displacement", "force"], item.control) : [el("option", { value: "" }, `${item.control}, assumed`), ...options(["displacement", "force"])])))) : el("p", { class: "soft" }, "No cycles: a transient history.");
  return el("div", { class: "found" },
    el("div", { class: "looks" }, ...item.plot.curves.map(c => record(c, item, unit(c.column))), item.plot.loop ? loop(item.plot.loop, units) : null),
    el("div", { class: "says" }, el("p", { class: "soft" }, `${item.samples} samples, ${short(item.rate_hz)} Hz, ${short(item.seconds)} s`), cycles, channels(file, k, item, id, true), ...item.findings.map(f => el("p", { class: "warn" }, f))));
}

function frf(file, k, item, id) {
  const { frequency, magnitude } = item.plot, W = 460, H = 130;
  const good = frequency.map((f, i) => [f, magnitude[i]]).filter(p => p[0] > 0 && p[1] > 0);
  const x = good.map(p => p[0]), y = good.map(p => Math.log10(p[1]));
  const place = p => p ? p.replace(":", ".").replace(/[+-]/, "") : "";
  const unit = item.channels.find(c => c.role === "real" || c.role === "amplitude")?.unit;
  return el("div", { class: "found" },
    el("div", { class: "looks" }, el("figure", {}, svg("svg", { class: "thumb record", viewBox: `0 0 ${W} ${H}`, preserveAspectRatio: "none", role: "img", "aria-label": "magnitude over frequency" }, good.length ? line(x, y, frame(x, y, W, H), "measured") : null),
      el("figcaption", {}, `Magnitude, logarithmic${unit ? ` [${unit}]` : ", unit not given"}, ${item.lines} lines from ${short(item.from_hz)} to ${short(item.to_hz)} Hz`))),
    el("div", { class: "says" }, el("p", { class: "buttons" }, el("label", {}, "Quantity ", el("select", { id: `${id}-quantity`, onchange: e => e.target.value && correct(file, k, { quantity: e.target.value }) }, ...(item.quantity ? [] : [el("option", { value: "" }, "not given")]), ...options(QUANTITIES, item.quantity))),
      el("label", {}, "Response at ", field(`${id}-respond`, "Place of the response, node.axis", place(item.respond), respond => correct(file, k, { respond }))), el("label", {}, "Force at ", field(`${id}-excite`, "Place of the force, node.axis", place(item.excite), excite => correct(file, k, { excite }))),
      item.channels.some(c => c.role === "coherence") ? el("label", {}, "Averages ", el("input", { type: "number", id: `${id}-averages`, min: 1, step: 1, value: corrections.get(`${file} ${k}`)?.averages ?? "", onchange: e => +e.target.value >= 1 && correct(file, k, { averages: Math.round(+e.target.value) }) })) : null),
      channels(file, k, item, id, false), ...item.findings.map(f => el("p", { class: "warn" }, f))));
}

function thing(file, k, item, id) {
  if (item.what === "cycle" || item.what === "transient") return history(file, k, item, id);
  if (item.what === "frf") return el("div", {}, item.record ? el("h3", {}, item.record) : null, frf(file, k, item, id));
  if (item.what === "modal") return el("p", {}, `Modes: ${item.modes.map(m => `${digits(m.frequency_hz, 5)} Hz`).join(", ")}`);
  if (item.what === "backbone") return el("p", {}, `Backbone, ${item.rows} rows: ${item.channels.map(c => `${c.column} is the ${c.role}${c.guessed ? " (a guess)" : ""}, ${digits(c.min, 4)} to ${digits(c.max, 4)} ${c.unit || "(unit not given)"}`).join("; ")}`);
  return el("p", { class: "soft" }, item.text);
}

function fileCard(f, n) {
  const tests = f.items.filter(i => i.what !== "other").length;
  const box = el("input", { type: "checkbox", id: `new-${n}-ok`, checked: confirmed.has(f.name), onchange: e => { e.target.checked ? confirmed.add(f.name) : confirmed.delete(f.name); draw(); document.getElementById(`new-${n}-ok`)?.focus(); } });
  return el("section", { class: "file" + (confirmed.has(f.name) ? " good" : "") }, el("div", { class: "large-head" }, el("h2", {}, f.name), tests ? el("label", {}, box, " as it should be") : el("span", { class: "warn" }, "no test in it")),
    ...f.items.map((item, k) => thing(f.name, k, item, `new-${n}-${k}`)));
}

async function write(e) {
  e.preventDefault();
  const open = looked.files.filter(f => !confirmed.has(f.name)).map(f => f.name);
  if (open.length && !await ask(`Not confirmed yet: ${open.slice(0, 5).join(", ")}${open.length > 5 ? ` and ${open.length - 5} more` : ""}. Write the study all the same?`)) return;
  try {
    const done = await api("new", { basket, corrections: said(), name });
    const told = `Written: ${state.folder}/${done.study}, with ${done.to_confirm.length ? `${done.to_confirm.length} lines to confirm in its dataset.toml and study.toml` : "nothing left to confirm"}.`;
    basket = null; looked = null; name = ""; corrections = new Map(); confirmed = new Set();
    draw();
    if (done.problem) say(`${told} It cannot be read yet: ${failureText(done.problem)}`, true);
    emit("written", { study: done.study, told, line: done.command });
  } catch (error) { failed(error); }
}

function found() {
  const all = looked.files.every(f => confirmed.has(f.name));
  const input = el("input", { type: "text", id: "new-name", pattern: "[A-Za-z0-9_\\-]{1,60}", maxlength: 60, required: true, placeholder: "mount-A", value: name, oninput: e => { name = e.target.value; } });
  return [...looked.files.map(fileCard),
    ...looked.left_out.map(l => el("p", { class: "warn" }, `Left out: ${failureText(l)}`)),
    looked.to_confirm?.length ? el("div", {}, el("h2", {}, "To confirm in the files that are written"), el("ul", {}, ...looked.to_confirm.map(l => el("li", {}, l)))) : null,
    looked.problem ? el("p", { class: "note" }, el("b", {}, "Still wrong: "), failureText(looked.problem)) : null,
    looked.dataset ? el("details", {}, el("summary", {}, "dataset.toml and study.toml as they will be written"), el("pre", { class: "log", tabindex: 0, "aria-label": "dataset.toml" }, looked.dataset), el("pre", { class: "log", tabindex: 0, "aria-label": "study.toml" }, looked.study)) : null,
    looked.dataset ? el("form", { class: "save", onsubmit: write }, el("h2", {}, "Write the study"), el("p", { class: "soft" }, `A folder of this name in ${state.folder}: the files, a dataset.toml as above, and a model to begin with.`),
      el("p", { class: "buttons" }, el("label", {}, "Name ", input), el("button", { type: "submit", class: "main" }, "Write the study"), all ? null : el("button", { type: "button", onclick: () => { looked.files.forEach(f => confirmed.add(f.name)); draw(); } }, "All files are as they should be"))) : el("p", { class: "note" }, "No test was found: it takes a history with a channel that drives and one that answers, an FRF, or a table of modes.")];
}

function draw() {
  if (!state.folder) {
    view.replaceChildren(el("p", { class: "note" }, "One study is served here, and a new one has no place beside it. Start the workbench on the folder that holds your studies: ", el("code", {}, "misfit serve FOLDER"), "."));
    return;
  }
  const input = el("input", { type: "file", id: "new-files", multiple: true, accept: KINDS, onchange: e => take(e.target.files) });
  const zone = el("label", { class: "drop", ondragover: e => { e.preventDefault(); zone.classList.add("over"); }, ondragleave: () => zone.classList.remove("over"), ondrop: e => { e.preventDefault(); take(e.dataTransfer.files); } },
    el("b", {}, "Drop the files of a test bench here, or choose them"), el("span", { class: "soft" }, "histories of force and displacement, FRFs, mode shapes: csv, txt, tsv, dat, asc, parquet, uff, unv, mat; up to 128 MB each"), input);
  view.replaceChildren(zone, busy ? el("p", { "aria-live": "polite" }, busy) : "", ...(looked ? found().filter(Boolean) : []));
}

// A file that misses the zone is not opened in place of the page.
for (const kind of ["dragover", "drop"]) window.addEventListener(kind, e => e.preventDefault());
on("studies", draw);
