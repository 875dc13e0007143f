// The last five minutes of the arm, one row per joint state: the source of the plots, the trail and the CSV file.
// Invariant: rows are in order of simulation time, without repetitions. A reset clears them. The memory is
// allocated once.

import { energies, gravityLoad } from "./mechanics.js";
import { toFragment } from "./settings.js";
import { MOST_LINKS, state } from "./store.js";

/** Five minutes at 60 rows a second: 2.9 MB, allocated once. */
const ROWS = 18000;

/** Largest sum of the slopes at both ends of a smooth motion: a multiple of the change, plus an allowance at a turning point [rad]. */
const [STEEP, TURNING] = [6, 0.5];

/** The index of each quantity in a row. Per-joint ones have an entry for each of three joints. */
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

/** A ring buffer of rows of numbers. */
export const record = {
  data: new Float64Array(ROWS * WIDTH),
  length: 0, // rows
  head: 0, // the next row to write

  clear() {
    this.length = 0;
  },

  /** Reserves one row, and returns its index in `data`. */
  push() {
    const offset = this.head * WIDTH;
    this.head = (this.head + 1) % ROWS;
    this.length = Math.min(ROWS, this.length + 1);
    return offset;
  },

  /** The index of row `i` in `data`. Row 0 is the oldest. @param {number} i */
  at(i) {
    return ((this.head - this.length + i + ROWS) % ROWS) * WIDTH;
  },

  /** The index of the newest row. There must be one. */
  last() {
    return this.at(this.length - 1);
  },
};

/** Adds the latest joint state, if simulation time has advanced. */
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
 * Positions between the rows that begin at `a` and `b`, at `s` from 0 to 1, by the cubic with the velocities of both.
 * If the arm shakes, these velocities would give many turns between two rows. Then the line is straight. @param
 * {number} a @param {number} b @param {number} s @param {Float64Array} position
 */
export function between(a, b, s, position) {
  const { data } = record;
  const h = data[b + TIME] - data[a + TIME];
  for (let i = 0; i < MOST_LINKS; i += 1) {
    const start = data[a + POSITION + i];
    const change = data[b + POSITION + i] - start;
    const [v, w] = [h * data[a + VELOCITY + i], h * data[b + VELOCITY + i]];
    const isSmooth = Math.abs(v) + Math.abs(w) <= STEEP * Math.abs(change) + TURNING;
    position[i] = start + s * (isSmooth ? v + s * (3 * change - 2 * v - w + s * (v + w - 2 * change)) : change);
  }
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

/** The file's text, for an arm with `links` links. @param {number} links @param {Settings | null} settings the present ones */
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

/** The time of the newest row [s]; NaN if there is none. */
export function newest() {
  return record.length > 0 ? record.data[record.last() + TIME] : NaN;
}
