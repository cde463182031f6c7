"use strict";
// Impacts on a plate as sliders move.  The worker computes; this file has the sliders and the pictures.
// All values are in the deck's units.
const byId = name => document.getElementById(name);
const source = document.documentElement.outerHTML; // before the page changes, to save it
const data = JSON.parse(byId("data").textContent), {measured} = data;
const PINS = 3;

/** Judgements of a result, in the words of the package's limits. */
function judgements(plate, result) {
  const isMoved = result.place !== null, bounds = [...plate.bounds, ...(isMoved ? [plate.places.bound] : [])];
  const rows = bounds.filter(bound => !isNaN(result[bound.of])).map(bound => {
    const value = result[bound.of], size = value / (bound.scale ?? 1), isBeyond = value > bound.most;
    const more = isBeyond && bound.beyond?.findLast(([at]) => at <= size);
    return {quantity: bound.quantity, size: quantity(bound.unit ?? "none", size, 3), level: isBeyond ? bound.level : "within range",
            words: more ? `${bound.words}; ${more[1]}` : bound.words};
  });
  const [level, words] = data.ends.words[result.end];
  return [...rows, {quantity: "end of the contact", size: result.end, level, words},
    {quantity: plate.unjudged, size: "–", level: "not judged", words: "this page has forces only: a run with FAIL has the exposures"},
    ...(isMoved ? [{quantity: "supports that pull", size: "–", level: "not judged", words: "the notes below are of the deck's place: a run has those of this place"}] : [])];
}

// Texts ---------------------------------------------------------------------------------------------------------

const digits = (value, count = 4) => String(Number(value.toPrecision(count)));
const tag = level => ({"within range": "within", "doubtful": "doubtful", "outside the model": "outside"})[level] ?? "unjudged";

/** Power of ten and name of a convenient unit of a quantity near a value. */
function unitOf(name, value) {
  const [unit, base, power] = data.units[name];
  if (!base || !["s", "N", "g", "J"].includes(base) || !(Math.abs(value) > 0) || !isFinite(value)) return [0, unit];
  const scale = 3 * Math.floor(Math.log10(Number(Math.abs(value).toPrecision(4))) / 3 + 1e-12);
  const prefix = data.prefixes[scale + power];
  return prefix === undefined ? [0, unit] : [scale, prefix + base === "Mg" ? "t" : prefix + base];
}

function quantity(name, value, count = 4) {
  if (!Number.isFinite(value)) return "open";
  const [power, unit] = unitOf(name, value);
  return `${digits(value / 10 ** power, count)} ${unit}`.trim();
}

function element(name, attributes = {}, ...children) {
  const made = attributes.svg ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) if (key !== "svg") made.setAttribute(key, value);
  made.append(...children);
  return made;
}

// Pictures ------------------------------------------------------------------------------------------------------

/** Numbers at equal round distances from 0 to a largest value. */
function ticks(most, count) {
  const rough = most / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find(size => size * power >= rough) * power;
  return Array.from({length: Math.floor(most / step + 1e-9) + 1}, (_, n) => Number((n * step).toPrecision(6)));
}

