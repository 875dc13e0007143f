// The last five minutes of the arm, one row per joint state: the source of the plots and the CSV file. It can be looked at again
// while the arm goes on: a time in it, step by step, in slow motion, and back to now. The arm itself always runs in real time.
// Invariant: rows are in order of simulation time, without repeats; a reset begins anew. Its memory is taken once. Looking back changes
// nothing of the arm; the shown time lies within the record.

import { energies, gravityLoad } from "./mechanics.js";
import { toFragment } from "./settings.js";
import { MOST_LINKS, state, tell } from "./store.js";

/** Five minutes at 60 rows a second: 2.9 MB, taken once. */
const ROWS = 18000;

/** Slopes at both ends together that one smooth motion can have: so many times the change, and this much around a turning point [rad]. */
const [STEEP, TURN] = [6, 0.5];

/** Where each quantity begins in a row; per-joint ones have an entry for each of three joints. */
export const TIME = 0;
export const ENERGY = 1;
export const KINETIC = 2;
export const POTENTIAL = 3;
export const POSITION = 4;
export const SETPOINT = POSITION + MOST_LINKS;
export const VELOCITY = SETPOINT + MOST_LINKS;
export const EFFORT = VELOCITY + MOST_LINKS;
export const LOAD = EFFORT + MOST_LINKS;
const WIDTH = LOAD + MOST_LINKS;

/** A ring of rows of numbers: the newest `capacity` rows are kept. */
class Ring {
  /** @param {number} capacity rows kept @param {number} width numbers per row */
  constructor(capacity, width) {
    this.capacity = capacity;
    this.width = width;
    this.data = new Float64Array(capacity * width);
    this.length = 0;
    this.head = 0; // the row that is written next
  }

  clear() {
    this.length = 0;
  }

  /** Makes room for one row, and gives the index in `data` where it begins. */
  push() {
    const offset = this.head * this.width;
    this.head = (this.head + 1) % this.capacity;
    if (this.length < this.capacity) this.length += 1;
    return offset;
  }

  /** Where row `i` begins in `data`; row 0 is the oldest. */
  at(i) {
    const row = this.head - this.length + i;
    return (row < 0 ? row + this.capacity : row) * this.width;
  }

  /** Where the newest row begins; only if there is one. */
  last() {
    return this.at(this.length - 1);
  }
}

export const record = new Ring(ROWS, WIDTH);

/** Takes the latest joint state, if simulation time went on since the one before. */
export function take() {
  const { data } = record;
  if (record.length > 0 && state.time <= data[record.last() + TIME]) return;
  const n = state.links;
  const row = record.push();
  data[row + TIME] = state.time;
  const { kinetic, potential } = state.params ? energies(n, state.position, state.velocity, state.params) : { kinetic: NaN, potential: NaN };
  data[row + KINETIC] = kinetic;
  data[row + POTENTIAL] = potential;
  data[row + ENERGY] = kinetic + potential;
  for (let i = 0; i < n; i += 1) {
    data[row + POSITION + i] = state.position[i];
    data[row + SETPOINT + i] = state.setpointKnown ? state.setpoint[i] : NaN;
    data[row + VELOCITY + i] = state.velocity[i];
    data[row + EFFORT + i] = state.effort[i];
    data[row + LOAD + i] = NaN;
  }
  if (state.params) gravityLoad(n, state.position, state.params, data, row + LOAD);
}

/**
 * Positions and velocities at `time`, between the rows that begin at `a` and `b`: positions by the cubic that has both at its ends,
 * velocities straight.
 * @param {number} a @param {number} b @param {number} time [s] @param {Float64Array} position @param {Float64Array} velocity
 */
export function between(a, b, time, position, velocity) {
  const { data } = record;
  const h = data[b + TIME] - data[a + TIME];
  const s = h > 0 ? (time - data[a + TIME]) / h : 1;
  for (let i = 0; i < MOST_LINKS; i += 1) {
    const [v, w] = [data[a + VELOCITY + i], data[b + VELOCITY + i]];
    position[i] = cubic(s, data[a + POSITION + i], data[b + POSITION + i], h * v, h * w);
    velocity[i] = v + s * (w - v);
  }
}

/**
 * At `s` from 0 to 1 the cubic from `p` to `q` with slopes `v` and `w` there. Where an arm shakes they are of many turns between two
 * records, which nobody has seen: then it goes straight.
 * @param {number} s @param {number} p @param {number} q @param {number} v @param {number} w
 */
function cubic(s, p, q, v, w) {
  const change = q - p;
  if (s === 1) return q;
  if (Math.abs(v) + Math.abs(w) > STEEP * Math.abs(change) + TURN) return p + s * change;
  return p + s * (v + s * (3 * change - 2 * v - w + s * (v + w - 2 * change)));
}

