// The page's state of the runtime, in one place. A view watches the part that it shows.
// Invariant: only values from the runtime are stored here, never requested ones.

export const MOST_LINKS = 3;

/** Limits before the study has answered. */
export function nothingAsked() {
  return { loop: "", answers: {}, motions: {} };
}

export const state = {
  connection: "connecting", // or "open", "lost"; "silent" without a message for some seconds
  failures: 0, // attempts in a row without a connection
  links: 0, // 0 until the runtime has sent it
  // The latest joint state. Written in place 60 times a second; `version` counts them.
  version: 0,
  time: 0, // s, simulation time
  position: new Float64Array(MOST_LINKS), // rad
  velocity: new Float64Array(MOST_LINKS), // rad/s
  effort: new Float64Array(MOST_LINKS), // N m
  // The setpoint comes from trajectories, resets and diagnostics.
  setpoint: new Float64Array(MOST_LINKS), // rad
  setpointKnown: false,
  params: null, // { gravity, masses, lengths }
  integrator: null, // { method, timestep }
  gains: null, // { kp, ki, kd }
  friction: null, // { viscous }: friction of each joint [N m s/rad]
  motors: null, // { effort, anti_windup, tracking_time }: limits of the efforts [N m] or null, and the anti-windup [s]
  sensors: null, // { encoder_step, velocity, delay }: what the controller measures [rad, name, periods]
  period: null, // { period, effective_period, delay }: the control period [s]
  paused: null,
  enabled: null, // whether the controller is on
  diagnostics: null, // { level, message, state, ...numbers }
  diverged: false,
  broken: null, // the question at the divergence, if the page has seen it
  // The answers of /study/stability for the active loop. They have the requested loop (see `policy.js`), the values for
  // each method, and the first limit and speed of the motion since the last reset [s, rad/s].
  limits: nothingAsked(),
  pushed: false, // whether an effort has acted with the controller off since the energy's reference
  goal: null, // { id, target, epsilon, distance, elapsed, outcome }
  trial: null, // message of /ik_trial/status
  view: "course", // or "workbench"
  tab: "plots", // the shown panel
  joint: 0, // the joint for keys and the phase plot
};

const watchers = new Map(); // key -> functions
const everything = []; // functions

/** The keys on which the verdict on the active loop depends. */
export const LOOP = ["connection", "links", "integrator", "gains", "params", "friction", "motors", "period", "enabled", "setpoint", "diagnostics", "limits"];

/** @param {string | string[]} keys @param {(value: any) => void} react */
export function watch(keys, react) {
  for (const key of [keys].flat()) watchers.set(key, [...(watchers.get(key) ?? []), react]);
}

export function set(key, value) {
  state[key] = value;
  tell(key);
}

/** Notifies the watchers of `key`, for values that are written in place. */
export function tell(key) {
  const reacts = watchers.get(key);
  if (reacts) for (const react of reacts) react(state[key]);
  for (const react of everything) react();
}

/** For watchers of the whole state, which only need to know that something has changed. */
export function watchAll(react) {
  everything.push(react);
}
