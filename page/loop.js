// @ts-check
// The loop near where it rests, as a linear system, and what one step of a method does to a small deviation.
// v̇ = -S x + M⁻¹ u, u = -kp x - kd v + ki s, ṡ = -x; S = M⁻¹ ∂G/∂q. A step is x ↦ (I + h E) x, and E is formed without
// the identity, so that growth of a trillionth part shows. The runtime's own study is the judge: these are for pictures
// that have to follow a slider, and a test compares both.
// Invariant: nothing here knows the page or the runtime.

import { eigenvalues } from "./eigen.js";
import { METHODS } from "./format.js";

/** @typedef {import("./eigen.js").Matrix} Matrix */
/** @typedef {import("./eigen.js").Complex} Complex */
/** @typedef {{gravity: number, masses: number[], lengths: number[]}} Arm */
/** @typedef {{kp: number[], ki: number[], kd: number[]}} Gains */
/** @typedef {{n: number, inverse: Matrix, sway: Matrix, gains: Gains, integrals: number[]}} Loop */

/** Order of the Runge-Kutta methods. @type {Record<string, number>} */
const ORDER = Object.fromEntries(METHODS.map(([method, , order]) => [method, order ?? NaN]));
/** Growth that rounding can feign, relative to the fastest eigenvalue. */
const NEUTRAL = 1e-11;
const SEARCH_START = 1e-3;
const SEARCH_END = 30;
const SEARCH_STEP = 1.08;

/** @param {number} rows @param {number} columns @param {(i: number, j: number) => number} entry @returns {Matrix} */
function matrix(rows, columns, entry) {
  return Array.from({ length: rows }, (_, i) => Array.from({ length: columns }, (__, j) => entry(i, j)));
}

/** @param {Matrix} a @param {Matrix} b */
function product(a, b) {
  return matrix(a.length, b[0].length, (i, j) => a[i].reduce((sum, one, k) => sum + one * b[k][j], 0));
}

/** a + factor b @param {Matrix} a @param {number} factor @param {Matrix} b */
function plus(a, factor, b) {
  return matrix(a.length, a[0].length, (i, j) => a[i][j] + factor * b[i][j]);
}

/** Mass that hangs on the end of link i, half of the link's own included: what gravity feels of it. @param {Arm} arm */
function carried({ masses }) {
  return masses.map((mass, i) => mass / 2 + masses.slice(i + 1).reduce((sum, one) => sum + one, 0));
}

/** Mass matrix M(q) [kg m²]. @param {number[]} q @param {Arm} arm @returns {Matrix} */
export function massMatrix(q, arm) {
  const n = q.length;
  const { masses, lengths } = arm;
  const load = carried(arm);
  const angles = absolute(q);
  const links = matrix(n, n, (i, j) => {
    const weight = i === j ? load[i] - masses[i] / 6 : load[Math.max(i, j)];
    return lengths[i] * lengths[j] * weight * Math.cos(angles[i] - angles[j]);
  });
  return outward(links);
}

/** ∂G/∂q [N m/rad]. @param {number[]} q @param {Arm} arm @returns {Matrix} */
export function gravityGradient(q, arm) {
  const load = carried(arm);
  const angles = absolute(q);
  return outward(matrix(q.length, q.length, (i, j) => (i === j ? -arm.gravity * arm.lengths[i] * load[i] * Math.sin(angles[i]) : 0)));
}

/** From angles of links to angles of joints: entry (a, b) gathers all links from a and from b on. @param {Matrix} links */
function outward(links) {
  const n = links.length;
  return matrix(n, n, (a, b) => {
    let sum = 0;
    for (let i = a; i < n; i += 1) for (let j = b; j < n; j += 1) sum += links[i][j];
    return sum;
  });
}

/** @param {number[]} q */
function absolute(q) {
  let phi = 0;
  return q.map((one) => (phi += one));
}

/** @param {Matrix} a @param {Matrix} b @returns {Matrix} a⁻¹ b, a symmetric and positive */
function solve(a, b) {
  const n = a.length;
  const left = a.map((row) => [...row]);
  const right = b.map((row) => [...row]);
  for (let k = 0; k < n; k += 1) {
    for (let i = 0; i < n; i += 1) {
      if (i === k) continue;
      const factor = left[i][k] / left[k][k];
      for (let j = k; j < n; j += 1) left[i][j] -= factor * left[k][j];
      for (let j = 0; j < right[i].length; j += 1) right[i][j] -= factor * right[k][j];
    }
  }
  return right.map((row, i) => row.map((one) => one / left[i][i]));
}

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

/** Where the arm rests: hanging if left to itself, else the setpoint; sagging joints are left to the runtime to say. */
export function restPose(/** @type {Arm} */ arm, /** @type {Gains} */ gains, /** @type {number[]} */ setpoint) {
  if (!isFree(gains)) return setpoint;
  return arm.gravity > 0 ? setpoint.map((_, i) => (i === 0 ? -Math.PI / 2 : 0)) : setpoint;
}

/** The loop about the pose `q`. @param {Arm} arm @param {Gains} gains @param {number[]} q @returns {Loop} */
export function loopAt(arm, gains, q) {
  const n = q.length;
  const mass = massMatrix(q, arm);
  return {
    n,
    inverse: solve(mass, matrix(n, n, (i, j) => (i === j ? 1 : 0))),
    sway: solve(mass, gravityGradient(q, arm)),
    gains,
    integrals: gains.ki.flatMap((ki, joint) => (ki > 0 ? [joint] : [])),
  };
}

