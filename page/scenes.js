// @ts-check
// The 39 stiff and extreme scenes of the report, as settings of the live arm: each with its pose at the start and what is expected.
// Invariant: names and settings are those of `src/report/experiments/scenarios/`; a test compares them.

import { DEFAULTS } from "./settings.js";

/** @typedef {import("./settings.js").Settings} Settings */
/**
 * @typedef {object} Scene
 * @property {string} id
 * @property {string} name
 * @property {number} links 0: no arm of this page
 * @property {string} expected one short sentence
 * @property {number[]} start pose at the start [rad]
 * @property {number[]} [velocity] at the start [rad/s]
 * @property {Partial<Settings>} settings what differs from the defaults
 */

const DOWN = -Math.PI / 2;
const POSE = [0.5, 0.8];
const MODERATE = { kp: [200, 100], ki: [0, 0], kd: [30, 12] };
const SPREAD = [0.3, -1.2, 2];

/** @param {number[]} kp @param {number[]} kd @param {number[]} [ki] */
function gains(kp, kd, ki = [0, 0]) {
  return { kp, ki, kd };
}

/** @param {number[]} masses @param {number} [gravity] */
function weights(masses, gravity = 9.81) {
  return { gravity, masses, lengths: masses.map(() => 1) };
}

/** @param {object} used @returns {Partial<Settings>} */
function held(used) {
  return { servo: true, setpoint: POSE, .../** @type {any} */ (used) };
}

/** @param {number} timestep */
function every(timestep) {
  return { integrator: { method: "rk4", timestep } };
}

