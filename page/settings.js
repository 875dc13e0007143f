// All settings of the arm as one object: collected, compared, written to a link and read from one. Also the undo history: the
// settings before the latest changes.
// Invariant: nothing here calls the runtime. The caller that applies settings gets its refusals.

import { exact } from "./format.js";

/** @typedef {import("./question.js").Gains} Gains */
/** @typedef {import("./question.js").Arm} Arm */
/**
 * @typedef {object} Settings
 * @property {{method?: string, timestep?: number} | null} integrator
 * @property {Partial<Arm> | null} params
 * @property {Partial<Gains> | null} gains
 * @property {{period?: number, delay?: boolean} | null} period the control period, 0 for every step [s]
 * @property {{viscous?: number[]} | null} friction of each joint [N m s/rad]
 * @property {{effort?: number[] | null, anti_windup?: string, tracking_time?: number} | null} motors their limits [N m], null for none
 * @property {{encoder_step?: number[], velocity?: string, delay?: number} | null} sensors what the controller measures [rad], and its delay [periods]
 * @property {boolean | null} controller whether it is on
 * @property {number[] | null} setpoint
 * @property {{position?: number[], velocity?: number[]} | null} [start] the start of the arm [rad, rad/s]; only in links
 */

/** Changes that can be undone. */
const MOST_STEPS = 100;
/** Changes within this time count as one, because a slider passes through many values [ms]. */
const ONE_CHANGE_MS = 1000;

/** The runtime's default settings, by number of links. A test compares them with the runtime. @type {Record<number, Settings>} */
export const DEFAULTS = {
  2: {
    integrator: { method: "rk4", timestep: 0.001 },
    params: { gravity: 9.81, masses: [1, 1], lengths: [1, 1] },
    gains: { kp: [1000, 250], ki: [3000, 750], kd: [110, 22] },
    period: { period: 0, delay: false },
    friction: { viscous: [0, 0] },
    motors: { effort: null, anti_windup: "clamp", tracking_time: 0.2 },
    sensors: { encoder_step: [0, 0], velocity: "exact", delay: 0 },
    controller: false,
    setpoint: [0, 0],
  },
  3: {
    integrator: { method: "rk4", timestep: 0.001 },
    params: { gravity: 9.81, masses: [1, 1, 1], lengths: [1, 1, 1] },
    gains: { kp: [2200, 180, 80], ki: [3500, 300, 185], kd: [160, 38, 4.8] },
    period: { period: 0, delay: false },
    friction: { viscous: [0, 0, 0] },
    motors: { effort: null, anti_windup: "clamp", tracking_time: 0.2 },
    sensors: { encoder_step: [0, 0, 0], velocity: "exact", delay: 0 },
    controller: false,
    setpoint: [0, 0, 0],
  },
};

/** The present settings; null until all are known. @returns {Settings | null} */
export function presentSettings(/** @type {any} */ live) {
  const { links, integrator, params, gains, period, friction, motors, sensors, enabled, setpoint, setpointKnown } = live;
  if (!integrator || !params || !gains || !period || enabled == null) return null;
  return {
    integrator,
    params,
    gains,
    period: { period: period.period, delay: period.delay },
    friction: friction ?? null,
    motors: motors ?? null,
    sensors: sensors ?? null,
    controller: enabled,
    setpoint: setpointKnown ? Array.from(setpoint.subarray(0, links)) : null,
  };
}

/** Whether there is any setting. @param {Settings} settings */
export function hasSettings(settings) {
  return Object.values(settings).some((one) => one !== null);
}

/** @param {Settings} settings @param {number} links */
export function toFragment({ integrator, params, gains, period, friction, motors, sensors, controller, setpoint }, links) {
  const list = (/** @type {number[]} */ values) => values.map(exact).join(",");
  const parts = [
    ["links", links], ["method", integrator?.method], ["timestep", exact(integrator?.timestep ?? NaN)],
    ["gravity", exact(params?.gravity ?? NaN)], ["masses", list(params?.masses ?? [])], ["lengths", list(params?.lengths ?? [])],
    ["kp", list(gains?.kp ?? [])], ["ki", list(gains?.ki ?? [])], ["kd", list(gains?.kd ?? [])],
    ["period", exact(period?.period ?? NaN)], ["delay", period?.delay ? "on" : "off"], ["controller", controller ? "on" : "off"],
  ];
  if (friction?.viscous) parts.push(["viscous", list(friction.viscous)]);
  if (motors) {
    parts.push(["effort_limit", motors.effort ? list(motors.effort) : "none"], ["anti_windup", motors.anti_windup]);
    parts.push(["tracking_time", exact(motors.tracking_time ?? NaN)]);
  }
  if (sensors) {
    parts.push(["encoder_step", list(sensors.encoder_step ?? [])], ["velocity_sensor", sensors.velocity], ["control_delay", exact(sensors.delay ?? NaN)]);
  }
  if (setpoint) parts.push(["setpoint", list(setpoint)]);
  return parts.map(([name, value]) => `${name}=${value}`).join("&");
}

