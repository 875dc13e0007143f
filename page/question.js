// A question to the study: everything on which its answer depends. Each request to a service `/study/*` about the arm is built here.
// Invariant: a question is complete, so an answer never depends on the live arm at the time of the computation.

/** @typedef {{gravity: number, masses: number[], lengths: number[]}} Arm */
/** @typedef {{kp: number[], ki: number[], kd: number[]}} Gains */
/** @typedef {{effort: number[] | null, anti_windup: string, tracking_time: number}} Motors limits of the efforts [N m], and the anti-windup */
/** @typedef {{encoder_step: number[], velocity: string, delay: number}} Sensors what the controller measures [rad], and its delay [periods] */
/** @typedef {typeof import("./store.js").state} Live what the page knows of the live arm */
/**
 * @typedef {object} Question
 * @property {Arm} params
 * @property {Gains} gains all 0 for a free arm
 * @property {number[]} setpoint [rad]
 * @property {number} control_period [s]; 0 for every step
 * @property {boolean} delay whether a torque acts one period late
 * @property {Sensors} [sensors] their delay counts instead
 * @property {Motors} [limits] of the motors
 * @property {number[]} [viscous] friction of each joint [N m s/rad]
 * @property {number[]} q @property {number[]} qd pose and velocity at the start [rad, rad/s]
 * @property {string} integrator @property {number} timestep [s]
 */
/** @typedef {{duration: number, samples: number, reference?: boolean}} Run */

/** @param {Gains} gains */
export function isFree(gains) {
  return [...gains.kp, ...gains.ki, ...gains.kd].every((one) => one === 0);
}

/** @param {number} n @returns {Gains} */
export function noGains(n) {
  return { kp: new Array(n).fill(0), ki: new Array(n).fill(0), kd: new Array(n).fill(0) };
}

/**
 * The question about the live arm as it is now; null until all of its settings are known. The gains and the clock of a controller that
 * is off are no part of it.
 * @param {Live} live @returns {Question | null}
 */
export function questionOf({ links, params, gains, integrator, period, friction, motors, sensors, enabled, setpoint, setpointKnown, position, velocity }) {
  if (!params || !gains || !integrator || !period || enabled === null || enabled === undefined) return null;
  if (gains.kp.length !== links || params.masses.length !== links || (enabled && !setpointKnown)) return null;
  const list = (/** @type {Float64Array} */ values) => Array.from(values.subarray(0, links));
  const real = { ...(motors ? { limits: motors } : {}), ...(sensors ? { sensors } : {}) };
  const loop = enabled
    ? { gains, setpoint: list(setpoint), control_period: period.period, delay: period.delay, ...real }
    : { gains: noGains(links), setpoint: new Array(links).fill(0), control_period: 0, delay: false };
  const viscous = friction ? { viscous: friction.viscous } : {};
  return { params, ...viscous, ...loop, q: list(position), qd: list(velocity), integrator: integrator.method, timestep: integrator.timestep };
}

/** The same loop from rest in a pose, by default stretched out. @param {Question} question @returns {Question} */
export function fromRest(question, q = question.q.map(() => 0)) {
  return { ...question, q, qd: q.map(() => 0) };
}

/**
 * The loop of a question as a text: all of it but the method, the timestep, and the start. Limits belong to it, one for each method.
 * @param {Question} question
 */
export function loopKey({ integrator: _, timestep: __, q: ___, qd: ____, ...loop }) {
  return JSON.stringify(loop);
}

/** Timesteps per control update, as in the runtime: at least 1. @param {Pick<Live, "period" | "integrator">} live */
export function stepsPerUpdate({ period, integrator }) {
  return Math.max(1, Math.round((period?.period ?? 0) / (integrator?.timestep ?? NaN)) || 1);
}

/** The time for which a torque is held [s]: the steps between two runs of the control law. @param {Pick<Live, "period" | "integrator">} live */
export function heldTime(live) {
  return live.integrator ? stepsPerUpdate(live) * live.integrator.timestep : NaN;
}

/**
 * The same question with a control period that is a whole number of timesteps. Runs with other timesteps then have the same controller.
 * @param {Question} question @returns {Question}
 */
export function withFixedPeriod(question) {
  const { control_period: period, timestep } = question;
  return isFree(question.gains) ? question : { ...question, control_period: Math.max(1, Math.round(period / timestep)) * timestep };
}

/** The arguments of `/study/stability`. @param {Question} question */
export function stabilityArgs(question) {
  return { ...question };
}

/** The arguments of `/study/rollout`. @param {Question} question @param {Run} run */
export function rolloutArgs({ q, qd, ...loop }, run) {
  return { ...loop, q0: q, qdot0: qd, ...run };
}

/** The arguments of `/study/gains`. @param {Question} question */
export function gainsArgs({ params, integrator, timestep }) {
  return { params, integrator, timestep };
}
