// @ts-check
// The timestep that each method bears in the loop in force, and the reason in words: from the loop's modes near where it rests.
// Invariant: it is said of the pose that the limit is about, for small deviations; how fast the arm moves is left to others.

import { eigenvalues } from "./eigen.js";
import { METHODS, duration, fixed, methodName, significant } from "./format.js";
import { loopInForce } from "./growth.js";
import { flow, multipliers } from "./loop.js";

/** @typedef {import("./eigen.js").Complex} Complex */
/** @typedef {import("./loop.js").Loop} Loop */
/** @typedef {Record<string, number>} Limits largest stable timestep of each method [s] */

/** Limits within this factor are said to be alike. */
const ALIKE = 1.15;
/** A step so much longer than the limit shows what grows first. */
const BEYOND = 1.02;
/** Parts of a half turn beyond which a mode changes its sign at every step. */
const NEARLY = 0.999;

/** Why the present method bears the timestep that it bears; empty while the loop is not known. */
export function whyText(/** @type {any} */ state, /** @type {Limits | null} */ limits) {
  const found = loopInForce(state);
  const method = state.integrator?.method;
  if (!found || !limits || !(limits[method] >= 0)) return "";
  const modes = eigenvalues(flow(found.loop)) ?? [];
  return found.free ? whyFree(modes, method, limits[method]) : whyServo(modes, found.loop, limits, method);
}

/** @param {Complex[]} modes @param {string} method @param {number} limit */
function whyFree(modes, method, limit) {
  const frequency = Math.max(...modes.map(({ im }) => im)) / (2 * Math.PI);
  if (!(frequency > 0)) return "";
  if (limit === 0) {
    return `Why: left to itself the arm is damped by nothing, and every step of ${methodName(method)} adds a little to each swing, `
      + "however short it is. The servo, once on, damps more than that.";
  }
  const keeps = method === "verlet" ? "keeps the energy of" : "takes hardly anything from";
  return `Why: left to itself the arm’s fastest small swing has ${significant(frequency, 3)} Hz. ${methodName(method)} ${keeps} it `
    + `up to ${duration(limit)}, ${significant(limit * frequency, 2)} of a swing; wide and fast swings bear less.`;
}

/** @param {Complex[]} modes @param {Loop} loop @param {Limits} limits @param {string} method */
function whyServo(modes, loop, limits, method) {
  const limit = limits[method];
  if (limit === 0) {
    const growth = Math.max(...modes.map(({ re }) => re));
    return growth > 0
      ? `Why: these gains don’t hold the arm here. A deviation grows ${significant(growth, 2)} per second with an ideal `
        + "controller too, so no method and no timestep helps: raise the proportional and derivative gains, or lower the integral ones."
      : "Why: nothing damps the arm here, and an effort that is held over a step comes a little late, which drives the swing: "
        + "raise the derivative gains.";
  }
  if (limit === Infinity) return "";
  return `Why ${duration(limit)}: ${cause(modes, loop, method, limit)} ${others(limits)}`;
}

/** The mode that grows first when the step is a little too long. @param {Complex[]} modes @param {Loop} loop @param {string} method @param {number} limit */
function cause(modes, loop, method, limit) {
  const step = BEYOND * limit;
  const first = largest(multipliers(loop, method, step) ?? []);
  const angle = first ? Math.abs(Math.atan2(first.im, first.re)) : 0;
  if (angle > NEARLY * Math.PI) {
    const rate = size(largest(modes) ?? { re: 0, im: 0 });
    return `the loop’s fastest mode (joint ${stiffest(loop) + 1}, by its derivative gain) dies away at ${significant(rate, 3)} per second. `
      + `An effort held for longer than ${fixed(limit * rate, 2)}/${significant(rate, 3)} s overshoots: at every step that deviation changes its sign and is larger than before.`;
  }
  if (angle > 0) {
    return `the loop has a swing of ${significant(angle / (2 * Math.PI * step), 3)} Hz. An effort held for longer than ${fixed(angle / (2 * Math.PI), 2)} of it comes `
      + "so late that it drives what it should damp; a higher derivative gain damps it more.";
  }
  return "beyond it a deviation grows without swinging.";
}

/** @param {Complex[]} values */
function largest(values) {
  return values.reduce((/** @type {Complex | null} */ a, b) => (a && size(a) >= size(b) ? a : b), null);
}

/** @param {Limits} limits */
function others(limits) {
  const finite = Object.values(limits);
  const [least, most] = [Math.min(...finite), Math.max(...finite)];
  if (most <= ALIKE * least) return "All methods bear about the same, since the hold decides, not the method; they differ in their error.";
  const best = METHODS.filter(([method]) => limits[method] > most / ALIKE).map(([, name]) => name);
  const last = best.pop();
  return best.length > 0 ? `${best.join(", ")} and ${last} bear most, ${duration(most)}.` : `${last} bears most, ${duration(most)}.`;
}

/** @param {Complex} mode */
function size({ re, im }) {
  return Math.hypot(re, im);
}

/** The joint whose derivative gain acts fastest on what it moves. @param {Loop} loop */
function stiffest({ inverse, gains }) {
  const rates = gains.kd.map((kd, i) => kd * inverse[i][i]);
  return rates.indexOf(Math.max(...rates));
}
