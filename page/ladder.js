// @ts-check
// Error against run time: which runs to ask for, and what their answers say.
// Invariant: a run without an error is told apart from one that diverged; neither becomes a number.

import { METHODS, significant } from "./format.js";

/** Timesteps, from long to short, each half of the one before [s]. */
export const TIMESTEPS = Array.from({ length: 8 }, (_, k) => 0.032 / 2 ** k);

/**
 * @typedef {{method: string, timestep: number, error: number | null, sampling: number | null, uncertainty: number | null, wall: number, evaluations: number, divergedAt: number | null}} Rung
 * `error` is the cost of the method, `sampling` that of a control law that runs once a step [rad]
 */

/** All runs, the cheapest first, so that the picture grows evenly. @returns {{method: string, timestep: number}[]} */
export function rungs() {
  return TIMESTEPS.flatMap((timestep) => METHODS.map(([method]) => ({ method, timestep })));
}

/**
 * @param {{method: string, timestep: number}} rung
 * @param {{times: number[], error: number | null, error_uncertainty?: number | null, sampling_error?: number | null, wall_time: number, evaluations: number}} values
 * @param {number} duration that was asked for [s]
 * @returns {Rung}
 */
export function read({ method, timestep }, values, duration) {
  const divergedAt = endOf(values.times, duration, timestep);
  const finite = (/** @type {number | null | undefined} */ value) => (divergedAt === null && Number.isFinite(value) ? /** @type {number} */ (value) : null);
  return {
    method,
    timestep,
    error: finite(values.error),
    sampling: finite(values.sampling_error),
    uncertainty: Number.isFinite(values.error_uncertainty) ? /** @type {number} */ (values.error_uncertainty) : null,
    wall: values.wall_time,
    evaluations: values.evaluations,
    divergedAt,
  };
}

/** The runtime gives no error below this many times its uncertainty. */
const CLEAR = 4;
/** An uncertainty of the reference beyond this is of a motion that it could not follow [rad]. */
const FOLLOWED = 1e-3;

/** A run's row in the table. @param {Rung} rung */
export function errorText({ error, uncertainty, divergedAt }) {
  if (divergedAt !== null) return `diverged at ${significant(divergedAt, 3)} s`;
  if (error !== null) return significant(error, 2);
  if (uncertainty === null) return "no figure";
  return uncertainty < FOLLOWED ? `< ${significant(CLEAR * uncertainty, 1)}` : "too wild to follow";
}

/** How far the reference itself may be off [rad]; null if no run says. @param {Rung[]} rungs */
export function uncertaintyOf(rungs) {
  const known = rungs.flatMap(({ uncertainty }) => (uncertainty === null ? [] : [uncertainty]));
  return known.length > 0 ? Math.max(...known) : null;
}

/** When a run ended before its time, because it diverged [s]; null if it did not. @param {number[]} times @param {number} duration @param {number} timestep */
export function endOf(times, duration, timestep) {
  const last = times.at(-1) ?? 0;
  return last < duration - timestep * (1 + 1e-6) ? last : null;
}

/** For each method the cheapest run that is as good as `wanted` [rad]. @param {Rung[]} rungs @param {number} wanted */
export function cheapest(rungs, wanted) {
  const good = rungs.filter(({ error }) => error !== null && error <= wanted);
  return METHODS.flatMap(([method]) => {
    const own = good.filter((one) => one.method === method).sort((a, b) => a.wall - b.wall);
    return own.length > 0 ? [own[0]] : [];
  });
}
