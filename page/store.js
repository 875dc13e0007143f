// The page's state of the runtime, in one place. A view watches the part that it shows.
// Invariant: only values from the runtime are stored here, never requested ones.

export const MOST_LINKS = 3;

/**
 * The study's answers about one loop, by method, and the first limit and speed of the motion since the last reset [s, rad/s].
 * @typedef {{loop: string, answers: Record<string, any>, motions: Record<string, {limit: number, speed?: number}>}} Limits
 */

/** Limits before the study has answered. @returns {Limits} */
export function nothingAsked() {
  return { loop: "", answers: {}, motions: {} };
}

export const state = {
  connection: "connecting", // or "open", "lost"; "silent" without a message for some seconds
  failures: 0, // attempts in a row without a connection
  links: 0, // 0 until the runtime has sent it
  answered: false, // whether all settings were asked for since the connection was opened, and answered
  changing: 0, // changes by this page that were not answered yet
  // The latest joint state. Written in place 60 times a second; `version` counts them.
  version: 0,
  time: 0, // s, simulation time
  position: new Float64Array(MOST_LINKS), // rad
  velocity: new Float64Array(MOST_LINKS), // rad/s
  effort: new Float64Array(MOST_LINKS), // N m
  // The setpoint comes from trajectories, resets and diagnostics.
  setpoint: new Float64Array(MOST_LINKS), // rad
  setpointKnown: false,
  params: /** @type {import("./question.js").Arm | null} */ (null),
  integrator: /** @type {{method: string, timestep: number} | null} */ (null),
  gains: /** @type {import("./question.js").Gains | null} */ (null),
  friction: /** @type {{viscous: number[]} | null} */ (null), // of each joint [N m s/rad]
  motors: /** @type {import("./question.js").Motors | null} */ (null),
  sensors: /** @type {import("./question.js").Sensors | null} */ (null),
  period: /** @type {{period: number, delay: boolean, effective_period?: number} | null} */ (null), // the control period [s]
  paused: /** @type {boolean | null} */ (null),
  enabled: /** @type {boolean | null} */ (null), // whether the controller is on
  diagnostics: /** @type {any} */ (null), // { level, message, state, ...numbers }
  diverged: false,
  broken: /** @type {import("./question.js").Question | null} */ (null), // the question at the divergence, if the page has seen it
  limits: nothingAsked(), // of the active loop
  pushed: false, // whether an effort has acted with the controller off since the energy's reference
  goal: /** @type {any} */ (null), // { id, target, epsilon, distance, elapsed, outcome }
  trial: /** @type {any} */ (null), // message of /ik_trial/status
  view: "course", // or "workbench"
  tab: "plots", // the shown panel
  joint: 0, // the joint for keys and the phase plot
};

const watchers = /** @type {Map<string, ((value: any) => void)[]>} */ (new Map()); // by key
const everything = /** @type {Set<() => void>} */ (new Set());
const PATIENCE_MS = 3000; // longest wait of an input for the runtime's messages [ms]

/** The keys on which the verdict on the active loop depends. */
export const LOOP = ["connection", "links", "integrator", "gains", "params", "friction", "motors", "period", "enabled", "setpoint", "diagnostics", "limits"];

/** @param {string | string[]} keys @param {(value: any) => void} react */
export function watch(keys, react) {
  for (const key of [keys].flat()) watchers.set(key, [...(watchers.get(key) ?? []), react]);
}

/** @param {string} key @param {any} value */
export function set(key, value) {
  /** @type {any} */ (state)[key] = value;
  tell(key);
}

/** Notifies the watchers of `key`, for values that are written in place. @param {string} key */
export function tell(key) {
  const reacts = watchers.get(key);
  if (reacts) for (const react of reacts) react(/** @type {any} */ (state)[key]);
  for (const react of everything) react();
}

/** For watchers of the whole state, which only need to know that something has changed. @param {() => void} react */
export function watchAll(react) {
  everything.add(react);
}

/**
 * The first value of `look` that is not null, now or at a later message; null if there is no connection, or no such message for some seconds. An input
 * that depends on a value waits for it here, so it is not lost. @param {() => any} look @returns {Promise<any>}
 */
export function known(look) {
  return new Promise((done) => {
    const give = (/** @type {any} */ value) => {
      everything.delete(check);
      clearTimeout(timer);
      done(value);
    };
    const check = () => {
      const value = look() ?? null;
      if (value !== null || !["open", "connecting"].includes(state.connection)) give(value);
    };
    const timer = setTimeout(() => give(null), PATIENCE_MS);
    everything.add(check);
    check();
  });
}

/** The answer to an input without such a value. */
export function unknown() {
  return { result: false, status: state.connection === "open" ? "the arm has not answered" : "not connected", values: /** @type {any} */ ({}) };
}

/** The answer of a call with such a value, or its refusal. @param {() => any} look @param {(value: any) => any} call */
export async function whenKnown(look, call) {
  const value = await known(look);
  return value === null ? unknown() : call(value);
}

/** The number of links once all settings are known too; null before. */
export const settingsKnown = () => (state.answered && state.links) || null;
