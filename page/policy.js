// A verdict on the present timestep: the limit of the loop in force, where it holds, and both verdict and reason in words.
// Invariant: a figure is used only for the loop that it was asked about; while the answer is on its way there is none.

import { duration, fixed, methodName, METHODS, significant } from "./format.js";

/** @typedef {"offline" | "diverged" | "unknown" | "never" | "beyond" | "here" | "stable"} Kind */
/**
 * @typedef {object} Verdict
 * @property {Kind} kind
 * @property {string} pill a few words
 * @property {string} sentence all of it
 * @property {number} limit largest stable timestep [s]: 0 none, Infinity any, NaN not known
 * @property {number} advised timestep to offer [s]; NaN where there is none
 * @property {string} where what pose or speed the limit is about
 * @property {boolean} slow whether the verdict is about a control period longer than the timestep
 */

/** Share of a limit that is advised, as the runtime does. */
const SHARE = 0.8;
/** Share of a timestep that is advised where the arm diverged below every limit that is known. */
const AFTER_DIVERGENCE = 0.5;
/** A free swing that takes longer to double its energy loses its sense for other reasons first [s]. */
const SLOW_GROWTH = 600;

/** The loop in force, as the study is asked about it for one method at a time: with the controller off it is the arm left to itself. */
export function question(/** @type {any} */ { links, integrator, gains, params, enabled, setpoint, setpointKnown, period }) {
  if (!integrator || !gains || !params || enabled == null || gains.kp.length !== links) return null;
  return {
    params,
    gains: enabled ? gains : noGains(links),
    ...(enabled && period?.period > 0 ? { control_period: period.period } : {}),
    ...(enabled && setpointKnown ? { setpoint: Array.from(setpoint.subarray(0, links)) } : {}),
  };
}

/** The study's answer for a method, if it is about the loop in force; null while it is not. */
export function answerInForce(/** @type {any} */ state, /** @type {string} */ method = state.integrator?.method) {
  const asked = question(state);
  return asked && state.limits.loop === JSON.stringify(asked) ? state.limits.answers[method] ?? null : null;
}

/** Parts of a limit that are no news. */
const NEWS = 0.05;

/** Whether the motion has another limit than when the study was last asked: that limit changes as the arm moves. */
export function motionHasChanged(/** @type {any} */ answer, /** @type {any} */ diagnostics) {
  const [then, now] = [answer?.timestep_limit_motion, diagnostics?.timestep_limit_motion];
  if (then === undefined || !(now > 0)) return false;
  return open(then) !== now && !(Math.abs(now / open(then) - 1) < NEWS);
}

/** A limit as it is served: nothing limits where it is null. @param {number | null | undefined} served */
function open(served) {
  return served ?? Infinity;
}

/** The limit of the loop in force with a method [s], and what pose or speed it is about. */
export function limitInForce(/** @type {any} */ state, /** @type {string} */ method = state.integrator?.method) {
  const answer = answerInForce(state, method);
  const free = state.enabled === false || (state.gains != null && isFree(state.gains));
  const { links } = state;
  if (!answer) return { limit: NaN, where: "", everyPose: NaN, advised: NaN };
  const diverged = state.diagnostics?.state === "diverged";
  const held = free && doublingTime(method, state.integrator.timestep, answer) > SLOW_GROWTH ? Infinity : heldLimit(state, answer);
  const fast = diverged || state.integrator?.timestep > held;
  const before = state.limits.motions[method];
  // An arm that has diverged, or shakes, is fast because of that: its motion before that counts.
  const motion = fast ? before?.limit ?? Infinity : open(answer.timestep_limit_motion);
  const speed = fast ? before?.speed : answer.motion_speed;
  const pose = answer.equilibrium ?? (free ? null : state.setpoint.subarray(0, links));
  const named = pose ? `(${Array.from(pose, (q) => fixed(q, 2)).join(", ")}) rad` : "";
  const places = {
    setpoint: `at the setpoint ${named}`, sagging: `where it sags to, ${named}`, saddle: `where it falls to, ${named}`,
    hanging: state.params.gravity > 0 ? "hanging, small swings" : "without gravity, slow turns", unstable: `at ${named}, where the gains themselves are at fault`,
  };
  const place = places[/** @type {keyof typeof places} */ (answer.equilibrium_kind ?? (free ? "hanging" : "setpoint"))];
  const moving = motion < held;
  const inForce = Math.min(held, motion);
  const usual = free ? SHARE * inForce : Math.min(afterReset(answer), SHARE * motion);
  return {
    limit: inForce,
    where: moving ? `moving at ${significant(speed ?? NaN, 3)} rad/s` : place,
    everyPose: free ? inForce : Math.min(inForce, open(answer.minimum_over_poses_held)),
    // Never the timestep at which the arm has just diverged.
    advised: diverged ? Math.min(usual, AFTER_DIVERGENCE * state.integrator.timestep) : usual,
  };
}

