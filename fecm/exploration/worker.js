"use strict";
// Worker of the page: the kernel of the package, compiled to WebAssembly, computes every contact force; this file
// hands it the values and takes numbers from its forces.  A message has the impact of the sliders; the answers are
// the impact, then the threshold energy, the curve over energies and the random impacts.  A new message ends the
// work for the one before.  All values are in the deck's units.
const LANES = 8; // cases that the kernel computes in the time of one
const CURVE = 40, SLICE = 12; // points, ms of work between two messages
const NORMAL95 = 1.6449; // 95 % of standard normal numbers are smaller

const turns = new MessageChannel();
let data, kernel, job = null, isPlanned = false;

const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));

// Kernel --------------------------------------------------------------------------------------------------------

/** The kernel with the memory of one plate. */
class Kernel {
  constructor(module) {
    this.exports = new WebAssembly.Instance(module, {}).exports;
    this.exports._initialize();
    this.places = [];
  }

  /** Address of a copy of an array in the memory. */
  put(array) {
    const at = this.exports.malloc(Math.max(array.byteLength, 8));
    if (!at) throw new Error("there is not enough memory");
    this.places.push(at);
    new Uint8Array(this.exports.memory.buffer, at).set(new Uint8Array(array.buffer));
    return at;
  }

  /** Put a plate into the memory, in place of the last one. */
  load(plate) {
    this.places.forEach(this.exports.free);
    this.places = [];
    this.plate = plate;
    this.enough = plate.duration / 4;
    this.at = {given: this.put(new Float64Array(data.given.length * LANES)),
               found: this.put(new Float64Array(data.found.length * LANES)),
               force: this.put(new Float64Array(plate.sizes.at(-1).steps * LANES))};
    const own = {...this.at, stride: LANES}, arrays = plate.arrays.map(text => this.put(bytes(text)));
    const [, , , response] = plate.sizes[0].structures[0].find(([name]) => name === "plate");
    this.response = arrays[response];
    this.responses = new Map([[null, new Float64Array(bytes(plate.arrays[response]).buffer)]]);
    this.structures = new Map(plate.sizes.map(size => [size, size.structures.map(fields => {
      const view = new DataView(new ArrayBuffer(512));
      for (const [name, kind, offset, value] of fields)
        if (kind === "pointer") view.setUint32(offset, own[name] ?? arrays[value] ?? 0, true);
        else if (kind === "double") view.setFloat64(offset, value, true);
        else view.setBigInt64(offset, BigInt(own[name] ?? value), true);
      return this.put(view);
    })]));
    this.place = undefined;
    this.move(null);
  }

  /** Move the impact to a place of the table, or to the deck's, whose response is exact: null. */
  move(place) {
    if (this.place === place) return;
    if (this.responses.size > 9) this.responses = new Map([[null, this.responses.get(null)]]);
    if (!this.responses.has(place)) this.responses.set(place, modal(this.plate, place));
    const response = this.responses.get(place);
    this.doubles(this.response, response.length).set(response);
    this.nodeMass = response.length ? this.plate.sizes[0].dt ** 2 / response[0] : 0;
    this.place = place;
  }

  doubles(at, count) { return new Float64Array(this.exports.memory.buffer, at, count); }

  /** Compute up to LANES impacts with the time step of the first, for a time, and give the summary of each. */
  run(impacts, time) {
    const {plate} = this, {strike} = plate, size = sizeOf(plate, impacts[0]), steps = Math.min(size.steps, Math.round(time / size.dt));
    const rows = {K: i => i.k, Q: () => strike.q, CRITICAL: () => strike.critical, SLOPE: () => strike.slope,
                  VELOCITY: i => i.velocity, FACTOR: i => i.mass / strike.unitMass};
    const given = this.doubles(this.at.given, data.given.length * LANES);
    data.given.forEach((name, row) => impacts.forEach((impact, lane) => { given[row * LANES + lane] = rows[name](impact); }));
    const sizes = {cases: impacts.length, steps}, structures = this.structures.get(size);
    const view = new DataView(this.exports.memory.buffer, structures[0]);
    for (const [name, , offset] of size.structures[0]) if (name in sizes) view.setBigInt64(offset, BigInt(sizes[name]), true);
    if (!this.exports[plate.function](...structures)) throw new Error("there is not enough memory");
    const force = this.doubles(this.at.force, steps * impacts.length), found = this.doubles(this.at.found, data.found.length * LANES);
    return impacts.map((impact, lane) => summary(this, size.dt, impact, force.subarray(lane * steps, (lane + 1) * steps),
      Object.fromEntries(data.found.map((name, row) => [name, found[row * LANES + lane]]))));
  }

