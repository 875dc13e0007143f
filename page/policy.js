// A verdict on the present timestep: the limit of the active loop, its scope, and texts for the verdict and the reason.
// Invariant: a figure is used only for the loop of its request. Until the answer arrives there is none.

import { duration, fixed, methodName, METHODS, significant } from "./format.js";
import { isFree, loopKey, questionOf, stepsPerUpdate } from "./question.js";

/** @typedef {import("./question.js").Question} Question */
/** @typedef {import("./question.js").Gains} Gains */
/** @typedef {import("./question.js").Live} State */
/** @typedef {"offline" | "diverged" | "unknown" | "never" | "beyond" | "here" | "stable"} Kind */

/** Below this real-time factor the runtime is too slow. */
export const SLOW = 0.95;
const SHARE = 0.8; // advised share of a limit, as in the runtime
const AFTER_DIVERGENCE = 0.5; // advised share of a timestep at which the arm diverged below every known limit
const SLOW_GROWTH = 600; // if the energy of a free swing takes longer to double, other errors matter first [s]
const HALVINGS = 50;

/** The study's answer for a method, if it belongs to the active loop; otherwise null. @param {State} state */
export function answerInForce(state, method = state.integrator?.method ?? "") {
  const asked = questionOf(state);
  return asked && state.limits.loop === loopKey(asked) ? state.limits.answers[method] ?? null : null;
}

const NEWS = 0.05; // relative changes of a limit that are ignored

/** Whether the limit of the motion has changed since the last request to the study. It changes as the arm moves. */
export function motionHasChanged(/** @type {any} */ answer, /** @type {any} */ diagnostics) {
  const [then, now] = [answer?.timestep_limit_motion, diagnostics?.timestep_limit_motion];
  if (then === undefined || !(now > 0)) return false;
  return open(then) !== now && !(Math.abs(now / open(then) - 1) < NEWS);
}

/** A limit in an answer. Null means that no limit was found. @param {number | null | undefined} served */
function open(served) {
  return served ?? Infinity;
}

/** The limit of the active loop with a method [s], and its pose or speed. */
export function limitInForce(/** @type {State} */ state, method = state.integrator?.method ?? "") {
  const answer = answerInForce(state, method);
  const free = !acts(state);
  const { links } = state;
  if (!answer || !state.params) return { limit: NaN, where: "", place: "", everyPose: NaN, everyPoseAtRest: NaN, advised: NaN };
  const diverged = state.diagnostics?.state === "diverged";
  const timestep = judged(state)?.timestep ?? NaN;
  const held = free ? Math.max(heldLimit(state, answer), slowGrowthLimit(method, answer)) : heldLimit(state, answer);
  const fast = diverged || timestep > held || periodIsTooLong(state, answer);
  // An arm that has diverged or shakes is fast because of that. Of a free arm the earlier motion counts, which comes again
  // after a reset. A controlled arm then begins at rest.
  const before = free ? state.limits.motions[method] : undefined;
  const motion = fast ? before?.limit ?? Infinity : open(answer.timestep_limit_motion);
  const speed = fast ? before?.speed : answer.motion_speed;
  const pose = answer.equilibrium ?? (free ? null : state.setpoint.subarray(0, links));
  const named = pose ? `(${Array.from(pose, (q) => fixed(q, 2)).join(", ")}) rad` : "";
  const places = {
    setpoint: `at the setpoint ${named}`,
    sagging: `at the pose to which it sags, ${named}`,
    saddle: `at the pose to which it falls, ${named}`,
    hanging: state.params.gravity > 0 ? "hanging, small swings" : "without gravity, slow turns",
    unstable: free ? `at ${named}` : `at ${named}, which these gains cannot hold`,
  };
  const place = places[/** @type {keyof typeof places} */ (answer.equilibrium_kind ?? (free ? "hanging" : "setpoint"))];
  const moving = motion < held;
  const inForce = Math.min(held, motion);
  const everyPoseAtRest = free ? held : Math.min(held, open(answer.minimum_over_poses_held));
  const usual = free ? SHARE * inForce : Math.min(afterReset(answer), SHARE * motion);
  return {
    limit: inForce,
    // A motion's limit is an estimate for the fastest motion with its energy.
    name: moving ? "the estimated limit" : "the limit",
    where: moving ? `moving at up to ${significant(speed ?? NaN, 3)} rad/s` : place,
    place,
    everyPose: Math.min(motion, everyPoseAtRest),
    everyPoseAtRest,
    // Never the timestep at which this loop has just diverged.
    advised: diverged && timestep > 0 ? Math.min(usual, AFTER_DIVERGENCE * timestep) : usual,
  };
}