/** @type {[string, string, number, string, number[], Partial<Settings>, number[]?][]} */
const ROWS = [
  ["S01", "rest without gravity", 3, "It stays where it is, to the last bit.", SPREAD, { params: weights([1, 1, 1], 0) }],
  ["S02", "hanging at rest", 3, "It hangs still.", [DOWN, 0, 0], {}],
  ["S03", "upright", 2, "It stands for seconds, then falls.", [-DOWN + 1e-12, 1e-12], {}],
  ["S04", "regular swing", 2, "A small swing keeps its energy.", [0.3 + DOWN, 0], {}],
  ["S05", "chaotic swing, 2 links", 2, "No two such swings stay alike.", [0, 0], {}],
  ["S06", "chaotic swing, 3 links", 3, "No two such swings stay alike.", [0, 0, 0], {}],
  ["S07", "stiff, kp 1e4", 2, "Stable, but only with short steps.", POSE, held({ gains: gains([1e4, 1e4], [200, 60]) })],
  ["S08", "stiff, kp 1e6", 2, "1 ms is far too long.", POSE, held({ gains: gains([1e6, 1e6], [2000, 600]) })],
  ["S09", "overdamped", 2, "Strong damping needs very short steps.", POSE, held({ gains: gains([200, 200], [500, 500]) })],
  ["S10", "undamped", 2, "No step is short enough.", POSE, held({ gains: gains([1e4, 1e4], [0, 0]) })],
  ["S11", "slow control", 2, "Ten steps for each correction.", POSE, held({ gains: MODERATE, period: { period: 0.01 } })],
  ["S12", "held control turns into push", 2, "Waiting turns damping into a push.", POSE, held({ gains: gains([1000, 1000], [5, 2]), params: weights([1, 1], 0), period: { period: 0.02 }, ...every(0.0002) })],
  ["S13", "control one period late", 2, "A late torque halves the limit.", POSE, held({ gains: MODERATE, period: { period: 0, delay: true } })],
  ["S14", "windup", 2, "The integral fills while the arm is far away.", [DOWN, 0], { servo: true, setpoint: [0, 0], gains: gains([100, 100], [20, 20], [50, 50]) }],
  ["S15", "too much integral", 2, "These gains fail at every step.", POSE, held({ gains: gains([100, 100], [20, 20], [2000, 2000]) })],
  ["S16", "light last link, 1e-3", 2, "A light link reacts fast: short steps.", POSE, held({ gains: MODERATE, params: weights([1, 1e-3]) })],
  ["S17", "light last link, 1e-6", 2, "A light link reacts fast: short steps.", POSE, held({ gains: MODERATE, params: weights([1, 1e-6]) })],
  ["S18", "light last link, 1e-9", 2, "A light link reacts fast: short steps.", POSE, held({ gains: MODERATE, params: weights([1, 1e-9]) })],
  ["S19", "heavy last link, 1e3", 3, "A heavy last link throws the others.", SPREAD, { params: weights([1, 1, 1e3]) }],
  ["S20", "heavy last link, 1e6", 3, "A heavy last link throws the others.", SPREAD, { params: weights([1, 1, 1e6]) }],
  ["S21", "heavy last link, 1e9", 3, "A heavy last link throws the others.", SPREAD, { params: weights([1, 1, 1e9]) }],
  ["S22", "heavy last link, stretched", 3, "Stable below 16 microseconds.", [DOWN, 1e-6, -1e-6], { params: weights([1, 1, 1e9]), ...every(1e-5) }],
  ["S23", "length ratio 1e3 and 1e-3", 3, "A kilometre beside a metre.", SPREAD, { params: { gravity: 9.81, masses: [1, 1, 1], lengths: [1, 1, 1e3] } }],
  ["S24", "stretched", 3, "Nothing breaks where all links line up.", [0, 0, 0], {}, [2, -2, 2]],
  ["S25", "folded", 3, "Nothing breaks where links fold back.", [0, Math.PI, 0], { servo: true, setpoint: [0, Math.PI, 0] }],
  ["S26", "whirl", 2, "1000 rad/s: fast turns need short steps.", [0, 0], { params: weights([1, 1], 0), ...every(5e-4) }, [1000, 0]],
  ["S27", "gravity from 0 to 1000", 2, "A hundred times the usual gravity.", [0.5, -0.5], { params: weights([1, 1], 981), ...every(4e-4) }],
  ["S28", "timestep 1e-6", 2, "A million steps a second.", [0.3 + DOWN, 0], every(1e-6)],
  ["S29", "timesteps of 0.1 and 1 s", 2, "Even a slow swing needs a step below 0.4 s.", [0.01 + DOWN, 0], every(0.1)],
  ["S30", "wound up", 2, "16 million turns change nothing.", [1e8, 0.7], {}, [1, -2]],
  ["S31", "setpoints of 1e6 and 1e300", 2, "A target that no arm can follow.", [0, 0], { servo: true, setpoint: [1e6, 1e6] }],
  ["S32", "subnormal start", 2, "An offset of 1e-310 rad dies away.", [1e-310, 0], { servo: true, setpoint: [0, 0], params: weights([1, 1], 0), gains: gains([100, 100], [10, 10]) }],
  ["S33", "subnormal inertia", 2, "Links of 1e-160 m overflow, and that is said.", [0, 0], { params: { gravity: 9.81, masses: [1, 1], lengths: [1e-160, 1e-160] } }],
  ["S34", "parameters that are no numbers", 2, "Refused, with the reason.", [0, 0], { params: weights([-1, 1]) }],
  ["S35", "massless link", 2, "Refused, with the reason.", [0, 0], { params: weights([0, 1]) }],
  ["S36", "one joint", 0, "20 000 oscillators; only in the report.", [0], {}],
  ["S37", "another method, another timestep", 3, "Change the method while it swings.", SPREAD, {}],
  ["S38", "there and back", 2, "Backwards it returns, almost.", [0.5, -0.5], every(0.004)],
  ["S39", "step doubling", 3, "Two half steps tell the error of one.", SPREAD, {}],
];

/** @type {Scene[]} */
export const SCENES = ROWS.map(([id, name, links, expected, start, settings, velocity]) => ({ id, name, links, expected, start, settings, velocity }));

/** All settings of a scene. @param {Scene} scene @returns {Settings} */
export function settingsOf({ links, settings }) {
  const { setpoint, ...rest } = { ...structuredClone(DEFAULTS[links]), ...settings };
  return { ...rest, setpoint: setpoint ?? null, period: { period: 0, delay: false, ...settings.period } };
}
