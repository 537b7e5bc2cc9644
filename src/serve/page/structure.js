// Structure: bodies and connectors, coloured by what each place carries of the misfit; the candidates of a place, and adding one.
import { state, el, svg, of, api, on, emit, attempt, percent, digits } from "./core.js";
import { run } from "./models.js";
import { controls, move, moving, reach } from "./modes.js";

const view = document.getElementById("view-structure");
let open = null;
/** The candidate that another is to be set beside. */
let pair = null;
const demonstrations = new Map();

const marks = () => state.described?.scored || null;
const at = (m, place) => place === null || m.places.includes(place) || (place === "*channels" && m.role === "channel");
/** The largest drop that the score test expects at a place. */
const drop = place => Math.max(0, ...(marks() || []).filter(m => m.places.includes(place) && m.promises).map(m => m.predicted_drop));
/** The largest anywhere: the end of the colour scale; 0 where no effect at a place may gain more than it costs. */
const most = () => Math.max(0, ...(marks() || []).filter(m => m.promises && m.places.length).map(m => m.predicted_drop));

function pick(place) { state.place = state.place === place ? null : place; open = null; draw(); }

/** To a hundredth of a pixel. */
const round = v => Math.round(100 * v) / 100;

function shade(node, part) {
  node.style.setProperty("--heat", `${Math.round(100 * (part && Math.min(1, part / most())))}%`);
}