/** Draw lines, bars, marks and levels: axes have a `name` of a quantity, a label and the largest value. */
function chart(svg, {x, y, lines = [], marks = [], level, bars = [], words}) {
  const width = svg.clientWidth || 640, height = svg.clientHeight || 280, left = 58, right = 12, top = 14, bottom = 40;
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("aria-label", words);
  const [xPower, xUnit] = unitOf(x.name, x.most), [yPower, yUnit] = unitOf(y.name, y.most);
  const toX = value => left + (width - left - right) * Math.min(1, value / x.most);
  const toY = value => height - bottom - (height - top - bottom) * Math.max(-0.05, Math.min(1, value / y.most));
  const parts = [];
  const add = (name, attributes, text) => parts.push(element(name, {svg: true, ...attributes}, ...(text === undefined ? [] : [text])));
  const one = value => Math.round(value * 10) / 10;
  for (const value of ticks(x.most / 10 ** xPower, width < 480 ? 4 : 8)) {
    const at = one(toX(value * 10 ** xPower));
    add("path", {class: "grid", d: `M${at} ${top}V${height - bottom}`});
    add("text", {x: at, y: height - bottom + 15, "text-anchor": "middle"}, String(value));
  }
  for (const value of ticks(y.most / 10 ** yPower, 5)) {
    const at = one(toY(value * 10 ** yPower));
    add("path", {class: "grid", d: `M${left} ${at}H${width - right}`});
    add("text", {x: left - 6, y: at + 4, "text-anchor": "end"}, String(value));
  }
  add("path", {class: "axis", d: `M${left} ${top}V${height - bottom}H${width - right}`});
  add("text", {x: (left + width - right) / 2, y: height - 6, "text-anchor": "middle"}, xUnit ? `${x.label} (${xUnit})` : x.label);
  add("text", {x: 12, y: (top + height - bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${(top + height - bottom) / 2})`},
    yUnit ? `${y.label} (${yUnit})` : y.label);
  for (const {from, to, height: size, kind} of bars)
    add("rect", {class: `bar ${kind}`, x: one(toX(from)), y: one(toY(size)), width: Math.max(0.5, one(toX(to) - toX(from) - 1)), height: one(toY(0) - toY(size))});
  if (level && level.of === "x")
    add("path", {class: "level", d: `M${one(toX(level.value))} ${top}V${height - bottom}`});
  else if (level && level.value <= y.most) {
    if (level.band && level.band[0] < level.band[1]) {
      const [low, high] = level.band.map(toY);
      add("rect", {class: "band", x: left, y: high, width: width - left - right, height: low - high});
      add("text", {class: "of-level", x: (left + width - right) / 2, y: low - 5, "text-anchor": "middle"}, "delamination of each interface");
    }
    add("path", {class: "level", d: `M${left} ${one(toY(level.value))}H${width - right}`});
    add("text", {class: "of-level", x: width - right - 4, y: toY(level.value) + (level.isBelow ? 14 : -5), "text-anchor": "end"}, level.label);
  }
  for (const line of lines) add("path", {class: line.kind, d: path(line, toX, toY, width)});
  for (const mark of marks) add("circle", {class: "mark", cx: one(toX(mark.x)), cy: one(toY(mark.y)), r: 6});
  lines.filter(line => line.label).forEach((line, row) => {
    add("path", {class: line.kind, d: `M${left + 10} ${top + 8 + 16 * row}h26`});
    add("text", {x: left + 42, y: top + 12 + 16 * row}, line.label);
  });
  svg.replaceChildren(...parts);
  svg.toValue = event => Math.max(0, (event.clientX - svg.getBoundingClientRect().left - left) / (width - left - right) * x.most);
}

/** Path of a line.  Of many points in a pixel the lowest and the highest are drawn. */
function path({x, y}, toX, toY, width) {
  const every = Math.max(1, Math.floor(y.length / width)), points = [];
  for (let start = 0; start < y.length; start += every) {
    let low = start, high = start;
    for (let n = start; n < Math.min(start + every, y.length); n++) {
      if (y[n] < y[low]) low = n;
      if (y[n] > y[high]) high = n;
    }
    for (const n of low === high ? [low] : [Math.min(low, high), Math.max(low, high)])
      points.push(`${toX(x(n)).toFixed(1)} ${toY(y[n]).toFixed(1)}`);
  }
  return points.length ? `M${points.join("L")}` : "";
}

// State and sliders ---------------------------------------------------------------------------------------------

const first = data.plates[0], names = Object.keys(first.values);
const energyOf = (strike, velocity = strike.velocity) => 0.5 * strike.factor * strike.mass * velocity ** 2;
const atRest = {
  plate: first.values, speed: "energy", energy: energyOf(first.strike), mass: first.strike.mass, law: "k", k: first.strike.k,
  place: null, giic: first.threshold?.toughness ?? null, scatter: {energy: 0, k: 0, giic: 0}, pins: [],
};
let state = structuredClone(atRest);

const plateOf = wanted => data.plates.find(plate => names.every(name => plate.values[name] === wanted.plate[name])) ?? first;

/** Number of the place that is nearest to a point; null for the deck's. */
function nearest({at, own}, [x, y]) {
  const distances = [own, ...at].map(one => Math.hypot(one[0] - x, one[1] - y));
  const n = distances.indexOf(Math.min(...distances));
  return n ? n - 1 : null;
}

const placeOf = (wanted, {places} = plateOf(wanted)) => wanted.place && places ? nearest(places, wanted.place) : null;

/** Impact of a state on its plate. */
function impactOf(wanted, plate = plateOf(wanted)) {
  const {factor} = plate.strike, mass = wanted.mass;
  const velocity = {energy: () => Math.sqrt(2 * wanted.energy / factor / mass), velocity: () => wanted.velocity,
                    height: () => Math.sqrt(2 * data.gravity * wanted.height)}[wanted.speed]();
  return {velocity, mass, k: wanted.law === "radius" ? plate.strike.unitK * Math.sqrt(wanted.radius) : wanted.k, giic: wanted.giic};
}

/** Choose energy, velocity or height, k or radius, without a change of the impact. */
function choose(kind, choice) {
  const plate = plateOf(state), {velocity, k, mass} = impactOf(state, plate), short = value => Number(value.toPrecision(4));
  const values = {energy: 0.5 * plate.strike.factor * mass * velocity ** 2, velocity, height: velocity ** 2 / (2 * data.gravity),
                  k, radius: (k / plate.strike.unitK) ** 2};
  state[kind] = choice;
  state[choice] = short(values[choice]);
}

/** Sliders of a group: name, label, and the values at their ends. */
function sliders() {
  const base = atRest, {spans} = data, {factor} = first.strike;
  const part = factor > 1 ? ` (1/${factor})` : "";
  const spread = (value, [low, high], power = 1) => [value * low ** power, value * high ** power];
  const v = first.strike.velocity, of = {energy: spread(base.energy, spans.energy), velocity: spread(v, spans.energy, 0.5),
    height: data.gravity ? spread(v * v / (2 * data.gravity), spans.energy) : null};
  const list = [{group: "Impact", name: state.speed, label: state.speed, ends: of[state.speed]}];
  if (first.strike.scales) list.push({group: "Impact", name: "mass", label: `mass${part}`, ends: spread(base.mass, spans.mass)});
  list.push(state.law === "k" ? {group: "Contact", name: "k", label: `coefficient k${part}`, ends: spread(base.k, spans.k)}
    : {group: "Contact", name: "radius", label: "radius", ends: spread((base.k / first.strike.unitK) ** 2, spans.k)});
  if (base.giic !== null) {
    list.push({group: "Laminate", name: "giic", label: "toughness G_IIc", ends: spread(base.giic, spans.giic)});
    for (const [name, label] of [["energy", "energy"], ["k", "k"], ["giic", "toughness G_IIc"]])
      list.push({group: "Scatter (standard deviations)", name, label, ends: [0, 40], scatter: true});
  }
  return list;
}

/** Build the controls anew; the focus stays where it was. */
function build() {
  const focus = document.activeElement?.id, groups = new Map();
  const fieldset = title => {
    if (!groups.has(title)) groups.set(title, element("fieldset", {}, element("legend", {}, title)));
    return groups.get(title);
  };
  const choice = (group, kind, label, options) => {
    const select = element("select", {id: `choose-${kind}`}, ...options.map(([value, text]) => element("option", {value}, text)));
    select.value = state[kind];
    select.addEventListener("change", () => { choose(kind, select.value); build(); changed(); });
    fieldset(group).append(element("div", {class: "row choice"}, element("label", {for: select.id}, label), select));
  };
  names.forEach((name, row) => {
    const values = [...new Set(data.plates.map(plate => plate.values[name]))];
    const select = element("select", {id: `plate-${row}`}, ...values.map(value => element("option", {value}, value)));
    select.value = state.plate[name];
    select.addEventListener("change", () => { state.plate = {...state.plate, [name]: select.value}; build(); changed(); });
    fieldset("Plate").append(element("div", {class: "row choice"}, element("label", {for: select.id}, name.replaceAll("_", " ")), select));
  });
  choice("Impact", "speed", "given by", [["energy", "energy"], ["velocity", "velocity"], ...(data.gravity ? [["height", "drop height"]] : [])]);
  for (const slider of sliders()) {
    if (slider.group === "Contact" && first.strike.unitK) choice("Contact", "law", "given by", [["k", "k"], ["radius", "steel tip (estimate)"]]);
    fieldset(slider.group).append(row(slider));
  }
  if (plateOf(state).places) fieldset("Place").append(...placing(plateOf(state).places));
  byId("sliders").replaceChildren(...groups.values());
  if (focus) byId(focus)?.focus({preventScroll: true});
}

/** Picture of the plate with the places of the impact, and fields of the present one. */
function placing(places) {
  const {at, own, extent: [left, low, right, high]} = places, now = at[placeOf(state)] ?? own, [x, y] = now;
  const size = Math.max(right - left, high - low), pad = 0.04 * size, shape = (name, attributes) => element(name, {svg: true, ...attributes});
  const move = point => { const n = nearest(places, point); state.place = n === null ? null : at[n]; build(); changed(); };
  const svg = element("svg", {svg: true, id: "place", class: "chart", tabindex: 0, role: "application",
    viewBox: `${left - pad} ${-high - pad} ${right - left + 2 * pad} ${high - low + 2 * pad}`,
    "aria-label": `Plate with the impact at ${quantity("height", x)}, ${quantity("height", y)}; arrow keys move it`},
  element("g", {svg: true, transform: "scale(1 -1)"}, shape("path", {class: "axis", d: places.outline}), shape("path", {class: "held", d: places.supports}),
    shape("path", {class: "places", d: at.map(one => `M${one[0]} ${one[1]}h0`).join("")}), shape("circle", {class: "mark", cx: x, cy: y, r: 0.02 * size})));
  svg.addEventListener("click", event => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    move([point.x, -point.y]);
  });
  svg.addEventListener("keydown", event => {
    const way = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key];
    if (!way) return;
    event.preventDefault();
    const ahead = [own, ...at].map(one => {
      const along = (one[0] - x) * way[0] + (one[1] - y) * way[1], aside = Math.abs((one[0] - x) * way[1] + (one[1] - y) * way[0]);
      return {one, far: along > 1e-6 * size && aside <= along ? along + 2 * aside : Infinity};
    }).reduce((best, next) => next.far < best.far ? next : best);
    if (ahead.far < Infinity) move(ahead.one);
  });
  const fields = ["x", "y"].map((name, axis) => {
    const field = element("input", {type: "number", id: `place-${name}`, step: "any", value: digits(now[axis]), "aria-label": `Place: ${name} (${data.units.height[0]})`});
    field.addEventListener("change", () => move(axis ? [x, Number(field.value)] : [Number(field.value), y]));
    return element("div", {class: "row"}, element("label", {for: field.id}, name), field, element("span", {}, data.units.height[0]));
  });
  return [svg, element("p", {class: "hint"}, "A click or an arrow key moves the impact to a dot: a node at which a run has no other warnings than at the deck's place."), ...fields];
}

/** Slider and field of a value.  The slider is logarithmic, except of a scatter in per cent. */
function row({group, name, label, ends, scatter}) {
  const values = scatter ? state.scatter : state, id = scatter ? `scatter-${name}` : name, [low, high] = ends;
  const [power, unit] = scatter ? [0, "%"] : unitOf(name, values[name]);
  const range = element("input", {type: "range", id, min: 0, max: scatter ? high : 400, step: 1, "aria-label": `${group}: ${label}`});
  const field = element("input", {type: "number", id: `${id}-value`, step: "any", min: 0, "aria-label": `${group}: ${label} (${unit})`});
  const show = (skip) => {
    const value = values[name];
    if (skip !== range) range.value = scatter ? value : 400 * Math.log(value / low) / Math.log(high / low);
    if (skip !== field) field.value = digits(value / 10 ** power, 4);
    range.setAttribute("aria-valuetext", `${digits(value / 10 ** power)} ${unit}`);
  };
  range.addEventListener("input", () => {
    values[name] = scatter ? Number(range.value) : Number((low * (high / low) ** (range.value / 400)).toPrecision(3));
    show(range); changed();
  });
  field.addEventListener("input", () => {
    const value = Number((Number(field.value) * 10 ** power).toPrecision(12));
    if (!Number.isFinite(value) || !(scatter ? value >= 0 : value > 0)) return field.setAttribute("aria-invalid", "true");
    field.removeAttribute("aria-invalid");
    values[name] = value; show(field); changed();
  });
  show();
  return element("div", {class: "row"}, element("label", {for: field.id}, label), field, element("span", {}, unit), range);
}

// Worker --------------------------------------------------------------------------------------------------------

let worker, asked = 0, now, frame = null;
const shown = {number: 0, plate: 0, found: null, range: [], curve: null, draws: null, modal: NaN, extended: false, done: false};

/** Ask the worker for the state of the sliders; what is shown stays until the answer is there. */
function changed() {
  keep();
  asked++;
  worker.postMessage({number: asked, ...question(state), scatter: state.scatter});
  pending();
}

const question = wanted => ({plate: data.plates.indexOf(plateOf(wanted)), place: placeOf(wanted), impact: impactOf(wanted)});

function answered({data: answer}) {
  if (answer.pins) answer.pins.forEach((result, n) => { state.pins[n].result = result; });
  else Object.assign(shown, {done: false}, answer);
  now = shown.now;
  frame ??= requestAnimationFrame(() => { frame = null; if (now) draw(); pending(); });
}

function pending() {
  const isPending = shown.number !== asked || !shown.done;
  byId("pin").disabled = shown.number !== asked;
  document.body.dataset.ready = String(!isPending);
  for (const name of ["from", "shares", "curve", "draws", "commands"]) byId(name)?.setAttribute("aria-busy", isPending);
}

// Page ----------------------------------------------------------------------------------------------------------

const SHOWN = ["peak_force", "time_of_peak", "contacts", "contact_time", "max_deflection", "max_indentation", "permanent_indentation",
               "impulse", "rebound_velocity", "energy_absorbed", "contact_loop"];

function draw() {
  const plate = data.plates[shown.plate], {pins} = state, rows = judgements(plate, {...now, modal: shown.modal}), {found} = shown, {energy} = now;
  const delaminates = now.limit > 0 ? now.reached >= now.limit : null;
  const level = now.limit > 0 ? {value: now.limit, label: "delamination threshold"} : null;
  const band = level && plate.threshold.band.map(force => force * now.limit / plate.threshold.force);
  const from = found ? `${plate.threshold.from} ${quantity("energy", found)}` : found === null ? "" : "at no energy near these";
  const shares = shown.range.map(([share, value]) => `${share} of plates from ${quantity("energy", value)}`);
  const chance = shown.draws && shown.draws.ratios.filter(ratio => ratio >= 1).length / shown.draws.ratios.length;
  const line = delaminates === null ? ["Peak force: ", element("strong", {}, quantity("peak_force", now.peak_force))]
    : ["Delaminates: ", element("strong", {}, delaminates ? "yes" : isNaN(now.peak_force) ? "open" : "no"), element("span", {id: "from"}, from && `; ${from}`)];
  const doubts = rows.filter(one => ["outside", "doubtful"].includes(tag(one.level)));
  const isOutside = doubts.some(one => tag(one.level) === "outside"), doubt = isOutside ? "Outside the model" : "Doubtful";
  byId("answer").className = isOutside ? "outside" : doubts.length ? "doubtful" : "within";
  byId("answer").replaceChildren(element("p", {}, ...line),
    ...(shares.length ? [element("p", {id: "shares"}, `With this scatter of G_IIc, ${shares.join(", ")}`)] : []), ...(doubts.length ? [element("p", {}, `${doubt}: ${doubts.map(one => `${one.quantity} ${one.size}`).join(", ")}`)] : []));
  const heads = [["peak force", "peak_force", ""], ["time in contact", "contact_time", ""],
    ["deflection", "max_deflection", isNaN(now.max_deflection) ? "" : `${digits(now.max_deflection / plate.thickness, 3)} h`], ["rebound", "rebound_velocity", ""]];
  byId("headlines").replaceChildren(...[["impact", "", `${quantity("energy", energy)}`, `${quantity("velocity", now.impact.velocity)}`],
    ...heads.map(([label, name, small]) => [label, name, quantity(name, now[name]), small])].map(([label, name, text, small]) =>
    element("div", {}, element("dt", {}, label), element("dd", {"data-name": name}, text, ...(small ? [" ", element("small", {}, small)] : [])))));

  const lines = pins.map((pin, n) => ({kind: `pin${n + 1}`, label: `pinned ${n + 1}`, ...curveOf(pin.result)}));
  if (measured) lines.push({kind: "measured", label: measured.name.slice(0, 18), x: n => measured.time[n], y: measured.force});
  lines.push({kind: "now", label: lines.length ? "now" : "", ...curveOf(now)});
  const last = Math.max(now.contactEnd, ...pins.map(pin => pin.result.contactEnd), measured ? Math.min(measured.time.at(-1), 2 * now.contactEnd) : 0);
  const highest = Math.max(now.reached, ...pins.map(pin => pin.result.reached), ...(measured?.force ?? []), 1e-300);
  chart(byId("force"), {x: {name: "time", label: "time", most: 1.08 * last || 1}, y: {name: "peak_force", label: "contact force", most: (lines.length > 1 ? 1.35 : 1.1) * (level && level.value < 3 * highest ? Math.max(highest, level.value) : highest)},
    lines, level: level && {...level, band}, words: `Contact force over time: peak ${quantity("peak_force", now.peak_force)} at ${quantity("time_of_peak", now.time_of_peak)}`});
  if (shown.curve) {
    const {energies, peaks, most} = shown.curve, top = Math.max(...peaks);
    chart(byId("curve"), {x: {name: "energy", label: "energy", most: Math.max(most, energy)}, y: {name: "peak_force", label: "peak force", most: 1.1 * (level && level.value < 2 * top ? Math.max(top, level.value) : top)},
      lines: [{kind: "now", x: n => energies[n], y: peaks}], marks: [{x: energy, y: now.reached}], level: level && {...level, isBelow: true},
      words: `Peak force against energy; the impact has ${quantity("energy", energy)}${found ? `, the threshold is reached at ${quantity("energy", found)}` : ""}`});
  }
  for (const part of document.querySelectorAll(".delamination")) part.hidden = !(now.limit > 0);
  if (shown.draws) histogram(shown.draws, chance);
  else {
    byId("draws").replaceChildren();
    byId("probability").textContent = Object.values(state.scatter).some(size => size > 0) ? "being computed" : "Give the energy, k or the toughness a scatter to see how sure the answer is.";
  }
  table(byId("trust"), ["quantity", "size", "verdict", "why"], rows.map(one => [one.quantity, one.size, element("span", {class: `mark ${tag(one.level)}`}, one.level), one.words]));
  const results = [now, ...pins.map(pin => pin.result)], founds = [found, ...pins.map(pin => pin.found)];
  const numbers = (label, name, values) => [label, ...values.map(value => cell(name, value ?? NaN))];
  table(byId("numbers"), ["quantity", "now", ...pins.map((_, n) => `pinned ${n + 1}`)], [
    ...SHOWN.map(name => numbers(data.labels[name], name, results.map(result => result[name]))),
    ...(now.limit > 0 ? [numbers("delamination threshold", "peak_force", results.map(result => result.limit)),
                         numbers("energy from which it delaminates", "energy", founds)] : []),
    ...(chance === null ? [] : [["chance that it delaminates", element("data", {value: chance}, digits(chance, 3)), ...pins.map(() => "")]])]);
  if (shown.done) commands(chance !== null);
}

const cell = (name, value) => element("data", {value: String(value)}, name === "contacts" ? String(value) : quantity(name, value));
const curveOf = result => ({x: n => (n + 1) * result.dt, y: result.force.map(force => force * first.strike.factor)});

function table(at, head, rows) {
  at.replaceChildren(element("thead", {}, element("tr", {}, ...head.map(text => element("th", {scope: "col"}, text)))),
    element("tbody", {}, ...rows.map(([label, ...cells]) => element("tr", {}, element("th", {scope: "row"}, label), ...cells.map(part => element("td", {}, part))))));
}

function histogram({ratios, open}, chance) {
  const most = Math.max(1.3, ...ratios) * 1.02, size = most / 40, counts = new Array(40).fill(0);
  for (const ratio of ratios) counts[Math.min(39, Math.floor(ratio / size))]++;
  const count = ratios.length, error = Math.sqrt(chance * (1 - chance) / count), bound = digits(3 / count, 2); // 95 %
  const size95 = chance === 0 ? `below ${bound}` : chance === 1 ? `above ${1 - bound}` : `${digits(chance, 3)} ± ${digits(error, 1)}`;
  const text = `Chance ${size95}: ${Math.round(chance * count)} of ${count} random impacts delaminate${open ? `, ${open} are open` : ""}.`;
  byId("probability").textContent = text;
  chart(byId("draws"), {x: {name: "none", label: "peak force over the threshold", most}, y: {name: "none", label: "impacts", most: 1.1 * Math.max(...counts)},
    bars: counts.map((count, n) => ({from: n * size, to: (n + 1) * size, height: count, kind: n * size >= 1 - size / 2 ? "above" : ""})), level: {of: "x", value: 1}, words: text});
}

// Commands ------------------------------------------------------------------------------------------------------

const quoted = text => /^[\w@%+=:,.\/-]+$/.test(text) && !text.startsWith("-") ? text : `'${text.replaceAll("'", "'\\''")}'`;

/** Options that give the state, without the names left out. */
function options(out = []) {
  const {velocity} = impactOf(state), values = {}, plate = plateOf(state);
  if (state.speed === "energy") values.energy = state.energy; else values.velocity = velocity;
  if (state.mass !== atRest.mass) values.mass = state.mass;
  if (state.law === "radius") values.radius = state.radius; else if (state.k !== atRest.k) values.k = state.k;
  if (state.giic !== atRest.giic) values.giic = state.giic;
  if (placeOf(state) !== null) values.at = state.place.map(value => Number(value.toPrecision(7))).join(",");
  if (shown.extended && !names.includes("duration")) values.duration = Number(plate.duration.toPrecision(6));
  const all = [...Object.entries(values).filter(([name]) => !out.includes(name)), ...names.map(name => [name, state.plate[name]])];
  const rounded = value => typeof value === "number" ? Number(value.toPrecision(7)) : value;
  return [...all.map(([name, value]) => `--vary ${quoted(`${name}=${rounded(value)}`)}`), plate.options].filter(Boolean).join(" ");
}

function commands(withChance) {
  const {name} = data.deck, out = quoted(name.replace(/(\.[^.]*)?$/, "-explored.h5").replace(/^.*[/\\]/, ""));
  const parts = (more, left) => ["fecm sweep", quoted(name), options(left), more, `-o ${out} --overwrite`].filter(Boolean).join(" ");
  const find = "--find velocity --until peak_force=threshold", {velocity, mass, k, giic} = impactOf(state);
  const values = {energy: energyOf({...plateOf(state).strike, mass}, velocity), k, giic};
  const scattered = Object.keys(values).filter(name => state.scatter[name] > 0);
  const random = (names, samples) => `${names.map(name => `--random ${name}=lognormal:${values[name]},${state.scatter[name] / 100}`).join(" ")} --samples ${samples}`;
  const list = [["this impact", parts("--measure max_deflection")]];
  if (now.limit > 0) list.push(["the energy from which it delaminates", parts(find, ["energy", "velocity"])]);
  if (shown.range.length) list.push(["this energy with the scatter of G_IIc", parts(`${random(["giic"], 100)} ${find}`, ["energy", "velocity", "giic"])]);
  if (withChance && state.law === "k") list.push(["the chance, with draws of its own",
    parts(`${random(scattered, plateOf(state).draws)} --exceed peak_force=threshold`, [...scattered, ...scattered.includes("energy") ? ["velocity"] : []])]);
  byId("commands").replaceChildren(...list.map(([label, text], n) => {
    const pre = element("pre", {id: `command-${n}`, tabindex: "0"}, text), button = element("button", {type: "button", "aria-label": `Copy the command of ${label}`}, "Copy");
    button.addEventListener("click", async () => {
      getSelection().selectAllChildren(pre);
      try { await navigator.clipboard.writeText(text); button.textContent = "Copied"; } catch { button.textContent = "Selected"; }
    });
    return element("div", {class: "command"}, element("p", {}, `For ${label}:`), pre, button);
  }));
}

// State in the address and in files -----------------------------------------------------------------------------

const kept = () => ({...state, pins: state.pins.map(pin => ({state: pin.state}))});

/** Write the state into the address; pages in a frame have none. */
function keep() {
  try { history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify({...kept(), pins: []}))}`); } catch { /* as in a notebook */ }
}

