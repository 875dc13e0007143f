// The last five minutes of the arm, one row per joint state: the source of the plots, the trail and the CSV file.
// Invariant: rows are in order of simulation time, without repetitions. A reset clears them. The memory is allocated once.

import { exact } from "./format.js";
import { energies, gravityLoad } from "./mechanics.js";
import { questionOf, rolloutArgs } from "./question.js";
import { toFragment } from "./settings.js";
import { MOST_LINKS, state } from "./store.js";

const ROWS = 18000; // five minutes at 60 rows a second: 2.9 MB, allocated once

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
 * Positions between the rows that begin at `a` and `b`, at `s` from 0 to 1, by the cubic with the velocities of both. If the arm shakes, these velocities would
 * give many turns between two rows. Then the line is straight. @param {number} a @param {number} b @param {number} s @param {Float64Array} position
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

/** Quantities of each joint: name, unit, first column. @type {[string, string, number][]} */
const QUANTITIES = [
  ["position", "rad", POSITION],
  ["setpoint", "rad", SETPOINT],
  ["velocity", "rad/s", VELOCITY],
  ["effort", "N m", EFFORT],
  ["gravity_load", "N m", LOAD],
];

/** The columns of an arm with `links` links, each with its name and unit, in the order of the file. @param {number} links @returns {[number, string][]} */
function columnsOf(links) {
  /** @type {[number, string][]} */
  const joints = QUANTITIES.flatMap(([name, unit, first]) => Array.from({ length: links }, (_, i) => [first + i, `${name}${i + 1} [${unit}]`]));
  return [[TIME, "time [s]"], ...joints, [KINETIC, "kinetic [J]"], [POTENTIAL, "potential [J]"], [ENERGY, "energy [J]"]];
}

/** The file's text, for an arm with `links` links. @param {number} links @param {Settings | null} settings the present ones */
export function csvText(links, settings) {
  const columns = columnsOf(links);
  const about = settings ? toFragment(settings, links).split("&").map((one) => `# ${one}`) : [];
  const rows = rowsOf(columns.map(([column]) => column), 0, record.length).map((row) => row.map(exact).join(","));
  return ["# pendularm; settings as they were when this was saved", ...about, columns.map(([, name]) => name).join(","), ...rows, ""].join("\r\n");
}

/** These columns of the rows from `first` to before `last`. @param {number[]} columns */
function rowsOf(columns, first, last) {
  return Array.from({ length: Math.max(0, last - first) }, (_, i) => columns.map((column) => record.data[record.at(first + i) + column]));
}

const COMPUTED = /^(time|position|velocity|effort|energy)/; // what a run of the study has, too

/** The recorded rows up to a time, to be copied; null without a motion. @param {string} name @param {{now: number, span: number}} time [s] */
export function recorded(name, { now, span }) {
  const [first, last] = [firstAfter(now - span), Math.min(record.length, firstAfter(now) + 1)];
  const question = questionOf(state);
  if (last - first < 2 || !question) return null;
  const columns = columnsOf(state.links);
  const rows = rowsOf(columns.map(([column]) => column), first, last);
  const start = (/** @type {number} */ column) => question.q.map((_, joint) => record.data[record.at(first) + column + joint]);
  const run = { duration: rows[rows.length - 1][0] - rows[0][0], samples: rows.length };
  return {
    name, columns: columns.map(([, one]) => one), rows, asked: [rolloutArgs({ ...question, q: start(POSITION), qd: start(VELOCITY) }, run)],
    python: `zip(${rows[0][0]} + runs[0].times, *runs[0].positions.T, *runs[0].velocities.T, *runs[0].efforts.T, runs[0].energy)`,
    computed: columns.map(([, one]) => one).filter((one) => COMPUTED.test(one)),
    note: "The table is the recorded motion. Python computes a motion from its first row, with the present settings and no sum of the integral yet.",
  };
}

/** The time of the newest row [s]; NaN if there is none. */
export function newest() {
  return record.length > 0 ? record.data[record.last() + TIME] : NaN;
}