function picture(d) {
  const bodies = d.bodies, links = d.connectors.filter(c => !c.own), own = d.connectors.filter(c => c.own);
  if (bodies.length > 400) return el("p", { class: "soft" }, `${bodies.length} bodies are too many for a picture; the list below has every place.`);
  const xs = bodies.flatMap(b => b.ends ? b.ends.map(e => e[0]) : [b.x]), ys = bodies.flatMap(b => b.ends ? b.ends.map(e => e[1]) : [b.y]);
  const low = [Math.min(...xs), Math.min(...ys)], span = [Math.max(...xs) - low[0] || 1, Math.max(...ys) - low[1]];
  const flat = !d.spatial;
  const step = flat ? Math.max(64, Math.min(110, 860 / (span[0] + 1))) : 860 / span[0];
  const X = x => 50 + (x - low[0]) * step, Y = y => 46 + (flat ? (y - low[1]) * 70 : (span[1] - (y - low[1])) * step);
  const width = 100 + span[0] * step, height = flat ? 100 + span[1] * 70 : 160 + span[1] * step;
  const chosen = place => state.place === place ? " chosen" : "";
  const button = (places, label, shape, heat) => {
    const place = places.find(p => drop(p) === heat) || places[0];
    const node = svg("g", { class: "place" + (places.includes(state.place) ? " chosen" : ""), role: "button", tabindex: 0,
      "aria-label": `${label}${marks() ? `: expected fall of the cost ${percent(heat)}` : ""}`, "aria-pressed": places.includes(state.place),
      onclick: () => pick(place), onkeydown: e => { if (e.key === "Enter" || e.key === " ") { e.preventDefault(); pick(place); } } },
      svg("title", {}, hover(places, label, heat)), ...shape);
    shade(node, heat);
    return node;
  };
  // What is written on a place stands beside its button: a screen reader says the button's own name, which holds more.
  const labelled = (node, ...texts) => svg("g", {}, node, ...texts);
  const hover = (places, label, heat) => [label, ...d.effects.filter(e => e.places.some(p => places.includes(p))).map(e => `${e.effect} (${e.values.join(", ")})`),
    marks() ? `expected fall of the cost: ${percent(heat)}` : "not scored yet"].join("\n");
  /** In a long chain every third connector is named, above it; the others say their name when they are pointed at. */
  const places = c => links.indexOf(c) % 3 === 0 ? "above" : "";
  const acts = c => d.effects.filter(e => e.places.some(p => c.places.includes(p)));
  // What moves with a mode: each is told where the bodies are.
  const posers = [];
  const shift = (all, body) => { const d = all.get(body); return !d ? [0, 0] : d.ends ? [0.5 * (d.ends[0][0] + d.ends[1][0]), 0.5 * (d.ends[0][1] + d.ends[1][1])] : [d.dx, d.dy]; };
  const nodes = links.map(c => {
    const a = bodies[c.from], b = bodies[c.to];
    const heat = Math.max(0, ...c.places.map(drop));
    let [x1, y1, x2, y2] = [X(a.x), Y(a.y), X(b.x), Y(b.y)];
    let mx = (x1 + x2) / 2, my = (y1 + y2) / 2, lines = [svg("line", { x1, y1, x2, y2, class: "link" })], named = true;
    /** The way of a line that is not straight, its ends moved by (ax, ay) and (bx, by). */
    let bent = null;
    const hangs = d.spatial && (a.fixed || b.fixed);
    if (hangs) {
      // A connector to the ground hangs below its part, its foot where it is.
      const [x, y] = a.fixed ? [x2, y2] : [x1, y1];
      [mx, my] = [x, y + 46];
      bent = (ax, ay, bx, by) => `M${x + ax + bx} ${y + ay + by}L${x} ${y + 82}M${x - 14} ${y + 82}h28`;
      lines = [svg("path", { d: bent(0, 0, 0, 0), class: "link" })];
    } else if (d.spatial && Math.abs(c.from - c.to) > 1) {
      const deep = Math.max(y1, y2) + 90;
      bent = (ax, ay, bx, by) => `M${x1 + ax} ${y1 + ay}Q${mx + 0.5 * (ax + bx)} ${deep + 0.5 * (ay + by)} ${x2 + bx} ${y2 + by}`;
      lines = [svg("path", { d: bent(0, 0, 0, 0), class: "link" })];
      my = 0.25 * y1 + 0.5 * deep + 0.25 * y2;
    } else if (d.spatial) named = links.length <= 14 || places(c);
    const link = lines[0];
    const spot = svg("circle", { cx: mx, cy: my, r: 11, class: "spot" });
    const whole = labelled(button(c.places, c.name, [...lines, spot], heat),
      svg("text", { x: hangs ? mx + 40 : mx, y: hangs ? my + 4 : named === "above" ? my - 16 : my + 27, class: "name over", "aria-hidden": "true" }, named ? c.name : ""), svg("text", { x: mx, y: my + 4, class: "count", "aria-hidden": "true" }, String(acts(c).length)));
    posers.push(all => {
      const [ax, ay] = shift(all, c.from), [bx, by] = shift(all, c.to);
      const [dx, dy] = [0.5 * (ax + bx), 0.5 * (ay + by)];
      // A line follows its ends, all else of the connector the middle between them.
      if (bent) link.setAttribute("d", bent(ax, ay, bx, by));
      else for (const [name, v] of [["x1", x1 + ax], ["y1", y1 + ay], ["x2", x2 + bx], ["y2", y2 + by]]) link.setAttribute(name, v);
      for (const part of [spot, ...[...whole.children].slice(1)]) part.setAttribute("transform", `translate(${round(dx)} ${round(dy)})`);
    });
    return whole;
  });
  const boxes = bodies.map((b, k) => {
    if (d.spatial && b.fixed) return null;
    const connector = own.find(c => c.to === k || c.from === k);
    const places = connector?.places || [];
    const heat = Math.max(0, ...places.map(drop));
    const shape = b.ends
      ? [svg("line", { x1: X(b.ends[0][0]), y1: Y(b.ends[0][1]), x2: X(b.ends[1][0]), y2: Y(b.ends[1][1]), class: "part" })]
      : [svg("rect", { x: X(b.x) - 22, y: Y(b.y) - 13, width: 44, height: 26, rx: b.fixed ? 0 : 5, class: b.fixed ? "body fixed" : "body" })];
    const name = svg("text", { x: X(b.x), y: Y(b.y) + (b.ends ? -9 : 4), class: "name", "aria-hidden": "true" }, b.ends ? "" : b.name.length > 7 ? b.name.slice(0, 6) + "…" : b.name);
    const whole = places.length && !b.fixed ? labelled(button(places, b.name, shape, heat), name) : svg("g", {}, svg("title", {}, b.name), ...shape, name);
    posers.push(all => {
      const d = all.get(k);
      if (d?.ends) for (const [e, n] of [[0, 1], [1, 2]]) { shape[0].setAttribute(`x${n}`, X(b.ends[e][0]) + d.ends[e][0]); shape[0].setAttribute(`y${n}`, Y(b.ends[e][1]) + d.ends[e][1]); }
      else if (d) whole.setAttribute("transform", `translate(${round(d.dx)} ${round(d.dy)}) rotate(${round(d.turn)} ${X(b.x)} ${Y(b.y)})`);
    });
    return whole;
  });
  // It shrinks with the window as far as names can be read, and scrolls beyond.
  const fits = width < 1400;
  // A body reaches 22 from its place, and has 46 to the edge: what moves farther widens the frame.
  const scale = flat ? 1 : 0.5 * step, more = Math.ceil(Math.max(0, reach(scale) - 24));
  const drawn = d.spatial ? [...boxes.filter(Boolean), ...nodes] : [...nodes, ...boxes];
  // Where everything lies at rest stands behind what moves.
  const rest = moving() ? svg("g", { class: "rest", "aria-hidden": "true" }, ...drawn.flatMap(n => [...n.querySelectorAll("line, rect, path")]).map(n => n.cloneNode())) : null;
  move(all => posers.forEach(p => p(all)), scale);
  return el("div", { class: "scroll" }, svg("svg", { class: fits ? "structure fits" : "structure", viewBox: `${-more} ${-more} ${width + 2 * more} ${height + 2 * more}`, width: width + 2 * more, height: fits ? null : height + 2 * more, role: "group", "aria-label": "Structure" }, rest, ...drawn));
}