  /** Compute an impact for as long as is likely to decide it, and for all of the time if that does not. */
  one(impact) {
    let [result] = this.run([impact], this.enough);
    if (!isDecided(result)) [result] = this.run([impact], this.plate.duration);
    this.enough = 1.15 * result.contactEnd + LANES * result.dt;
    return {...result, force: result.force.slice()};
  }

  /** Compute impacts whose peaks are wanted, in a short run, and those that it leaves open in a long one. */
  peaks(impacts, time) {
    const results = this.run(impacts, time);
    const open = time < this.plate.duration ? results.flatMap((result, row) => isNaN(result.peak_force) ? [row] : []) : [];
    if (open.length)
      this.run(open.map(row => impacts[row]), this.plate.duration).forEach((result, index) => { results[open[index]] = result; });
    return results;
  }
}

/** The largest step that resolves the contact of an impact, as `largest_time_steps` of fecm/sweeps/reduced.py has it. */
function sizeOf({resolved, strike, sizes}, {velocity, mass, k}) {
  if (!resolved) return sizes[0];
  const force = (1.25 * mass * velocity ** 2 * k ** (2 / 3)) ** 0.6, deepest = (force / k) ** (2 / 3);
  const permanent = strike.law === "LINEAR" ? strike.slope * (deepest - strike.critical) : deepest - strike.critical ** 0.4 * deepest ** 0.6;
  const compliance = Math.min(deepest / 1.5, (deepest - Math.max(permanent, 0)) / strike.q) / force + resolved.flexibility;
  const largest = Math.min(resolved.platePhase * Math.sqrt(compliance / resolved.mobility),
    resolved.projectilePhase * Math.sqrt(compliance * mass), resolved.elementTime);
  return sizes.find(({dt}) => dt <= largest) ?? sizes.at(-1);
}

/** Response to a unit force at a place, summed from modes and the place's own vectors: fecm/exploration/places.py. */
function modal({places, sizes: [{dt, steps}]}, place) {
  const modes = new Float64Array(bytes(places.stiffness).buffer), table = new Float32Array(bytes(places.table).buffer);
  const width = table.length / (places.at.length + 1), count = (width + modes.length) / 2; // vectors
  const row = table.subarray(place * width, (place + 1) * width), b = 0.5 * places.damping * dt, keep = (1 - b) / (1 + b);
  const response = new Float64Array(steps);
  for (let vector = 0; vector < count; vector++) {
    const share = dt * dt / (1 + b), stiffness = share * (modes[vector] ?? row[count + vector - modes.length]);
    let step = share * row[vector] ** 2, w = step;
    for (let n = 0; n < steps; n++) {
      response[n] += w;
      step = keep * step - stiffness * w;
      w += step;
    }
  }
  return response;
}

// Numbers of an impact ------------------------------------------------------------------------------------------

const energyOf = (plate, {mass, velocity}) => 0.5 * plate.strike.factor * mass * velocity ** 2;
const isDecided = result => result.over && !isNaN(result.max_deflection);