/** The timestep's limit at the control period in force. Where the period itself is too long no timestep helps, and the limit of a law at every step stays. */
function heldLimit(/** @type {any} */ state, /** @type {any} */ answer) {
  const own = open(answer.timestep_limit);
  return state.period?.period > 0 && answer.timestep_limit !== undefined && own > 0 ? own : open(answer.timestep_limit_held);
}

/** Keeps an answer of the study about the loop in force, of which `asked` is the text. */
export function keepAnswer(/** @type {any} */ state, /** @type {string} */ asked, /** @type {string} */ method, /** @type {any} */ answer) {
  if (state.limits.loop !== asked) state.limits = { loop: asked, answers: {}, motions: {} };
  const { answers, motions } = state.limits;
  answers[method] = answer;
  // A simulation that runs away is fast because of that, from the first answer on: the motion's limit is the one from before.
  const isAway = state.diagnostics?.state === "diverged" || (state.enabled && state.integrator.timestep > open(answer?.timestep_limit_held));
  if (answer && !isAway) motions[method] ??= { limit: open(answer.timestep_limit_motion), speed: answer.motion_speed };
}

/**
 * By when Euler or midpoint double the energy of the fastest small free swing, at a timestep [s]; 0 for other methods and other loops.
 * A step multiplies the swing by 1 + iz or by 1 - z²/2 + iz, with z = timestep times its angular frequency.
 */
export function doublingTime(/** @type {string} */ method, /** @type {number} */ timestep, /** @type {any} */ answer) {
  if (answer?.timestep_limit_held !== 0 || !answer.critical || !["euler", "midpoint"].includes(method)) return 0;
  const z = timestep * 2 * Math.PI * answer.critical.frequency;
  return (Math.LN2 * timestep) / Math.log1p(method === "euler" ? z * z : z ** 4 / 4);
}

/**
 * The largest stable control period [s]: 0 none, Infinity any, NaN not known, as while no controller acts.
 * An answer that names none is about a control law that runs at every step, without a delay: there it is the timestep's limit.
 */
export function controlPeriodLimit(/** @type {any} */ state) {
  const answer = answerInForce(state);
  if (!answer || !state.enabled || isFree(state.gains)) return NaN;
  if (answer.control_period_limit !== undefined) return open(answer.control_period_limit);
  return state.period?.delay ? NaN : open(answer.timestep_limit_held);
}

/** Timesteps from one control update to the next, as the runtime counts them: at least 1. */
export function stepsPerUpdate(/** @type {any} */ { period, integrator }) {
  return Math.max(1, Math.round((period?.period ?? 0) / integrator.timestep));
}

/** The control period in force, in few words; empty where the control law runs at every step without a delay. */
export function periodText(/** @type {any} */ state) {
  const { period, integrator } = state;
  if (!period || !integrator) return "";
  const steps = stepsPerUpdate(state);
  const often = steps > 1 ? [`${steps} steps`, duration(steps * integrator.timestep)] : [];
  return [...often, ...(period.delay ? ["delayed"] : [])].join(", ");
}

/** @returns {Verdict} */
export function verdict(/** @type {any} */ state) {
  const { limit: timestepLimit, where, everyPose, advised } = limitInForce(state);
  const { timestep = NaN } = state.integrator ?? {};
  const steps = state.enabled && state.integrator ? stepsPerUpdate(state) : 1;
  const slow = steps > 1;
  const longest = steps * timestep;
  const limit = slow || (state.enabled && state.period?.delay) ? Math.min(timestepLimit, controlPeriodLimit(state)) : timestepLimit;
  // A smaller timestep makes no control period shorter.
  const offered = !slow && advised > 0 && advised < timestep ? advised : NaN;
  const known = { limit, where, advised: offered, slow };
  const at = slow ? `A control period of ${duration(longest)}` : duration(timestep);
  const above = excess(at, longest, limit, where);
  if (state.connection !== "open") return { kind: "offline", pill: "no connection", sentence: "", ...known };
  if (state.diagnostics?.state === "diverged") {
    const sentence = above || (limit > 0 ? `${at} was too long for this motion.` : "");
    return { kind: "diverged", pill: "diverged", sentence, ...known };
  }
  if (Number.isNaN(limit) || Number.isNaN(timestep)) return { kind: "unknown", pill: "limit unknown", sentence: "", ...known };
  if (longest > limit) {
    return { kind: limit > 0 ? "beyond" : "never", pill: limit > 0 ? "beyond the limit" : "never stable", sentence: above, ...known };
  }
  if (longest > everyPose) {
    const others = everyPose > 0 ? `other poses are stable only up to ${duration(everyPose)}: on the way there the arm may shake` : "in other poses no timestep is: the gains are at fault there";
    const sentence = `${at} is stable ${where}, but ${others}.`;
    return { kind: "here", pill: "stable here only", sentence, ...known };
  }
  return { kind: "stable", pill: "stable", sentence: `${at} is within the limit ${limitText(limit)}, ${where}.`, ...known };
}