function list() {
  const all = marks();
  if (!all) return el("p", { class: "note" }, "Which place carries the misfit is not known yet. ", el("button", { type: "button", onclick: () => run({ verb: "score" }) }, "Score all places"),
    el("span", { class: "soft" }, " fits the model and computes, for every effect at every place, how far the cost would fall."));
  const here = all.filter(m => at(m, state.place));
  const shown = here.slice(0, state.place === null ? 25 : 40);
  const title = state.place === null ? "All places, best first" : state.place === "*channels" ? "Measuring channels" : `At ${state.place}`;
  const rows = shown.map(row);
  return el("div", {}, el("div", { class: "large-head" }, el("h2", {}, title),
    el("button", { type: "button", disabled: state.place === null, onclick: () => { state.place = null; draw(); } }, "All places"),
    el("button", { type: "button", "aria-pressed": state.place === "*channels", onclick: () => pick("*channels") }, "Measuring channels"),
    el("span", { class: "soft" }, `${here.length} candidates`)), shown.length ? el("div", { class: "candidates" }, ...rows) : el("p", {}, "No candidate acts here."));
}

function row(m) {
  const key = `${m.effect} ${m.at} ${m.of || ""}`;
  const is = open === key;
  const head = el("button", { type: "button", class: "candidate" + (m.promises ? "" : " weak"), "aria-expanded": is, "data-key": key, onclick: () => { open = is ? null : key; draw(); [...view.querySelectorAll(".candidate")].find(b => b.dataset.key === key)?.focus(); } },
    el("b", {}, m.effect.replaceAll("_", " ")), el("span", {}, m.at + (m.of ? ` (${m.of})` : "")), bar(m.predicted_drop),
    el("span", { class: "n" }, percent(m.predicted_drop)), el("span", { class: "n soft" }, m.p_value < 0.001 ? "p < 0.001" : `p = ${digits(m.p_value, 2)}`),
    el("span", { class: "soft" }, m.promises ? "worth a refit" : "too little"));
  if (!is) return head;
  const pictures = el("div", { class: "pictures" });
  demonstrate(m.effect, pictures);
  const order = { verb: "add", effect: m.effect, at: m.at, set: m.set, of: m.target?.of ?? null, condition: m.target?.condition ?? null, reference: m.target?.reference ?? null };
  return el("div", { class: "opened" }, head, el("div", { class: "about" },
    el("p", {}, m.claim), el("p", {}, el("code", {}, m.equation)),
    el("p", {}, `Expected ${m.parameter} = ${m.strength}${m.set.length ? `, at ${m.set.map(s => s.join(" = ")).join(", ")}` : ""}. Gain at most ${digits(m.nats, 3)} nats, price ${digits(m.price, 3)} nats.`),
    m.tied_with.length ? el("p", {}, "By its score alone not to be told from: ", m.tied_with.join("; "), ".") : null,
    pictures,
    el("p", { class: "buttons" }, el("button", { type: "button", class: "main", onclick: () => run(order) }, `Add ${m.effect} at ${m.at} and refit`), beside(m, key, order))));
}

