// @ts-check
// Why the present method has the limit that it has, in words, from the study's answers alone.
// Invariant: a reason is given only for the loop in force, and only once every method's answer is there.

import { METHODS, duration, methodName, significant } from "./format.js";
import { isFree } from "./gains.js";

/** @typedef {Record<string, number>} Limits largest stable timestep of each method [s] */

/** Limits within this factor are said to be alike. */
const ALIKE = 1.15;
/** The study looks at what grows at so many times the limit. */
const BEYOND = 1.1;
/** Steps in one swing of a deviation that flips at every step. */
const FLIP = 2;
const NEARLY = 0.99;

/** @param {any} state @param {any} answer of the present method, null while it is not known @param {Limits} limits */
export function whyText(state, answer, limits) {
  const method = state.integrator?.method;
  if (!answer || !(limits[method] >= 0)) return "";
  const limit = limits[method];
  if (state.enabled === false || isFree(state.gains)) return whyFree(answer, method, limit);
  if (limit === Infinity) return "";
  if (limit === 0) {
    return answer.equilibrium_kind === "unstable" || answer.timestep_limit_continuous === 0
      ? "Why: these gains do not hold the arm here, with any method and any timestep. Raise the derivative gains, or lower the integral gains."
      : "Why: nothing damps the arm here, and a torque that is kept for a step comes a little late. Raise the derivative gains.";
  }
  return `Why ${duration(limit)}: ${cause(answer)} ${others(limits)}`;
}

/** @param {any} answer @param {string} method @param {number} limit */
function whyFree({ critical }, method, limit) {
  if (limit === 0) return `Why: nothing damps the free arm. Every step of ${methodName(method)} adds a little to each swing, however short the step is.`;
  if (limit === Infinity || !critical) return "";
  return `Why: beyond ${duration(limit)} ${methodName(method)} no longer follows the fastest small swing of the free arm. Wide and fast swings have a smaller limit.`;
}

/** The motion that grows first beyond the smallest limit of all poses. @param {any} answer */
function cause({ critical, minimum_over_poses_held: least }) {
  if (!critical || !(least > 0)) return "beyond it a deviation grows.";
  const joint = `joint ${critical.joint + 1}`;
  const percent = significant(100 * (critical.growth_per_step - 1), 2);
  const flips = critical.frequency * FLIP * BEYOND * least > NEARLY;
  if (flips) return `${joint} is the fastest. A torque that is kept longer overshoots: 10 % beyond the limit the deviation flips at every step and grows by ${percent} %.`;
  return `a swing of ${joint} at ${significant(critical.frequency, 3)} Hz grows first: the torque comes too late and drives it. A higher derivative gain damps it.`;
}

/** @param {Limits} limits */
function others(limits) {
  const finite = Object.values(limits);
  const [least, most] = [Math.min(...finite), Math.max(...finite)];
  if (most <= ALIKE * least) return "A better method does not help: the controller looks only once a step. Methods differ in their error.";
  const best = METHODS.filter(([method]) => limits[method] > most / ALIKE).map(([, name]) => name);
  return `${best.join(", ")}: stable up to ${duration(most)}.`;
}