/**
 * Method and timestep that a verdict is about: the present ones or, once the arm has diverged, those at which it did. The latter are
 * null if they are unknown, or if they were those of another loop.
 * @param {State} state
 */
function judged(state) {
  if (state.diagnostics?.state !== "diverged") return state.integrator;
  const [then, now] = [state.broken, questionOf(state)];
  return then && now && loopKey(then) === loopKey(now) ? { method: then.integrator, timestep: then.timestep } : null;
}

/**
 * The timestep's limit at the present control period. If the period itself is too
 * long, a shorter timestep does not help, and the limit of a law at every step is used.
 */
function heldLimit(/** @type {State} */ state, /** @type {any} */ answer) {
  const own = open(answer.timestep_limit);
  return Number(state.period?.period) > 0 && answer.timestep_limit !== undefined && own > 0 ? own : open(answer.timestep_limit_held);
}

/**
 * Stores an answer of the study to a question about the active loop.
 * @param {State} state @param {Question} asked @param {any} answer
 */
export function keepAnswer(state, asked, answer) {
  const method = asked.integrator;
  if (state.limits.loop !== loopKey(asked)) state.limits = { loop: loopKey(asked), answers: {}, motions: {} };
  const { answers, motions } = state.limits;
  answers[method] = answer;
  // Only a free arm's earlier motion counts. A diverging simulation is fast because of that, even at the first answer.
  if (!answer || acts(state) || state.diagnostics?.state === "diverged") return;
  motions[method] ??= { limit: open(answer.timestep_limit_motion), speed: answer.motion_speed };
}

/**
 * The time in which Euler or midpoint double the energy of the fastest small free swing, at a timestep [s]; 0 for other methods and other loops. A step
 * multiplies the swing by 1 + iz or by 1 - z²/2 + iz, with z = timestep times its angular frequency.
 */
export function doublingTime(/** @type {string} */ method, /** @type {number} */ timestep, /** @type {any} */ answer) {
  if (answer?.timestep_limit_held !== 0 || !answer.critical || !["euler", "midpoint"].includes(method)) return 0;
  const z = timestep * 2 * Math.PI * answer.critical.frequency;
  return (Math.LN2 * timestep) / Math.log1p(method === "euler" ? z * z : z ** 4 / 4);
}

/**
 * The timestep up to which the energy of Midpoint's fastest small free swing doubles in no less than `SLOW_GROWTH` [s]; 0 for other
 * methods. Midpoint's growth falls with the third power of the timestep, so other errors matter first. Euler's falls with the first.
 * @param {string} method @param {any} answer
 */
function slowGrowthLimit(method, answer) {
  if (method !== "midpoint" || answer.timestep_limit_held !== 0 || !answer.critical) return 0;
  let [low, high] = [0, 1 / answer.critical.frequency];
  for (let halving = 0; halving < HALVINGS; halving += 1) {
    const middle = (low + high) / 2;
    if (doublingTime(method, middle, answer) > SLOW_GROWTH) low = middle;
    else high = middle;
  }
  return low;
}

/**
 * The limit of the control period [s]: 0 if no stable one was found, Infinity if no limit was, NaN unknown, as while no controller acts.
 * @param {State} state
 */
export function controlPeriodLimit(state) {
  const answer = answerInForce(state);
  return answer && acts(state) ? periodLimitIn(state, answer) : NaN;
}

/** The same in an answer. An answer without one belongs to a control law that runs at every step without a delay. Then it is the timestep's limit. */
function periodLimitIn(/** @type {any} */ { period }, /** @type {any} */ answer) {
  if (answer.control_period_limit !== undefined) return open(answer.control_period_limit);
  return period?.delay ? NaN : open(answer.timestep_limit_held);
}

/** Whether a controller moves the arm. @param {State} state */
function acts({ enabled, gains }) {
  return enabled === true && gains != null && !isFree(gains);
}

/** Whether the control law runs too rarely. @param {State} state @param {any} answer */
function periodIsTooLong(state, answer) {
  const integrator = judged(state);
  if (!integrator || !acts(state)) return false;
  const steps = stepsPerUpdate({ period: state.period, integrator });
  return (steps > 1 || state.period?.delay === true) && steps * integrator.timestep > periodLimitIn(state, answer);
}

