// @ts-check
// The last five minutes of the arm, one row per joint state: the source of the plots and the CSV file.
// Invariant: rows are in order of simulation time, without repeats; a reset begins anew.

import { gravityLoad, kinetic, potential } from "./mechanics.js";
import { Ring } from "./ring.js";
import { MOST_LINKS, state } from "./store.js";

/** Five minutes at 60 rows a second: 2.9 MB, taken once. */
const ROWS = 18000;

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

export const record = new Ring(ROWS, WIDTH);

/** Takes the latest joint state, if simulation time went on since the one before. */
export function take() {
  const { data } = record;
  if (record.length > 0 && state.time <= data[record.last() + TIME]) return;
  const n = state.links;
  const row = record.push();
  data[row + TIME] = state.time;
  data[row + KINETIC] = state.params ? kinetic(n, state.position, state.velocity, state.params) : NaN;
  data[row + POTENTIAL] = state.params ? potential(n, state.position, state.params) : NaN;
  data[row + ENERGY] = data[row + KINETIC] + data[row + POTENTIAL];
  for (let i = 0; i < n; i += 1) {
    data[row + POSITION + i] = state.position[i];
    data[row + SETPOINT + i] = state.setpointKnown ? state.setpoint[i] : NaN;
    data[row + VELOCITY + i] = state.velocity[i];
    data[row + EFFORT + i] = state.effort[i];
    data[row + LOAD + i] = NaN;
  }
  if (state.params) gravityLoad(n, state.position, state.params, data, row + LOAD);
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
