// All that the page knows about the runtime, in one place; a view watches the part that it shows.
// Invariant: only what the runtime has said is stored here, never what was merely asked for.

export const MOST_LINKS = 3;

/** Limits before the study has answered. */
export function nothingAsked() {
  return { loop: "", answers: {}, motions: {} };
}

export const state = {
  connection: "connecting", // or "open", "lost"
  links: 0, // 0 until the runtime has said
  // The latest joint state. Written in place 60 times a second; `version` counts them.
  version: 0,
  time: 0, // s, simulation time
  position: new Float64Array(MOST_LINKS), // rad
  velocity: new Float64Array(MOST_LINKS), // rad/s
  effort: new Float64Array(MOST_LINKS), // N m
  // The setpoint is known from the trajectories that pass, from resets, and from the diagnostics.
  setpoint: new Float64Array(MOST_LINKS), // rad
  setpointKnown: false,
  params: null, // { gravity, masses, lengths }
  integrator: null, // { method, timestep }
  gains: null, // { kp, ki, kd }
  period: null, // { period, effective_period, delay }: how often the control law runs [s]
  paused: null,
  enabled: null, // is PID on
  diagnostics: null, // { level, message, state, ...numbers }
  diverged: false,
  // What /study/stability says of the loop in force: the loop as asked (see `policy.js`), and for each method the values, and the
  // motion's limit and speed as first served since the last reset [s, rad/s].
  limits: nothingAsked(),
  pushed: false, // whether an effort has acted with the controller off since energy is counted
  goal: null, // { id, target, epsilon, distance, elapsed, outcome }
  trial: null, // message of /ik_trial/status
  view: "course", // or "workbench"
  tab: "plots", // the panel that is shown
  joint: 0, // the joint that keys and the phase plot are about
};

const watchers = new Map(); // key -> functions
const everything = []; // functions

/** What the verdict on the loop in force depends on. */
export const LOOP = ["connection", "links", "integrator", "gains", "params", "period", "enabled", "setpoint", "diagnostics", "limits"];

/** @param {string | string[]} keys @param {(value: any) => void} react */
export function watch(keys, react) {
  for (const key of [keys].flat()) watchers.set(key, [...(watchers.get(key) ?? []), react]);
}

export function set(key, value) {
  state[key] = value;
  tell(key);
}

/** Tells those who watch `key`; for what is written in place. */
export function tell(key) {
  const reacts = watchers.get(key);
  if (reacts) for (const react of reacts) react(state[key]);
  for (const react of everything) react();
}

/** For whoever looks at all of it, and has to know only that something is new. */
export function watchAll(react) {
  everything.push(react);
}