/** What fecm/results/metrics.py takes from the forces of a case; NaN where its end has not decided a value. */
function summary({plate, nodeMass}, dt, impact, force, found) {
  const {mass, velocity} = impact, {factor} = plate.strike, steps = force.length, end = steps * dt;
  let impulse = 0, lever = 0, peak = 0, peakAt = 0, touching = 0, contacts = 0, lastAt = -1, begin = 0;
  for (let n = 0; n < steps; n++) {
    const f = force[n];
    if (!(f > 0)) continue;
    const weight = n + 1 < steps ? dt : 0.5 * dt;
    impulse += weight * f;
    lever += weight * f * (steps - 1 - n) * dt;
    touching++;
    if (lastAt !== n - 1 || n === 0) { contacts++; begin = n; }
    lastAt = n;
    if (f > peak) { peak = f; peakAt = n; }
  }
  const last = force[steps - 1], rebound = impulse / mass - velocity;
  let present = 0;
  if (last > 0) for (let n = begin; n < steps; n++) present = Math.max(present, force[n]);
  const motion = {last, peak, present, leaving: rebound + plate.mobility * impulse, ratio: mass / plate.mass,
                  position: velocity * end - lever * (1 / mass + plate.mobility), speed: found.LARGEST_DW / dt};
  const held = plate.mobility === 0, reach = Math.sqrt(2 * data.ends.rules.RESERVE * found.COMPLIANCE * Math.max(found.BENT_WORK, 0));
  const state = endOf(motion, held, reach), over = state === "contact over", known = over || data.ends.words[state][0] !== "outside the model";
  const where = (mask, value) => mask ? value : NaN;
  const limit = plate.threshold ? plate.threshold.force * Math.sqrt(impact.giic / plate.threshold.toughness) : NaN;
  const settled = over && (!held || reach <= data.ends.rules.RINGING * found.HIGHEST);
  const lost = found.LOST + nodeMass * found.LARGEST_DDW ** 2 / (8 * dt * dt);
  return {
    impact, force, dt, end: state, over, reached: factor * peak, limit, contactEnd: (lastAt + 1) * dt,
    energy: energyOf(plate, impact), overThreshold: factor * peak / limit, unconverged: found.UNCONVERGED || NaN,
    balance: found.INITIAL > 0 ? lost / found.INITIAL : lost, deepest: found.DEEPEST, highest: where(held, found.HIGHEST),
    peak_force: where(known, factor * peak), time_of_peak: where(known && touching, (peakAt + 1) * dt),
    contacts: where(over, contacts), contact_time: where(over, touching * dt),
    max_deflection: where(settled, found.HIGHEST),
    max_indentation: where(over || (known && found.INDENTATION < found.DEEPEST), found.DEEPEST),
    permanent_indentation: where(over, found.PERMANENT), impulse: where(over, factor * impulse),
    rebound_velocity: where(over, rebound), energy_absorbed: where(over, factor * 0.5 * mass * (velocity ** 2 - rebound ** 2)),
    contact_loop: where(over, factor * found.CONTACT_WORK),
  };
}

/** State of the contact at the end of a case, as fecm/judge/end.py decides it. */
function endOf(m, held, reach) {
  const {CLEAR, CLEAR_FREE, PRESSED, LIGHT, FALLEN, GONE} = data.ends.rules;
  const clear = (held ? CLEAR : CLEAR_FREE) + PRESSED * (m.last > 0 ? m.last / m.peak : 0);
  const isClear = m.leaving > clear * m.speed || (m.leaving > 0 && m.ratio < LIGHT);
  if (m.last > 0)
    return isClear && m.last < FALLEN * Math.min(m.present, m.peak) ? "in contact, peak passed" : "in contact, peak not reached";
  if (m.leaving < 0) return "between contacts";
  const near = m.leaving <= GONE * m.speed && !(m.position < -reach);
  return near ? (isClear ? "peak passed, may touch again" : "may touch again") : "contact over";
}

// Work ----------------------------------------------------------------------------------------------------------

const last = new Map(); // keys and values of the last answers, by name

/** Value of the last answer if its key is the same, and of a new computation otherwise. */
function* kept(name, key, compute) {
  const text = key.join();
  if (last.get(name)?.text !== text) last.set(name, {text, value: yield* compute()});
  return last.get(name).value;
}

/** Answer a message: each yield is a moment for the next one. */
function* work({number, plate: row, place, impact, scatter}) {
  const plate = data.plates[row], say = parts => postMessage({number, ...parts}), {mass, k, giic} = impact;
  if (kernel.plate !== plate) kernel.load(plate);
  kernel.move(place);
  const now = {...kernel.one(impact), place}, time = kernel.enough, where = [row, place];
  say({now, plate: row});
  yield;
  say({modal: place === null ? NaN : yield* kept("modal", [row, mass, k, impact.velocity], function* () {
    const [exact, modes] = [null, plate.places.at.length].map(own => { kernel.move(own); return kernel.one(impact).reached; });
    kernel.move(place);
    return Math.abs(modes / exact - 1);
  })});
  const energy = velocity => energyOf(plate, {mass, velocity}), speed = value => Math.sqrt(2 * value / plate.strike.factor / mass);
  const many = function* (impacts) {
    const results = [], steps = impacts.map(one => sizeOf(plate, one));
    for (const size of plate.sizes) {
      const rows = impacts.flatMap((_, row) => steps[row] === size ? [row] : []);
      for (let n = 0; n < rows.length; n += LANES) {
        const some = rows.slice(n, n + LANES);
        kernel.peaks(some.map(row => impacts[row]), time).forEach(({reached, peak_force}, index) => { results[some[index]] = {reached, peak_force}; });
        yield;
      }
    }
    return results;
  };
  const reached = limit => () => searched(impact, plate, limit, many);
  const found = now.limit > 0 ? energy(yield* kept("found", [where, mass, k, giic], reached(now.limit))) : null;
  say({found});
  const widest = Math.max(data.spans.energy[1] * energyOf(plate, plate.strike), now.energy);
  say({curve: yield* kept("curve", [where, mass, k, giic, widest], function* () {
    const most = 1.04 * Math.max(widest, found < 4 * widest ? 1.3 * found : 0);
    const energies = Array.from({length: CURVE}, (_, n) => most * (n + 1) / CURVE);
    const peaks = yield* many(energies.map(value => ({...impact, velocity: speed(value)})));
    return {energies: [0, ...energies], peaks: [0, ...peaks.map(one => one.reached)], most};
  })});
  const range = [];
  if (found && scatter.giic)
    for (const [name, sign] of [["5 %", -1], ["95 %", 1]]) { // the threshold goes with the root of G_IIc
      const limit = now.limit * Math.exp(0.5 * sign * NORMAL95 * 0.01 * scatter.giic);
      range.push([name, energy(yield* kept(name, [where, mass, k, limit], reached(limit)))]);
    }
  const draws = now.limit > 0 && Object.values(scatter).some(size => size > 0) ? yield* drawn(impact, plate, scatter, many) : null;
  // The page goes on for longer than the program of the deck, where the impact does.
  const isLonger = plate.duration > 1.001 * plate.program;
  say({draws, range, extended: isLonger && !isDecided(kernel.run([impact], plate.program)[0]), done: true});
}