/** Why a time is too long; empty if it is not. @param {string} at the time in words @param {number} time @param {number} limit @param {string} where */
function excess(at, time, limit, where) {
  if (!(time > limit)) return "";
  return limit > 0
    ? `${at} is above the limit ${duration(limit)}, ${where}.`
    : `No timestep is stable, ${where}.`;
}

/** @param {number} limit */
export function limitText(limit) {
  if (Number.isNaN(limit)) return "…";
  return limit === 0 ? "no timestep" : limit === Infinity ? "any timestep" : duration(limit);
}

/** The word for the energy since the last reset: drift only if nothing puts any in or takes any out. */
export function energyName(/** @type {{enabled: boolean | null, pushed: boolean}} */ { enabled, pushed }) {
  if (enabled) return "work";
  return pushed ? "pushed in" : "drift";
}

/**
 * The timestep to begin anew with: the arm is at rest then, and how fast it has become does not count.
 * @param {Object<string, any>} answer of `/study/stability`
 * @returns {number} timestep [s]; NaN where there is none
 */
function afterReset(answer) {
  const found = answer.minimum_over_poses_held;
  const safe = answer.certified === false ? answer.minimum_over_poses_bound ?? found : found;
  return safe > 0 ? SHARE * safe : NaN;
}

/** @typedef {Record<string, number>} Limits largest stable timestep of each method [s] */

/** Limits within this factor are said to be alike. */
const ALIKE = 1.15;
/** The study looks at what grows at so many times the limit. */
const BEYOND = 1.1;
/** Steps in one swing of a deviation that flips at every step. */
const FLIP = 2;
const NEARLY = 0.99;

/** The reason for the limit of the present method; empty until the limits of all methods are known. */
export function whyText(/** @type {any} */ state) {
  const answers = METHODS.map(([method]) => answerInForce(state, method));
  if (!answers.every(Boolean)) return "";
  const limits = Object.fromEntries(METHODS.map(([method], i) => [method, open(answers[i].timestep_limit_held)]));
  const { method } = state.integrator;
  const answer = answerInForce(state, method);
  const limit = limits[method];
  if (state.enabled === false || isFree(state.gains)) return whyFree(answer, method, limit);
  if (limit === Infinity) return "";
  return limit === 0 ? `Why: ${cause(answer, limit)}` : `Why ${duration(limit)}: ${cause(answer, limit)} ${others(limits)}`;
}

/** @param {any} answer @param {string} method @param {number} limit */
function whyFree({ critical }, method, limit) {
  if (limit === 0) return `Why: nothing damps the free arm. Every step of ${methodName(method)} adds a little to each swing, however short the step is.`;
  if (limit === Infinity || !critical) return "";
  return `Why: beyond ${duration(limit)} ${methodName(method)} no longer follows the fastest small swing of the free arm. Wide and fast swings have a smaller limit.`;
}

/** What limits a loop with a controller: the motion that grows first beyond the smallest limit of all poses. @param {any} answer @param {number} limit */
export function cause({ critical, minimum_over_poses_held: least, equilibrium_kind, timestep_limit_continuous }, limit) {
  if (limit === 0) {
    return equilibrium_kind === "unstable" || timestep_limit_continuous === 0
      ? "these gains do not hold the arm here, with any method and any timestep. Raise the derivative gains, or lower the integral gains."
      : "nothing damps the arm here, and a torque that is held for a step comes a little late. Raise the derivative gains.";
  }
  if (!critical || !(least > 0)) return "beyond it a deviation grows.";
  const joint = `joint ${critical.joint + 1}`;
  const percent = significant(100 * (critical.growth_per_step - 1), 2);
  const flips = critical.frequency * FLIP * BEYOND * least > NEARLY;
  if (flips) return `${joint} is the fastest. A torque that is held longer overshoots: 10 % beyond the limit the deviation flips at every step and grows by ${percent} %.`;
  return `a swing of ${joint} at ${significant(critical.frequency, 3)} Hz grows first: the torque comes too late and drives it. A higher derivative gain damps it.`;
}

/** @param {Limits} limits */
export function others(limits) {
  const finite = Object.values(limits);
  const [least, most] = [Math.min(...finite), Math.max(...finite)];
  if (most <= ALIKE * least) return "A better method does not help: the controller looks only once a step. It only makes the simulated motion more exact.";
  const best = METHODS.filter(([method]) => limits[method] > most / ALIKE).map(([, name]) => name);
  return `${best.join(", ")}: stable up to ${limitText(most)}.`;
}

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
