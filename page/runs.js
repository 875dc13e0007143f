// @ts-check
// The figures of a comparison's runs: how far each lies from the reference over time, where it ended, what it gained.
// Invariant: nothing is computed from what is not there; a run that ended early has figures up to its end, and says when.

import { duration, fixed, shortName, significant } from "./format.js";
import { endOf } from "./ladder.js";
import { resample } from "./resample.js";

/**
 * @typedef {object} Run
 * @property {string} method
 * @property {number} timestep
 * @property {number[]} times
 * @property {number[][]} positions
 * @property {number[][]} velocities
 * @property {(number | null)[]} energy
 * @property {number} evaluations
 * @property {number} wall_time
 */

/** The last entry that is a number, and its place; null if there is none. @param {(number | null)[]} list */
function lastNumber(list) {
  for (let k = list.length - 1; k >= 0; k -= 1) if (Number.isFinite(list[k])) return { k, value: /** @type {number} */ (list[k]) };
  return null;
}

/** When the run diverged [s]; null if it lasted. @param {Run} run @param {number} seconds */
export function divergedAt(run, seconds) {
  return endOf(run.times, seconds, run.timestep);
}

/** Energy at the end less that at the start [J]; null where the run did not last. @param {Run} run @param {number} seconds */
export function energyGained(run, seconds) {
  if (divergedAt(run, seconds) !== null) return null;
  const [first, last] = [run.energy[0], lastNumber(run.energy)];
  return first === null || first === undefined || !last ? null : last.value - first;
}

/**
 * The largest difference of a joint from the reference, at each of the reference's instants [rad]; null where one has ended.
 * @param {Run} run @param {Run} reference @returns {(number | null)[]}
 */
export function distances(run, reference) {
  const own = resample(run, reference.times);
  return reference.times.map((_, k) => {
    const [a, b] = [own[k], reference.positions[k]];
    if (!a || !b?.every(Number.isFinite)) return null;
    return Math.max(...a.map((q, i) => Math.abs(q - b[i])));
  });
}

/** A line of the table. @param {Run} run @param {(number | null)[]} away @param {number} seconds */
export function describeRun(run, away, seconds) {
  const ended = divergedAt(run, seconds);
  const gained = energyGained(run, seconds);
  const known = /** @type {number[]} */ (away.filter((one) => one !== null));
  return {
    name: `${shortName(run.method)}, ${duration(run.timestep)}`,
    outcome: ended === null ? "lasts" : `diverged at t = ${fixed(ended, 2)} s`,
    energy: gained === null ? "–" : `${significant(gained, 3)} J`,
    error: ended !== null || known.length === 0 ? "–" : `${significant(Math.max(...known), 3)} rad`,
    evaluations: significant(run.evaluations, 6),
    time: duration(run.wall_time),
  };
}

/** When runs have parted by more than `wanted` [rad] for the first time [s]; null if never. */
export function partsAt(/** @type {number[]} */ times, /** @type {(number | null)[]} */ away, wanted = 0.1) {
  const k = away.findIndex((one) => one !== null && one > wanted);
  return k < 0 ? null : times[k];
}