/** A short text for the present control period; empty if the control law runs at every step without a delay. @param {State} state */
export function periodText(state) {
  const { period, integrator } = state;
  if (!period || !integrator) return "";
  const steps = stepsPerUpdate(state);
  const often = steps > 1 ? [`${steps} steps`, duration(steps * integrator.timestep)] : [];
  return [...often, ...(period.delay ? ["delayed"] : [])].join(", ");
}

/**
 * The verdict in a few words and in a sentence; the limit [s] (0 if no stable time was found, Infinity if no limit was, NaN unknown), with its pose or
 * speed; the timestep to offer [s], NaN for none; and whether all this is about a control period longer than the timestep. @param {State} state
 */
export function verdict(state) {
  const own = limitInForce(state);
  const integrator = judged(state);
  const { timestep = NaN } = integrator ?? {};
  const steps = acts(state) && integrator ? stepsPerUpdate({ period: state.period, integrator }) : 1;
  const periodLimit = steps > 1 || (acts(state) && state.period?.delay) ? controlPeriodLimit(state) : Infinity;
  // Each clock has its own limit. The sentence is about the control period, unless only the timestep is too long.
  const slow = steps > 1 && (steps * timestep > periodLimit || !(timestep > own.limit));
  const time = slow ? steps * timestep : timestep;
  const where = slow ? own.place : own.where;
  const limit = Number.isNaN(own.limit) ? NaN : slow ? periodLimit : steps > 1 ? own.limit : Math.min(own.limit, periodLimit);
  const everyPose = slow ? Math.min(periodLimit, own.everyPoseAtRest) : own.everyPose;
  // A smaller timestep does not make the control period shorter. Nothing is offered that is in force already.
  const now = state.integrator?.timestep ?? NaN;
  const present = timestep > 0 ? Math.min(timestep, now) : now;
  const offered = !slow && own.advised > 0 && own.advised < present ? own.advised : NaN;
  const said = (/** @type {Kind} */ kind, /** @type {string} */ pill, sentence = "") => ({ kind, pill, sentence, limit, where, advised: offered, slow });
  const at = slow ? `A control period of ${duration(time)}` : duration(time);
  const name = slow ? "the limit" : own.name;
  const above = limit > 0 ? `${at} is above ${name} ${duration(limit)}, ${where}.` : `No stable timestep is known, ${where}.`;
  if (state.connection !== "open") return said("offline", "no connection");
  if (state.diagnostics?.state === "diverged") {
    const other = state.broken ? "Other settings are in force now." : "";
    return said("diverged", "diverged", !integrator ? other : time > limit ? above : limit > 0 ? `${at} was too long for this motion.` : "");
  }
  if (Number.isNaN(limit) || Number.isNaN(timestep)) return said("unknown", "limit unknown");
  if (time > limit) return limit > 0 ? said("beyond", `beyond ${name}`, above) : said("never", "no stable timestep", above);
  if (time > everyPose) {
    const others = everyPose > 0
      ? `other poses are stable only up to ${duration(everyPose)}: on the way there the arm may shake`
      : "for other poses no stable timestep is known, because of the gains";
    return said("here", "stable here only", `${at} is stable ${where}, but ${others}.`);
  }
  return said("stable", "stable", limit === Infinity ? `No limit was found, ${where}.` : `${at} is within the limit ${duration(limit)}, ${where}.`);
}

/** @param {number} limit */
export function limitText(limit) {
  if (Number.isNaN(limit)) return "…";
  return limit === 0 ? "no timestep" : limit === Infinity ? "any timestep" : duration(limit);
}

/** The word for the energy since the last reset. It is drift only if nothing adds or removes energy. */
export function energyName(/** @type {{enabled: boolean | null, pushed: boolean}} */ { enabled, pushed }) {
  if (enabled) return "work";
  return pushed ? "pushed in" : "drift";
}

/**
 * The timestep for a restart. The arm is then at rest, so its present speed does not count.
 * @param {Object<string, any>} answer of `/study/stability`
 * @returns {number} timestep [s]; NaN if there is none
 */
function afterReset(answer) {
  const found = answer.minimum_over_poses_held;
  const safe = answer.certified === false ? answer.minimum_over_poses_bound ?? found : found;
  return safe > 0 ? SHARE * safe : NaN;
}

/** @typedef {Record<string, number>} Timesteps largest stable timestep of each method [s] */

