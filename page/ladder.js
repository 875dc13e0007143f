// Figures of offline runs. Error against run time: the requested runs and their results. A comparison: the distance of each run
// from the reference over time, its end, and its energy gain.
// Invariant: a run without an error and a diverged run are shown differently, and neither as a number. A run that ended early
// has figures up to its end, with its time.

import { duration, fixed, METHODS, shortName, significant } from "./format.js";
import { fromRest, isFree } from "./question.js";

/** @typedef {import("./question.js").Question} Question */

const MOST = 8; // the most timesteps in a series
const SHORTEST = 1e-4; // the shortest one of a usual control period [s]
const LEAST = 4; // the fewest timesteps

/**
 * Timesteps from long to short, each half of the previous one [s]. All divide the control period, because the effective period would
 * differ otherwise, and with it the controller. A period of 0 is every step.
 */
export function timestepsFor(period = 0) {
  const all = Array.from({ length: MOST }, (_, k) => (period > 0 ? period : 0.032) / 2 ** k);
  return all.filter((timestep, k) => timestep >= SHORTEST || k < LEAST);
}

/**
 * @typedef {{method: string, timestep: number, error: number | null, sampling: number | null, uncertainty: number | null, wall:
 * number, evaluations: number, divergedAt: number | null}} Rung
 */

/**
 * All runs, the cheapest first, so the picture grows steadily. @param {number} [period] of the controller [s] @returns {{method: string, timestep: number}[]}
 */
export function rungs(period = 0) {
  return timestepsFor(period).flatMap((timestep) => METHODS.map(([method]) => ({ method, timestep })));
}

/**
 * @param {{method: string, timestep: number}} rung @param {{error: number | null, sampling_error?: number | null,
 * error_uncertainty?: number | null, wall_time: number, evaluations: number, divergence?: {time: number} | null}} values
 * @returns {Rung}
 */
export function read({ method, timestep }, values) {
  const divergedAt = endOf(values);
  const isWhole = divergedAt === null;
  return {
    method,
    timestep,
    error: isWhole && Number.isFinite(values.error) ? values.error : null,
    sampling: isWhole && Number.isFinite(values.sampling_error) ? /** @type {number} */ (values.sampling_error) : null,
    uncertainty: Number.isFinite(values.error_uncertainty) ? /** @type {number} */ (values.error_uncertainty) : null,
    wall: values.wall_time,
    evaluations: values.evaluations,
    divergedAt,
  };
}

/** An error below four times its uncertainty is not given. With the uncertainty, and a digit rounded down, it is below this many. */
const CLEAR = 8;
const FOLLOWED = 1e-3; // with a larger uncertainty the reference could not follow the motion [rad]

/** A run's cell in the table: the error of the method, and with a controller the error of the hold. @param {Rung} rung */
export function errorText({ error, sampling, uncertainty, divergedAt }) {
  if (divergedAt !== null) return `diverged at ${significant(divergedAt, 3)} s`;
  if (error !== null) return `${significant(error, 2)}${sampling === null ? "" : ` + ${significant(sampling, 2)}`}`;
  if (uncertainty === null) return "no figure";
  return uncertainty < FOLLOWED ? `< ${significant(CLEAR * uncertainty, 1)}` : "too wild to follow";
}

/** The error of the whole run: the larger of the two known errors [rad]; null if none is known. @param {Rung} rung */
export function total({ error, sampling }) {
  return error == null && sampling == null ? null : Math.max(error ?? 0, sampling ?? 0);
}

/** The measured move, always the same so that results can be compared: from rest, stretched out. @type {Record<number, number[]>} */
export const MOVE_TO = { 2: [0.9, -1.3], 3: [0.9, -1.3, 0.8] };

/** The measured move of a loop; a free arm swings from the same start. @param {Question} question @returns {Question} */
export function moveOf(question) {
  return { ...fromRest(question), ...(isFree(question.gains) ? {} : { setpoint: MOVE_TO[question.q.length] }) };
}

/** A text for a move from rest, with the settings that its result depends on. @param {Question} move @param {number} seconds */
export function stamp({ params, gains, setpoint, control_period: period, delay }, seconds) {
  const list = (/** @type {number[]} */ values) => values.map((one) => significant(one, 3)).join(", ");
  const arm = `masses ${list(params.masses)} kg, lengths ${list(params.lengths)} m, gravity ${significant(params.gravity, 3)} m/s²`;
  const start = `${seconds} s from rest, stretched out`;
  if (isFree(gains)) return `Free swing, ${start}; ${arm}.`;
  const clock = `${period > 0 ? `every ${duration(period)}` : "at every step"}${delay ? ", delayed" : ""}`;
  return `Move to (${list(setpoint)}) rad, ${start}; controller ${clock}, kp ${list(gains.kp)}, ki ${list(gains.ki)}, kd ${list(gains.kd)}; ${arm}.`;
}

/** The uncertainty of the reference [rad]; null if no run has it. @param {Rung[]} rungs */
export function uncertaintyOf(rungs) {
  const known = rungs.flatMap(({ uncertainty }) => (uncertainty === null ? [] : [uncertainty]));
  return known.length > 0 ? Math.max(...known) : null;
}

/** The time at which a run diverged [s]; null if it did not. @param {{divergence?: {time: number} | null}} values of the answer */
export function endOf({ divergence }) {
  return divergence?.time ?? null;
}

/** For each method the cheapest run with an error of at most `wanted` [rad]. @param {Rung[]} rungs @param {number} wanted */
export function cheapest(rungs, wanted) {
  const good = rungs.filter((one) => (total(one) ?? Infinity) <= wanted);
  return METHODS.flatMap(([method]) => {
    const own = good.filter((one) => one.method === method).sort((a, b) => a.wall - b.wall);
    return own.length > 0 ? [own[0]] : [];
  });
}

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
 * @property {{time: number} | null} [divergence]
 */

/**
 * The largest difference of a joint from the reference at each common sample [rad]; null if one has ended.
 * @param {Run} run @param {Run} reference @returns {(number | null)[]}
 */
export function distances(run, reference) {
  return reference.times.map((_, k) => {
    const [a, b] = [run.positions[k], reference.positions[k]];
    if (!a?.every(Number.isFinite) || !b?.every(Number.isFinite)) return null;
    return Math.max(...a.map((q, i) => Math.abs(q - b[i])));
  });
}

const PARTED = 0.1; // at a larger distance it is another motion [rad]

/** A line of the table. A run is judged only by a reference that lasts as long. @param {Run} run @param {(number | null)[]} away */
export function describeRun(run, away) {
  const ended = endOf(run);
  const gained = (run.energy.at(-1) ?? NaN) - (run.energy[0] ?? NaN); // an energy that overflowed is null
  const parts = run.times[away.findIndex((one) => Number(one) > PARTED)];
  const isJudged = ended === null && run.times.every((_, k) => away[k] != null);
  return {
    name: shortName(run.method),
    outcome: ended !== null ? `diverged at t = ${fixed(ended, 2)} s` : !isJudged ? "–" : parts === undefined ? `within ${PARTED} rad`
      : `${PARTED} rad off from ${fixed(parts, 2)} s on`,
    energy: ended !== null || !Number.isFinite(gained) ? "–" : `${significant(gained, 3)} J`,
    error: isJudged ? `${significant(Math.max(...away.map(Number)), 3)} rad` : "–",
    evaluations: significant(run.evaluations, 6),
    time: duration(run.wall_time),
  };
}
