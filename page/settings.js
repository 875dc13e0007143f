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

const MOST_STEPS = 100; // changes that can be undone
const ONE_CHANGE_MS = 1000; // changes within this time count as one, because a slider passes through many values [ms]

/** The runtime's default settings, by number of links. A test compares them with the runtime. @type {Record<number, Settings>} */
export const DEFAULTS = {
  2: defaults({ kp: [1000, 250], ki: [3000, 750], kd: [110, 22] }),
  3: defaults({ kp: [2200, 180, 80], ki: [3500, 300, 185], kd: [160, 38, 4.8] }),
};

/** @param {Gains} gains @returns {Settings} */
function defaults(gains) {
  const all = (/** @type {number} */ value) => gains.kp.map(() => value);
  return {
    integrator: { method: "rk4", timestep: 0.001 },
    params: { gravity: 9.81, masses: all(1), lengths: all(1) },
    gains,
    period: { period: 0, delay: false },
    friction: { viscous: all(0) },
    motors: { effort: null, anti_windup: "clamp", tracking_time: 0.2 },
    sensors: { encoder_step: all(0), velocity: "exact", delay: 0 },
    controller: false,
    setpoint: all(0),
  };
}

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

// The forms of a value in a link. A wrong value is kept, because the runtime refuses it.
/** @typedef {{write: (value: any) => string, read: (text: string) => any}} Form */
/** @type {Form} */
const TEXT = { write: String, read: String };
/** @type {Form} */
const NUMBER = { write: exact, read: (text) => (text.trim() === "" ? NaN : Number(text)) };
/** @type {Form} */
const LIST = { write: (values) => values.map(exact).join(","), read: (text) => text.split(",").map(NUMBER.read) };
/** @type {Form} */
const LIMITS = { write: (values) => (values ? LIST.write(values) : "none"), read: (text) => (text === "none" ? null : LIST.read(text)) };
/** @type {Form} */
const SWITCH = { write: (isOn) => (isOn ? "on" : "off"), read: (text) => (text === "on" || text === "off" ? text === "on" : text) };

/** Each setting in a link: its name there, its group if it has one, its name in the group, its form. @type {[string, string, string, Form][]} */
const IN_LINKS = [
  ["method", "integrator", "method", TEXT], ["timestep", "integrator", "timestep", NUMBER],
  ["gravity", "params", "gravity", NUMBER], ["masses", "params", "masses", LIST], ["lengths", "params", "lengths", LIST],
  ["kp", "gains", "kp", LIST], ["ki", "gains", "ki", LIST], ["kd", "gains", "kd", LIST],
  ["period", "period", "period", NUMBER], ["delay", "period", "delay", SWITCH], ["controller", "", "controller", SWITCH],
  ["viscous", "friction", "viscous", LIST],
  ["effort_limit", "motors", "effort", LIMITS], ["anti_windup", "motors", "anti_windup", TEXT], ["tracking_time", "motors", "tracking_time", NUMBER],
  ["encoder_step", "sensors", "encoder_step", LIST], ["velocity_sensor", "sensors", "velocity", TEXT], ["control_delay", "sensors", "delay", NUMBER],
  ["setpoint", "", "setpoint", LIST], ["position", "start", "position", LIST], ["velocity", "start", "velocity", LIST],
];

/** @param {Settings} settings @param {number} links */
export function toFragment(settings, links) {
  const parts = IN_LINKS.flatMap(([name, group, key, form]) => {
    const value = /** @type {any} */ (group ? /** @type {any} */ (settings)[group] : settings)?.[key];
    return value === undefined || (value === null && form !== LIMITS) ? [] : [`${name}=${form.write(value)}`];
  });
  return [`links=${links}`, ...parts].join("&");
}

/** The settings in a link's fragment. @returns {Settings} */
export function fromFragment(/** @type {string} */ hash) {
  const given = new URLSearchParams(hash.replace(/^#/, ""));
  const settings = /** @type {any} */ (Object.fromEntries(Object.keys(DEFAULTS[2]).map((key) => [key, null])));
  for (const [name, group, key, form] of IN_LINKS) {
    const text = given.get(name);
    if (text === null) continue;
    if (group) settings[group] = { ...settings[group], [key]: form.read(text) };
    else settings[key] = form.read(text);
  }
  return settings;
}

function isSame(/** @type {Settings} */ one, /** @type {Settings | null} */ other) {
  return JSON.stringify(one) === JSON.stringify(other);
}

/** The settings before each change, the newest last. */
export class Undo {
  past = /** @type {Settings[]} */ ([]);
  lastTime = -Infinity;

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
    while (this.past.length > 0 && isSame(this.past[this.past.length - 1], present)) this.past.pop();
    return this.past.pop();
  }
}
