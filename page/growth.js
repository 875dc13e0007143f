// @ts-check
// How fast a small deviation grows at the present timestep, in words.
// Invariant: it is said of the loop in force, about the pose that its limit is about.

import { significant } from "./format.js";
import { isFree, loopAt, multipliers, noGains, restPose } from "./loop.js";
import { answerInForce } from "./policy.js";

/** Doubling times beyond this are no news [s]. */
const LONGEST = 3600;
/** Growth in one step that rounding can feign. */
const ROUNDING = 1e-13;

/** The loop in force about the pose where it rests; null while it is not known. */
export function loopInForce(/** @type {any} */ state) {
  const { links, params, gains, enabled, setpoint } = state;
  if (!params || !gains || enabled == null || gains.kp.length !== links || params.masses.length !== links) return null;
  const acting = enabled ? gains : noGains(links);
  const pose = answerInForce(state)?.equilibrium ?? restPose(params, acting, Array.from(setpoint.subarray(0, links)));
  return { loop: loopAt(params, acting, pose), free: isFree(acting), pose };
}

/** Growth of the fastest mode [1/s]; NaN while it is not known. */
export function growthRate(/** @type {any} */ state) {
  const found = loopInForce(state);
  if (!found || !state.integrator) return NaN;
  const { method, timestep } = state.integrator;
  const values = multipliers(found.loop, method, timestep);
  if (!values) return Infinity;
  return Math.log(Math.max(...values.map(({ re, im }) => Math.hypot(re, im)))) / timestep;
}

/** A sentence, or nothing where nothing grows to speak of. */
export function growthOf(/** @type {any} */ state) {
  const rate = growthRate(state);
  if (!(rate * state.integrator?.timestep > ROUNDING)) return "";
  const seconds = Math.LN2 / (2 * rate);
  return seconds < LONGEST
    ? `The energy of a small swing doubles every ${significant(seconds, 2)} s.`
    : "So slowly that it is nothing within an hour.";
}