/** Lowest velocity near the velocity of the deck at which the peak force reaches a force, found as a sweep finds it. */
function* searched(impact, {strike, search: [count, span]}, force, many) {
  let trials = Array.from({length: count}, (_, n) => strike.velocity * span ** (2 * n / (count - 1) - 1));
  for (let round = 0; round < 12; round++) {
    const peaks = (yield* many(trials.map(velocity => ({...impact, velocity})))).map(one => one.reached);
    const after = peaks.findIndex(peak => peak >= force);
    if (after < 1) return NaN;
    const low = trials[after - 1], high = trials[after], width = high - low;
    if (width <= 1e-6 * high) return high;
    const share = Math.log(force / peaks[after - 1]) / Math.log(peaks[after] / peaks[after - 1]);
    const guess = low * (high / low) ** (share > 0 && share < 1 ? share : 0.5);
    const inside = [0.01, 1e-4, 1e-7].flatMap(part => [guess - part * width, guess + part * width]);
    trials = [low, ...inside.filter(value => value > low && value < high), high].sort((a, b) => a - b);
  }
  return trials.at(-1);
}

/** Random impacts: their forces over the threshold, and how many are open. */
function* drawn(impact, plate, scatter, many) {
  const normal = normals(1), spread = (value, size) => value * Math.exp(0.01 * size * normal());
  const impacts = Array.from({length: plate.draws}, () => ({
    ...impact, velocity: impact.velocity * Math.sqrt(spread(1, scatter.energy)), k: spread(impact.k, scatter.k), giic: spread(impact.giic, scatter.giic)}));
  // G_IIc does not change the force.
  const results = yield* many(scatter.energy || scatter.k ? impacts : [impact]);
  const limits = impacts.map(({giic}) => plate.threshold.force * Math.sqrt(giic / plate.threshold.toughness));
  const ratios = limits.map((limit, n) => results[n % results.length].reached / limit);
  return {ratios, open: ratios.filter((ratio, n) => ratio < 1 && isNaN(results[n % results.length].peak_force)).length};
}

/** Generator of standard normal numbers: the same for every state, so that a chance changes smoothly. */
function normals(seed) {
  let a = seed;
  const uniform = () => {
    a = (a + 0x6d2b79f5) | 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
  return () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform());
}

/** Do a part of the work; a message in between may replace the rest. */
function slice() {
  isPlanned = false;
  const begin = performance.now();
  while (job && performance.now() - begin < SLICE) if (job.next().done) job = null;
  next();
}

function next() {
  if (job && !isPlanned) turns.port2.postMessage(null); // a timer would wait for 4 ms
  isPlanned = job !== null;
}

/** The first message has the data of the page, its kernel, and the impacts of pinned curves. */
onmessage = ({data: message}) => {
  if (message.kernel) {
    ({data} = message);
    kernel = new Kernel(new WebAssembly.Module(bytes(message.kernel)));
    postMessage({pins: message.pins.map(({plate, place, impact}) => { kernel.load(data.plates[plate]); kernel.move(place); return kernel.one(impact); })});
  } else { job = work(message); next(); }
};
turns.port1.onmessage = slice;