/** Index of the first row at or after `time` [s]. @param {number} time */
export function firstAfter(time) {
  let low = 0;
  let high = record.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (record.data[record.at(middle) + TIME] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** @typedef {import("./settings.js").Settings} Settings */

const COLUMNS = /** @type {[string, string, number][]} */ ([
  ["position", "rad", POSITION],
  ["setpoint", "rad", SETPOINT],
  ["velocity", "rad/s", VELOCITY],
  ["effort", "N m", EFFORT],
  ["gravity_load", "N m", LOAD],
]);

/** The file's text, for an arm with `links` links. @param {number} links @param {Settings | null} settings those in force now */
export function csvText(links, settings) {
  const names = ["time [s]"];
  const offsets = [TIME];
  for (const [name, unit, offset] of COLUMNS) {
    for (let joint = 0; joint < links; joint += 1) {
      names.push(`${name}${joint + 1} [${unit}]`);
      offsets.push(offset + joint);
    }
  }
  names.push("kinetic [J]", "potential [J]", "energy [J]");
  offsets.push(KINETIC, POTENTIAL, ENERGY);
  const about = settings ? toFragment(settings, links).split("&").map((one) => `# ${one}`) : [];
  const lines = ["# pendularm; settings as they were when this was saved", ...about, names.join(",")];
  for (let i = 0; i < record.length; i += 1) {
    const row = record.at(i);
    lines.push(offsets.map((offset) => {
      const value = record.data[row + offset];
      return Number.isFinite(value) ? value : "";
    }).join(","));
  }
  return `${lines.join("\r\n")}\r\n`;
}

/** The joint state that the pictures show: the latest joint state, or one of the recording. */
export const shown = {
  live: true,
  playing: false,
  speed: 1,
  time: 0, // s, simulation time
  position: new Float64Array(MOST_LINKS),
  velocity: new Float64Array(MOST_LINKS),
  effort: new Float64Array(MOST_LINKS),
  setpoint: new Float64Array(MOST_LINKS),
  setpointKnown: false,
};

/** The time of the newest row [s]; NaN where there is none. */
export function newest() {
  return record.length > 0 ? record.data[record.last() + TIME] : NaN;
}

/** The first and the last time of the recording [s]; null where there is none. */
export function span() {
  if (record.length === 0) return null;
  return { from: record.data[record.at(0) + TIME], to: record.data[record.last() + TIME] };
}

/** Takes the latest joint state, unless the recording is looked at. */
export function follow() {
  if (!shown.live) return;
  shown.time = state.time;
  shown.position.set(state.position);
  shown.velocity.set(state.velocity);
  shown.effort.set(state.effort);
  shown.setpoint.set(state.setpoint);
  shown.setpointKnown = state.setpointKnown;
}

/** Back to the arm as it is. */
export function goLive() {
  shown.live = true;
  shown.playing = false;
  follow();
  tell("playback");
}

/** Shows the recording at `time` [s], or as near to it as there is one. @param {number} time */
export function seek(time) {
  const all = span();
  if (!all) return;
  shown.live = false;
  shown.time = Math.min(all.to, Math.max(all.from, time));
  read(shown.time);
  tell("playback");
}

/** A recorded joint state back or forth. @param {1 | -1} way */
export function stepBy(way) {
  if (record.length === 0) return;
  shown.playing = false;
  // The row that is shown, or the one after a time between two rows.
  const after = shown.live ? record.length - 1 : firstAfter(shown.time);
  const isRow = record.data[record.at(after) + TIME] === shown.time;
  const row = way > 0 && !isRow ? after : after + way;
  seek(record.data[record.at(Math.min(record.length - 1, Math.max(0, row))) + TIME]);
}

/** Plays on from where it is, or from `back` seconds before now. @param {number} speed @param {number} back */
export function play(speed, back) {
  const all = span();
  if (!all) return;
  shown.speed = speed;
  if (shown.live || shown.time >= all.to) seek(all.to - back);
  shown.playing = true;
  tell("playback");
}

export function halt() {
  shown.playing = false;
  tell("playback");
}

/** Wall time goes on by `seconds`. @param {number} seconds */
export function advance(seconds) {
  if (!shown.playing) return;
  const all = span();
  const next = shown.time + seconds * shown.speed;
  if (!all || next >= all.to) goLive(); // nothing is left to play
  else seek(next);
}

function read(/** @type {number} */ time) {
  const next = Math.min(firstAfter(time), record.length - 1);
  const b = record.at(next);
  between(record.at(Math.max(0, next - 1)), b, time, shown.position, shown.velocity);
  shown.effort.set(record.data.subarray(b + EFFORT, b + EFFORT + MOST_LINKS));
  shown.setpoint.set(record.data.subarray(b + SETPOINT, b + SETPOINT + MOST_LINKS));
  shown.setpointKnown = Number.isFinite(shown.setpoint[0]);
}

let hovered = NaN;

/** The instant that the plots mark [s, simulation time]; NaN where there is none. */
export function cursor() {
  if (Number.isFinite(hovered)) return hovered;
  return shown.live ? NaN : shown.time;
}

/** @param {number} time NaN once the pointer has left */
export function hover(time) {
  if (Object.is(time, hovered)) return;
  hovered = time;
  tell("cursor");
}
