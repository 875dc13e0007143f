// @ts-check
// The gains of a controller: none, a multiple, and whether one set is a multiple of another.
// Invariant: nothing here knows the page or the runtime; how a loop behaves is the study's to say.

/** @typedef {{gravity: number, masses: number[], lengths: number[]}} Arm */
/** @typedef {{kp: number[], ki: number[], kd: number[]}} Gains */

/** @param {Gains} gains */
export function isFree(gains) {
  return [...gains.kp, ...gains.ki, ...gains.kd].every((one) => one === 0);
}

/** @param {number} n @returns {Gains} */
export function noGains(n) {
  return { kp: new Array(n).fill(0), ki: new Array(n).fill(0), kd: new Array(n).fill(0) };
}

/** @param {Gains} gains @param {number} factor @returns {Gains} */
export function scaled(gains, factor) {
  const times = (/** @type {number[]} */ list) => list.map((one) => factor * one);
  return { kp: times(gains.kp), ki: times(gains.ki), kd: times(gains.kd) };
}

/** Gains are sent with three digits. */
const ROUNDED = 0.02;

/** By what `gains` are a multiple of `base`; NaN if they are none. @param {Gains | null} gains @param {Gains | null} base */
export function factorOf(gains, base) {
  if (!gains || !base || gains.kp.length !== base.kp.length) return NaN;
  const pairs = /** @type {const} */ (["kp", "ki", "kd"]).flatMap((key) => gains[key].map((one, i) => [one, base[key][i]]));
  const found = pairs.filter(([, one]) => one > 0).map(([a, b]) => a / b);
  const isMultiple = found.length > 0 && pairs.every(([a, b]) => (b > 0 ? Math.abs(a / b / found[0] - 1) < ROUNDED : a === 0));
  return isMultiple ? found[0] : NaN;
}