/** The loop in continuous time, ẋ = A x; states: positions, velocities, integrals. @param {Loop} loop @returns {Matrix} */
export function flow({ n, inverse, sway, gains, integrals }) {
  const { kp, ki, kd } = gains;
  return matrix(2 * n + integrals.length, 2 * n + integrals.length, (i, j) => {
    if (i < n) return j === n + i ? 1 : 0;
    if (i >= 2 * n) return j === integrals[i - 2 * n] ? -1 : 0;
    const row = i - n;
    if (j < n) return -sway[row][j] - inverse[row][j] * kp[j];
    if (j < 2 * n) return -inverse[row][j - n] * kd[j - n];
    const joint = integrals[j - 2 * n];
    return inverse[row][joint] * ki[joint];
  });
}

/** The arm with constant efforts; states: positions, velocities, efforts. @param {Loop} loop @returns {Matrix} */
function plant({ n, inverse, sway }) {
  return matrix(3 * n, 3 * n, (i, j) => {
    if (i < n) return j === n + i ? 1 : 0;
    if (i >= 2 * n) return 0;
    if (j < n) return -sway[i - n][j];
    return j < 2 * n ? 0 : inverse[i - n][j - 2 * n];
  });
}

/** A + h/2 A² + … + h^(p-1)/p! A^p, by Horner's rule. @param {Matrix} a @param {number} order @param {number} h */
function rungeKutta(a, order, h) {
  let sum = a;
  for (let k = order; k > 1; k -= 1) sum = plus(a, h / k, product(a, sum));
  return sum;
}

/** Velocity Verlet, its predictor and one correction. @param {Matrix} a @param {number} n @param {number} h */
function verlet(a, n, h) {
  const isVelocity = (/** @type {number} */ row) => row >= n && row < 2 * n;
  const second = plus(a, h / 2, product(a, a));
  const predicted = a.map((row, i) => (isVelocity(i) ? row : second[i]));
  const mean = plus(a, h / 2, product(a, predicted));
  return a.map((_, i) => (isVelocity(i) ? mean[i] : second[i]));
}

/**
 * E of a step x ↦ (I + h E) x, control held over the step or in every stage.
 * @param {Loop} loop @param {string} method @param {number} h @param {boolean} held @returns {Matrix}
 */
export function generator(loop, method, h, held) {
  const { n, gains, integrals } = loop;
  const stepped = held ? plant(loop) : flow(loop);
  const free = method === "verlet" ? verlet(stepped, n, h) : rungeKutta(stepped, ORDER[method], h);
  if (!held) return free;
  const { kp, ki, kd } = gains;
  const size = 2 * n + integrals.length;
  return matrix(size, size, (i, j) => {
    if (i >= 2 * n) return j === integrals[i - 2 * n] ? -1 : 0;
    if (j < n) return free[i][j] - free[i][2 * n + j] * (kp[j] + h * (integrals.includes(j) ? ki[j] : 0));
    if (j < 2 * n) return free[i][j] - free[i][n + j] * kd[j - n];
    const joint = integrals[j - 2 * n];
    return free[i][2 * n + joint] * ki[joint];
  });
}

/** By what a step multiplies each mode of a deviation. @returns {Complex[] | null} */
export function multipliers(/** @type {Loop} */ loop, /** @type {string} */ method, /** @type {number} */ h, held = true) {
  const values = eigenvalues(generator(loop, method, h, held));
  return values && values.map(({ re, im }) => ({ re: 1 + h * re, im: h * im }));
}

/** Growth of the fastest mode, max(2 Re μ + h |μ|²) relative to the largest |μ|; NaN if not finite. */
function growth(/** @type {Loop} */ loop, /** @type {string} */ method, /** @type {number} */ h, /** @type {boolean} */ held) {
  const values = eigenvalues(generator(loop, method, h, held));
  if (!values) return NaN;
  const fastest = Math.max(...values.map(({ re, im }) => Math.hypot(re, im)));
  return fastest === 0 ? 0 : Math.max(...values.map(({ re, im }) => (2 * re + h * (re * re + im * im)) / fastest));
}

/**
 * The end of the stable timesteps that begin at zero [s]: 0 where none is stable, infinite where none is found unstable.
 * @param {Loop} loop @param {string} method @param {boolean} held
 */
export function limitOf(loop, method, held = true) {
  const stable = (/** @type {number} */ h) => growth(loop, method, h, held) <= NEUTRAL;
  const rate = Math.max(0, ...(eigenvalues(flow(loop)) ?? []).map(({ re, im }) => Math.hypot(re, im)));
  if (rate === 0) return Infinity;
  let low = SEARCH_START / rate;
  if (!stable(low)) return 0;
  while (low * rate < SEARCH_END) {
    let high = low * (low * rate < 0.1 ? 2 : SEARCH_STEP);
    if (stable(high)) {
      low = high;
      continue;
    }
    for (let k = 0; k < 24; k += 1) {
      const middle = Math.sqrt(low * high);
      if (stable(middle)) low = middle;
      else high = middle;
    }
    return low;
  }
  return Infinity;
}

/** |R(z)| of a Runge-Kutta method, ẋ = λ x with z = h λ; of Verlet, of a swing with the pair z and its conjugate. */
export function amplification(/** @type {string} */ method, /** @type {number} */ re, /** @type {number} */ im) {
  if (method === "verlet") {
    const values = eigenvalues(verlet([[0, 1], [-(re * re + im * im), 2 * re]], 1, 1));
    return values ? Math.max(...values.map((one) => Math.hypot(1 + one.re, one.im))) : Infinity;
  }
  let [sumRe, sumIm] = [1, 0];
  for (let k = ORDER[method]; k > 0; k -= 1) [sumRe, sumIm] = [1 + (re * sumRe - im * sumIm) / k, (re * sumIm + im * sumRe) / k];
  return Math.hypot(sumRe, sumIm);
}