const ALIKE = 1.15; // limits within this factor count as equal
const BEYOND = 1.1; // the study computes growth at this multiple of the limit
const FLIP = 2; // steps in one period of a deviation that changes its sign at every step
const NEARLY = 0.99;

/** The reason for the limit of the present method; empty until the limits of all methods are known. */
export function whyText(/** @type {State} */ state) {
  const answers = METHODS.map(([method]) => answerInForce(state, method));
  if (!answers.every(Boolean)) return "";
  const limits = Object.fromEntries(METHODS.map(([method], i) => [method, open(answers[i].timestep_limit_held)]));
  const { method = "" } = state.integrator ?? {};
  const answer = answerInForce(state, method);
  const limit = limits[method];
  if (!acts(state)) return whyFree(answer, method, limit);
  if (limit === Infinity) return "";
  if (limit === 0) return `Why: ${cause(answer, limit)}`;
  const least = answer.minimum_over_poses_held;
  const explained = answer.critical && least > 0 && least < NEARLY * limit ? `${duration(least)}, the smallest limit of all poses` : duration(limit);
  return `Why ${explained}: ${cause(answer, limit)} ${others(limits)}`;
}

/** @param {any} answer @param {string} method @param {number} limit */
function whyFree({ critical }, method, limit) {
  if (limit === 0) return `Why: nothing damps the free arm. With ${methodName(method)} even a small swing grows, however short the step is.`;
  if (limit === Infinity || !critical) return "";
  return `Why: beyond ${duration(limit)} ${methodName(method)} no longer follows the fastest small swing of the free arm. Wide and fast swings `
    + `may need shorter steps.`;
}

/**
 * The reason for the limit of a loop with a controller: the motion that grows first beyond the smallest limit of all poses.
 * @param {any} answer @param {number} limit
 */
export function cause({ critical, minimum_over_poses_held: least, equilibrium_kind, timestep_limit_continuous }, limit) {
  if (limit === 0) {
    return equilibrium_kind === "unstable" || timestep_limit_continuous === 0
      ? "no stable timestep is known for these gains here. Higher derivative gains or lower integral gains may help."
      : "too little damps the arm here, and a torque that is held for a step is a little late. Higher derivative gains may help.";
  }
  if (!critical || !(least > 0)) return "beyond it a deviation grows.";
  const joint = `joint ${critical.joint + 1}`;
  const percent = significant(100 * (critical.growth_per_step - 1), 2);
  const flips = critical.frequency * FLIP * BEYOND * least > NEARLY;
  if (flips) return `${joint} is the fastest. A torque that is held longer overshoots: 10 % beyond the limit the deviation flips at every step `
    + `and grows by ${percent} %.`;
  return `a swing of ${joint} at ${significant(critical.frequency, 3)} Hz grows first: the torque comes too late and drives it. A higher `
    + `derivative gain may help.`;
}

/** @param {Timesteps} limits */
export function others(limits) {
  const finite = Object.values(limits);
  const [least, most] = [Math.min(...finite), Math.max(...finite)];
  if (most <= ALIKE * least) return "A better method hardly helps here, because the controller acts only once a step. It makes the simulated "
    + "motion more exact.";
  const best = METHODS.filter(([method]) => limits[method] > most / ALIKE).map(([, name]) => name);
  return `${best.join(", ")}: ${most === Infinity ? "no limit was found" : `stable up to ${limitText(most)}`}.`;
}

/** @param {Gains} gains @param {number} factor @returns {Gains} */
export function scaled(gains, factor) {
  const times = (/** @type {number[]} */ list) => list.map((one) => factor * one);
  return { kp: times(gains.kp), ki: times(gains.ki), kd: times(gains.kd) };
}

const ROUNDED = 0.02; // gains are sent with three digits

/** The factor between `gains` and `base`; NaN if they are not a multiple. @param {Gains | null} gains @param {Gains | null} base */
export function factorOf(gains, base) {
  if (!gains || !base || gains.kp.length !== base.kp.length) return NaN;
  const pairs = /** @type {const} */ (["kp", "ki", "kd"]).flatMap((key) => gains[key].map((one, i) => [one, base[key][i]]));
  const found = pairs.filter(([, one]) => one > 0).map(([a, b]) => a / b);
  const isMultiple = found.length > 0 && pairs.every(([a, b]) => (b > 0 ? Math.abs(a / b / found[0] - 1) < ROUNDED : a === 0));
  return isMultiple ? found[0] : NaN;
}