/** Take values of a state that have the right types; others stay those of the deck. */
function take(given) {
  if (!given || typeof given !== "object") return;
  const positive = value => typeof value === "number" && Number.isFinite(value) && value > 0;
  for (const name of ["energy", "velocity", "height", "mass", "k", "radius", "giic"]) if (positive(given[name]) && state[name] !== null) state[name] = given[name];
  if (!first.strike.scales) state.mass = atRest.mass;
  if (["energy", "velocity", "height"].includes(given.speed) && positive(given[given.speed]) && (given.speed !== "height" || data.gravity)) state.speed = given.speed;
  if (given.law === "radius" && first.strike.unitK && positive(given.radius)) state.law = "radius";
  for (const name of Object.keys(state.scatter)) {
    const size = given.scatter?.[name];
    if (typeof size === "number" && size >= 0 && size <= 1000) state.scatter[name] = size;
  }
  const plate = data.plates.find(one => names.every(name => one.values[name] === given.plate?.[name]));
  if (plate) state.plate = plate.values;
  if (Array.isArray(given.place) && given.place.length === 2 && given.place.every(Number.isFinite)) {
    const {places} = plateOf(state), n = placeOf({...state, place: given.place});
    state.place = n === null ? null : places.at[n];
  }
  for (const pin of Array.isArray(given.pins) ? given.pins.slice(0, PINS) : []) addPin(pin?.state);
}

