// The 39 stiff and extreme scenes as settings of the live arm: each with its pose at the start and one sentence about its
// behaviour. The report reads the rows from this file, for its pictures and links, so they are JSON.
// Invariant: the rows are those of `src/report/experiments/scenarios/`, in their order.

import { DEFAULTS } from "./settings.js";

/** @typedef {import("./settings.js").Settings} Settings */
/**
 * @typedef {object} Scene @property {string} id @property {string} name @property {number} links 0 for no arm of this
 * page @property {string} expected one short sentence @property {number[]} start pose at the start [rad] @property
 * {number[]} [velocity] at the start [rad/s] @property {Partial<Settings>} settings what differs from the defaults
 * @property {{seconds: number, timestep?: number, start?: number[]}} [watch] the report's picture: its length [s], its
 * own timestep [s] and pose [rad] @property {string} [hidden] why the report has no picture
 */

/** @type {Scene[]} */
export const SCENES = [
  {"id": "S01", "name": "rest without gravity", "links": 3, "expected": "It stays where it is, to the last bit.", "start": [0.3, -1.2, 2],
    "settings": {"params": {"gravity": 0, "masses": [1, 1, 1], "lengths": [1, 1, 1]}}, "watch": {"seconds": 5}},
  {"id": "S02", "name": "hanging at rest", "links": 3, "expected": "It hangs still.", "start": [-1.5707963267948966, 0, 0], "settings": {},
    "watch": {"seconds": 5}},
  {"id": "S03", "name": "upright", "links": 2, "expected": "It stays upright for seconds, then falls.", "start": [1.5707963267958966, 1e-12],
    "settings": {}, "watch": {"seconds": 12}},
  {"id": "S04", "name": "regular swing", "links": 2, "expected": "A small swing keeps its energy.", "start": [-1.2707963267948965, 0], "settings": {},
    "watch": {"seconds": 5}},
  {"id": "S05", "name": "chaotic swing, 2 links", "links": 2, "expected": "Two such swings soon part.", "start": [0, 0], "settings": {},
    "watch": {"seconds": 20}},
  {"id": "S06", "name": "chaotic swing, 3 links", "links": 3, "expected": "Two such swings soon part.", "start": [0, 0, 0], "settings": {},
    "watch": {"seconds": 20}},
  {"id": "S07", "name": "stiff, kp 1e4", "links": 2, "expected": "Stable, but only with short steps.", "start": [0.5, 0.8],
    "settings": {"controller": true, "setpoint": [0.5, 0.8], "gains": {"kp": [10000, 10000], "ki": [0, 0], "kd": [200, 60]}}, "watch": {"start": [0, 0],
    "seconds": 1, "timestep": 0.0005}},
  {"id": "S08", "name": "stiff, kp 1e6", "links": 2, "expected": "1 ms is far too long.", "start": [0.5, 0.8], "settings": {"controller": true,
    "setpoint": [0.5, 0.8], "gains": {"kp": [1000000, 1000000], "ki": [0, 0], "kd": [2000, 600]}}, "watch": {"start": [0, 0], "seconds": 0.2,
    "timestep": 0.00005}},
  {"id": "S09", "name": "overdamped", "links": 2, "expected": "Strong damping needs very short steps.", "start": [0.5, 0.8],
    "settings": {"controller": true, "setpoint": [0.5, 0.8], "gains": {"kp": [200, 200], "ki": [0, 0], "kd": [500, 500]}}, "watch": {"start": [0, 0],
    "seconds": 10, "timestep": 0.0001}},
  {"id": "S10", "name": "undamped", "links": 2, "expected": "No step is short enough.", "start": [0.5, 0.8], "settings": {"controller": true,
    "setpoint": [0.5, 0.8], "gains": {"kp": [10000, 10000], "ki": [0, 0], "kd": [0, 0]}}, "watch": {"start": [0, 0], "seconds": 1}},
  {"id": "S11", "name": "slow control", "links": 2, "expected": "Ten steps for each correction.", "start": [0.5, 0.8], "settings": {"controller": true,
    "setpoint": [0.5, 0.8], "gains": {"kp": [200, 100], "ki": [0, 0], "kd": [30, 12]}, "period": {"period": 0.01}}, "watch": {"start": [0, 0],
    "seconds": 3}},
  {"id": "S12", "name": "held control turns into push", "links": 2, "expected": "The hold turns damping into a push.", "start": [0.5, 0.8],
    "settings": {"controller": true, "setpoint": [0.5, 0.8], "gains": {"kp": [1000, 1000], "ki": [0, 0], "kd": [5, 2]}, "params": {"gravity": 0,
    "masses": [1, 1], "lengths": [1, 1]}, "period": {"period": 0.02}, "integrator": {"method": "rk4", "timestep": 0.0002}}, "watch": {"start": [0, 0],
    "seconds": 3}},
  {"id": "S13", "name": "control one period late", "links": 2, "expected": "A late torque more than halves the limit.", "start": [0.5, 0.8],
    "settings": {"controller": true, "setpoint": [0.5, 0.8], "gains": {"kp": [200, 100], "ki": [0, 0], "kd": [30, 12]}, "period": {"period": 0.01,
    "delay": true}}, "watch": {"start": [0, 0], "seconds": 3}},
  {"id": "S14", "name": "windup", "links": 2, "expected": "The integral grows while the arm is below.", "start": [-1.5707963267948966, 0],
    "settings": {"controller": true, "setpoint": [0, 0], "gains": {"kp": [100, 100], "ki": [50, 50], "kd": [20, 20]}}, "hidden": "needs capped efforts"},
  {"id": "S15", "name": "too much integral", "links": 2, "expected": "These gains fail, however short the step.", "start": [0.5, 0.8],
    "settings": {"controller": true, "setpoint": [0.5, 0.8], "gains": {"kp": [100, 100], "ki": [2000, 2000], "kd": [20, 20]}}, "watch": {"start": [0, 0],
    "seconds": 3}},
  {"id": "S16", "name": "light last link, 1e-3", "links": 2, "expected": "A light link reacts fast: short steps.", "start": [0.5, 0.8],
    "settings": {"controller": true, "setpoint": [0.5, 0.8], "gains": {"kp": [200, 100], "ki": [0, 0], "kd": [30, 12]}, "params": {"gravity": 9.81,
    "masses": [1, 0.001], "lengths": [1, 1]}}, "watch": {"start": [0, 0], "seconds": 3, "timestep": 0.00002}},
  {"id": "S17", "name": "light last link, 1e-6", "links": 2, "expected": "A light link reacts fast: short steps.", "start": [0.5, 0.8],
    "settings": {"controller": true, "setpoint": [0.5, 0.8], "gains": {"kp": [200, 100], "ki": [0, 0], "kd": [30, 12]}, "params": {"gravity": 9.81,
    "masses": [1, 0.000001], "lengths": [1, 1]}}, "watch": {"start": [0, 0], "seconds": 0.002, "timestep": 2e-8}},
  {"id": "S18", "name": "light last link, 1e-9", "links": 2, "expected": "A light link reacts fast: short steps.", "start": [0.5, 0.8],
    "settings": {"controller": true, "setpoint": [0.5, 0.8], "gains": {"kp": [200, 100], "ki": [0, 0], "kd": [30, 12]}, "params": {"gravity": 9.81,
    "masses": [1, 1e-9], "lengths": [1, 1]}}, "watch": {"start": [0, 0], "seconds": 0.000002, "timestep": 2e-11}},
  {"id": "S19", "name": "heavy last link, 1e3", "links": 3, "expected": "A heavy last link throws the others.", "start": [0.3, -1.2, 2],
    "settings": {"params": {"gravity": 9.81, "masses": [1, 1, 1000], "lengths": [1, 1, 1]}}, "watch": {"start": [0, 0, 0], "seconds": 2}},
  {"id": "S20", "name": "heavy last link, 1e6", "links": 3, "expected": "A heavy last link throws the others.", "start": [0.3, -1.2, 2],
    "settings": {"params": {"gravity": 9.81, "masses": [1, 1, 1000000], "lengths": [1, 1, 1]}}, "watch": {"start": [0, 0, 0], "seconds": 2,
    "timestep": 0.0001}},
  {"id": "S21", "name": "heavy last link, 1e9", "links": 3, "expected": "A heavy last link throws the others.", "start": [0.3, -1.2, 2],
    "settings": {"params": {"gravity": 9.81, "masses": [1, 1, 1000000000], "lengths": [1, 1, 1]}}, "watch": {"start": [0, 0, 0], "seconds": 2,
    "timestep": 0.000002}},
  {"id": "S22", "name": "heavy last link, stretched", "links": 3, "expected": "Stable below 16 microseconds.",
    "start": [-1.5707963267948966, 0.000001, -0.000001], "settings": {"params": {"gravity": 9.81, "masses": [1, 1, 1000000000], "lengths": [1, 1, 1]},
    "integrator": {"method": "rk4", "timestep": 0.00001}}, "watch": {"seconds": 1}},
  {"id": "S23", "name": "length ratio 1e3 and 1e-3", "links": 3, "expected": "A kilometre beside a metre.", "start": [0.3, -1.2, 2],
    "settings": {"params": {"gravity": 9.81, "masses": [1, 1, 1], "lengths": [1, 1, 1000]}}, "watch": {"seconds": 5}},
  {"id": "S24", "name": "stretched", "links": 3, "expected": "Nothing breaks where all links line up.", "start": [0, 0, 0], "velocity": [2, -2, 2],
    "settings": {}, "watch": {"seconds": 5}},
  {"id": "S25", "name": "folded", "links": 3, "expected": "Nothing breaks where links fold back.", "start": [0, 3.141592653589793, 0],
    "settings": {"controller": true, "setpoint": [0, 3.141592653589793, 0]}, "watch": {"seconds": 5}},
  {"id": "S26", "name": "whirl", "links": 2, "expected": "1000 rad/s: fast turns need short steps.", "start": [0, 0], "velocity": [1000, 0],
    "settings": {"params": {"gravity": 0, "masses": [1, 1], "lengths": [1, 1]}, "integrator": {"method": "rk4", "timestep": 0.0005}},
    "watch": {"seconds": 0.1}},
  {"id": "S27", "name": "gravity from 0 to 1000", "links": 2, "expected": "A hundred times the usual gravity.", "start": [0.5, -0.5],
    "settings": {"params": {"gravity": 981, "masses": [1, 1], "lengths": [1, 1]}, "integrator": {"method": "rk4", "timestep": 0.0004}},
    "watch": {"seconds": 2}},
  {"id": "S28", "name": "timestep 1e-6", "links": 2, "expected": "A million steps a second.", "start": [-1.2707963267948965, 0],
    "settings": {"integrator": {"method": "rk4", "timestep": 0.000001}}, "watch": {"seconds": 1}},
  {"id": "S29", "name": "timesteps of 0.1 and 1 s", "links": 2, "expected": "Even a slow swing needs a step below 0.4 s.",
    "start": [-1.5607963267948965, 0], "settings": {"integrator": {"method": "rk4", "timestep": 0.1}}, "watch": {"seconds": 20}},
  {"id": "S30", "name": "wound up", "links": 2, "expected": "16 million turns change almost nothing.", "start": [100000000, 0.7], "velocity": [1, -2],
    "settings": {}, "watch": {"seconds": 5}},
  {"id": "S31", "name": "setpoints of 1e6 and 1e300", "links": 2, "expected": "Setpoints many turns away.", "start": [0, 0],
    "settings": {"controller": true, "setpoint": [1000000, 1000000]}, "watch": {"seconds": 3}},
  {"id": "S32", "name": "subnormal start", "links": 2, "expected": "An offset of 1e-310 rad dies away.", "start": [1e-310, 0],
    "settings": {"controller": true, "setpoint": [0, 0], "params": {"gravity": 0, "masses": [1, 1], "lengths": [1, 1]}, "gains": {"kp": [100, 100],
    "ki": [0, 0], "kd": [10, 10]}}, "watch": {"seconds": 3}},
  {"id": "S33", "name": "subnormal inertia", "links": 2, "expected": "Links of 1e-160 m overflow, and that is said.", "start": [0, 0],
    "settings": {"params": {"gravity": 9.81, "masses": [1, 1], "lengths": [1e-160, 1e-160]}}, "watch": {"seconds": 1}},
  {"id": "S34", "name": "parameters that are no numbers", "links": 2, "expected": "Refused, with the reason.", "start": [0, 0],
    "settings": {"params": {"gravity": 9.81, "masses": [-1, 1], "lengths": [1, 1]}}, "hidden": "refused by name"},
  {"id": "S35", "name": "massless link", "links": 2, "expected": "Refused, with the reason.", "start": [0, 0], "settings": {"params": {"gravity": 9.81,
    "masses": [0, 1], "lengths": [1, 1]}}, "hidden": "refused by name"},
  {"id": "S36", "name": "one joint", "links": 0, "expected": "20 000 oscillators; only in the report.", "start": [0], "settings": {},
    "hidden": "has one joint"},
  {"id": "S37", "name": "another method, another timestep", "links": 3, "expected": "Change the method in the Workbench while it swings.",
    "start": [0.3, -1.2, 2], "settings": {}, "watch": {"seconds": 5}},
  {"id": "S38", "name": "there and back", "links": 2, "expected": "A free swing. The report runs it back again.", "start": [0.5, -0.5],
    "settings": {"integrator": {"method": "rk4", "timestep": 0.004}}, "watch": {"seconds": 2}},
  {"id": "S39", "name": "step doubling", "links": 3, "expected": "A free swing. The report compares half steps.", "start": [0.3, -1.2, 2], "settings": {},
    "watch": {"seconds": 5}},
];

/** All settings of a scene. @param {Scene} scene @returns {Settings} */
export function settingsOf({ links, settings }) {
  const { setpoint, ...rest } = { ...structuredClone(DEFAULTS[links]), ...settings };
  return { ...rest, setpoint: setpoint ?? null, period: { period: 0, delay: false, ...settings.period } };
}