/** Two candidates refitted from the same model, their curves beside each other. */
function beside(m, key, order) {
  if (pair && pair.key !== key) {
    return el("button", { type: "button", onclick: () => { const first = pair.order; pair = null; run({ ...first, other: { ...order, model: state.model } }); } }, `Refit ${pair.order.effect} and ${m.effect}, and see them beside each other`);
  }
  return el("button", { type: "button", "aria-pressed": pair !== null, onclick: () => { pair = pair ? null : { key, order }; draw(); } }, pair ? "Set beside another: open the other" : "Set beside another");
}

const bar = part => { const b = el("span", { class: "bar" }); b.style.setProperty("--part", Math.min(1, part)); return b; };

async function demonstrate(name, into) {
  if (!demonstrations.has(name)) demonstrations.set(name, api("effects/" + encodeURIComponent(name)).catch(() => null));
  const d = await demonstrations.get(name);
  if (!d?.loop) return;
  const path = (x, y, log) => {
    const lx = log ? x.map(Math.log10) : x;
    return { x: lx, y };
  };
  const small = (caption, abscissa, ordinate, series) => {
    const all = series.flatMap(s => s.y), allX = series.flatMap(s => s.x);
    const [x0, x1, y0, y1] = [Math.min(...allX), Math.max(...allX), Math.min(...all), Math.max(...all)];
    const to = s => s.x.map((x, k) => `${k ? "L" : "M"}${(18 + 152 * (x - x0) / ((x1 - x0) || 1)).toFixed(1)} ${(96 - 92 * (s.y[k] - y0) / ((y1 - y0) || 1)).toFixed(1)}`).join("");
    return el("figure", {}, svg("svg", { viewBox: "0 0 174 112", class: "thumb demo", role: "img", "aria-label": caption }, ...series.filter(s => s.y.length).map(s => svg("path", { class: s.c, d: to(s) })),
      svg("text", { class: "axis", x: 94, y: 108 }, abscissa), svg("text", { class: "axis", transform: "translate(11 50) rotate(-90)" }, ordinate)), el("figcaption", {}, caption));
  };
  const mag = h => h.map(([a, b]) => Math.log10(Math.hypot(a, b)));
  const series = [{ ...path(d.loop.x, d.loop.with), c: "computed" }];
  if (d.loop.without.length) series.unshift({ ...path(d.loop.x, d.loop.without), c: "old" });
  const frf = [{ ...path(d.frf.omega, mag(d.frf.without), true), c: "old" }];
  if (d.frf.with.length) frf.push({ ...path(d.frf.omega, mag(d.frf.with), true), c: "computed" });
  into.replaceChildren(small(`Loop: ${d.loop.of}`, "displacement", "force", series), small("FRF of an oscillator, without and with it", "frequency, log", "receptance, log", frf));
}

export function draw() {
  const d = state.described;
  if (!d) return;
  const told = !marks() ? "not scored yet" : most() ? "part of the cost that one effect at the place is expected to take away" : "no place is coloured: no effect at any of them is worth a refit";
  const scale = el("p", { class: "legend" }, ...(most() ? [el("span", {}, "0 %"), el("span", { class: "ramp" }), el("span", {}, percent(most()))] : []), el("span", { class: "soft" }, `${told}; the number counts the effects that act there`));
  view.replaceChildren(scale, controls(), picture(d), list());
}

on("described", draw);
on("modes", part => { const id = { mode: "mode", play: "play" }[part] || (document.activeElement?.id === "show-modes" ? "mode" : document.activeElement?.id); draw(); if (id) document.getElementById(id)?.focus(); });