/** Keep a state beside the present one; the worker computes its curve. */
function addPin(given) {
  const before = state;
  state = structuredClone(atRest);
  take({...given, pins: []});
  before.pins.push({state, result: null, found: null});
  state = before;
}

function download(name, type, text) {
  const link = element("a", {href: URL.createObjectURL(new Blob([text], {type})), download: name});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const stem = data.deck.name.replace(/^.*[/\\]/, "").replace(/\.[^.]*$/, "");
const head = (name, label) => data.units[name][0] ? `${label} (${data.units[name][0]})` : label;

function start() {
  take(JSON.parse(byId("state").textContent));
  try { take(JSON.parse(decodeURIComponent(location.hash.slice(1)))); } catch { /* no state in the address */ }
  const script = URL.createObjectURL(new Blob([byId("worker").textContent], {type: "text/javascript"}));
  worker = new Worker(script);
  worker.addEventListener("message", answered);
  worker.addEventListener("error", event => failed(event.message));
  worker.postMessage({data, kernel: byId("kernel").textContent, pins: state.pins.map(pin => question(pin.state))});
  byId("about").textContent = `${first.model}, steps of ${quantity("time", first.sizes[0].dt)}${first.resolved ? " or less" : ""}. Every force is computed in this page by the kernel of fecm.`;
  byId("notes").replaceChildren(...(data.notes.length ? [element("h3", {}, names.length ? "Notes of the run of the deck as it is" : "Notes of the deck's own run"), element("ul", {}, ...data.notes.map(text => element("li", {}, text)))] : []));
  byId("own-run").hidden = true;
  byId("page").hidden = false;
  byId("pin").addEventListener("click", () => {
    if (state.pins.length === PINS) state.pins.shift();
    state.pins.push({state: {...structuredClone({...state, pins: []})}, result: now, found: shown.found});
    draw();
  });
  byId("reset").addEventListener("click", () => { state = structuredClone(atRest); build(); changed(); });
  byId("curve").addEventListener("click", event => {
    if (!byId("curve").toValue) return;
    const value = byId("curve").toValue(event);
    if (!(value > 0)) return;
    state.speed = "energy"; state.energy = Number(value.toPrecision(3)); build(); changed();
  });
  byId("save-csv").addEventListener("click", () => download(`${stem}-force.csv`, "text/csv",
    `${head("time", "time")},${head("peak_force", "force")}\n${Array.from(curveOf(now).y, (force, n) => `${(n + 1) * now.dt},${force}\n`).join("")}`));
  byId("save-deck").addEventListener("click", () => download(data.deck.name.replace(/^.*[/\\]/, ""), "text/plain", data.deck.text));
  byId("save-page").addEventListener("click", () => {
    const text = JSON.stringify(kept()).replaceAll("<", "\\u003c");
    download(`${stem}.html`, "text/html", `<!DOCTYPE html>\n${source.replace(/(<script type="application\/json" id="state">)[^<]*/, (_, tagged) => tagged + text)}`);
  });
  for (const name of ["resize", "beforeprint"]) addEventListener(name, () => now && draw());
  build();
  changed();
}

/** Show the run of the deck instead of the sliders. */
function failed(reason) {
  byId("own-run").hidden = false;
  byId("page").hidden = true;
  byId("own-run").append(element("p", {}, String(reason)));
}

try { start(); } catch (error) { failed(error); }