/** The settings in a link's fragment. Only the form is checked, because the runtime checks the values. @returns {Settings} */
export function fromFragment(/** @type {string} */ hash) {
  const given = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (/** @type {string} */ text) => (text.trim() === "" ? NaN : Number(text));
  const numbers = (/** @type {string} */ name) => given.get(name)?.split(",").map(number);
  const pick = (/** @type {string[]} */ names, /** @type {(name: string) => any} */ read) => {
    const found = names.map((name) => [name, read(name)]).filter(([, value]) => value !== undefined);
    return found.length > 0 ? Object.fromEntries(found) : null;
  };
  const single = (/** @type {string} */ name) => (given.has(name) ? number(given.get(name) ?? "") : undefined);
  /** A text other than on and off is kept, so that the runtime refuses it. @returns {any} */
  const onOff = (/** @type {string} */ name) => {
    const text = given.get(name) ?? undefined;
    return text === "on" || text === "off" ? text === "on" : text;
  };
  return {
    integrator: pick(["method", "timestep"], (name) => (name === "method" ? given.get(name) ?? undefined : single(name))),
    params: pick(["gravity", "masses", "lengths"], (name) => (name === "gravity" ? single(name) : numbers(name))),
    gains: pick(["kp", "ki", "kd"], numbers),
    period: pick(["period", "delay"], (name) => (name === "period" ? single(name) : onOff(name))),
    friction: pick(["viscous"], numbers),
    motors: motorsIn(given, numbers, single),
    sensors: sensorsIn(given, numbers, single),
    controller: onOff("controller") ?? null,
    setpoint: numbers("setpoint") ?? null,
    ...(given.has("position") || given.has("velocity") ? { start: pick(["position", "velocity"], numbers) } : {}),
  };
}

/** The limits of the motors in a link; null if it has none. @returns {Settings["motors"]} */
function motorsIn(/** @type {URLSearchParams} */ given, /** @type {(name: string) => any} */ numbers, /** @type {(name: string) => any} */ single) {
  const anti_windup = given.get("anti_windup");
  const tracking_time = single("tracking_time");
  const found = {
    ...(given.has("effort_limit") ? { effort: given.get("effort_limit") === "none" ? null : numbers("effort_limit") } : {}),
    ...(anti_windup === null ? {} : { anti_windup }), ...(tracking_time === undefined ? {} : { tracking_time }),
  };
  return Object.keys(found).length > 0 ? found : null;
}

/** The sensors in a link; null if it has none. @returns {Settings["sensors"]} */
function sensorsIn(/** @type {URLSearchParams} */ given, /** @type {(name: string) => any} */ numbers, /** @type {(name: string) => any} */ single) {
  const [encoder_step, velocity, delay] = [numbers("encoder_step"), given.get("velocity_sensor") ?? undefined, single("control_delay")];
  const found = Object.entries({ encoder_step, velocity, delay }).filter(([, value]) => value !== undefined);
  return found.length > 0 ? Object.fromEntries(found) : null;
}

function isSame(/** @type {Settings} */ one, /** @type {Settings | null} */ other) {
  return JSON.stringify(one) === JSON.stringify(other);
}

/** The settings before each change, the newest last. */
export class Undo {
  constructor() {
    /** @type {Settings[]} */
    this.past = [];
    this.lastTime = -Infinity;
  }

  /** Stores the present settings before a change at `now` [ms], unless the change continues the previous one. */
  remember(/** @type {Settings | null} */ present, /** @type {number} */ now) {
    const goesOn = now - this.lastTime < ONE_CHANGE_MS;
    this.lastTime = now;
    if (!present || goesOn) return;
    this.past.push(structuredClone(present));
    if (this.past.length > MOST_STEPS) this.past.shift();
  }

  /** Whether there are earlier settings that differ from the present ones. A refused setting has changed nothing. */
  leadsBackFrom(/** @type {Settings | null} */ present) {
    return this.past.some((settings) => !isSame(settings, present));
  }

  /** The settings to restore; undefined if there are none. */
  take(/** @type {Settings | null} */ present) {
    this.lastTime = -Infinity;
    let settings = this.past.pop();
    while (settings && isSame(settings, present)) settings = this.past.pop();
    return settings;
  }
}
