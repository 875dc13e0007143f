// @ts-check
// The lessons: each sets the scene with one click and names what to see and to try.
// Invariant: a lesson is data. Its starter applies its settings, resets the arm, and shows its panel.

import { DEFAULTS } from "./settings.js";
import { scaled } from "./gains.js";

/** @typedef {import("./settings.js").Settings} Settings */
/**
 * @typedef {object} Lesson
 * @property {string} id
 * @property {string} name
 * @property {string} text to see, and to try
 * @property {"plots" | "stability" | "error" | "compare"} panel where to look
 * @property {(links: number) => Settings} settings
 * @property {[string, number][]} [runs] what to compare, and for how long [s]
 * @property {number} [seconds]
 */

/** @param {number} links @param {Partial<Settings>} changed @returns {Settings} */
function from(links, changed) {
  return { ...structuredClone(DEFAULTS[links]), ...changed };
}

/** @param {number} links @param {number[]} values */
function first(links, values) {
  return values.slice(0, links);
}

/** Mass of the last link [kg]: as heavy as the usual gains still hold in every pose. @type {Record<number, number>} */
const HEAVY = { 2: 5, 3: 3 };
/** Timestep that is a fifth to a quarter beyond the limit of the stretched arm: it shakes, and stays finite [s]. @type {Record<number, number>} */
const BEYOND = { 2: 0.0055, 3: 0.0038 };
/** Gains that let the arm sag, and are stable with an integral gain of 300 on any of its joints. @type {Record<number, { kp: number[], kd: number[] }>} */
const SOFT = { 2: { kp: [60, 30], kd: [25, 8] }, 3: { kp: [200, 80, 40], kd: [60, 20, 8] } };
const FOLDED = [0.9, -1.3, 0.8];

/** @type {Lesson[]} */
export const LESSONS = [
  {
    id: "euler",
    name: "Euler gains energy",
    text: "Nothing drives this swing, so its energy should stay at 0 J. Euler at 5 ms adds some at every step. Choose Runge–Kutta 4 (key 4): from then on the line stays flat.",
    panel: "plots",
    settings: (links) => from(links, { integrator: { method: "euler", timestep: 0.005 } }),
  },
  {
    id: "limit",
    name: "Beyond the limit",
    text: "The timestep is a good fifth longer than the stretched arm allows. Each step overcorrects the one before, and the shaking grows until it throws the arm about. Press the button that resets it with a smaller timestep. Then drag the timestep up until it shakes again.",
    panel: "plots",
    settings: (links) => from(links, { integrator: { method: "rk4", timestep: BEYOND[links] }, servo: true }),
  },
  {
    id: "held",
    name: "Held or continuous",
    text: "The controller holds each effort for a whole step, as a computer does. With control at every instant this method would be stable at half as much again. In the map the solid line is the limit with held efforts, the dashed one with control in every stage. Choose Euler, and the two fall together.",
    panel: "stability",
    settings: (links) => from(links, { integrator: { method: "rk4", timestep: 0.003 }, servo: true, setpoint: first(links, FOLDED) }),
  },
  {
    id: "stiff",
    name: "Stiff gains",
    text: "All gains are six times the usual ones. The arm reacts faster, and its largest stable timestep is a sixth: 1 ms is now beyond it. Click in the map left of the line to make it stable, and see how far right a lower gain lets you go.",
    panel: "stability",
    settings: (links) => from(links, { gains: scaled(/** @type {any} */ (DEFAULTS[links].gains), 6), servo: true, integrator: { method: "rk4", timestep: 0.001 } }),
  },
  {
    id: "heavy",
    name: "A heavy last link",
    text: "The last link is several times heavier, and the same gains are soft for it. The arm sways longer, and its timestep may be longer. Make that link 0.1 kg instead, and the limit falls: the same gain moves less mass faster.",
    panel: "plots",
    settings: (links) => from(links, {
      params: { gravity: 9.81, lengths: new Array(links).fill(1), masses: Array.from({ length: links }, (_, i) => (i === links - 1 ? HEAVY[links] : 1)) },
      servo: true, setpoint: first(links, FOLDED),
    }),
  },
  {
    id: "chaos",
    name: "Chaos and its horizon",
    text: "The same free swing, by the same method at three timesteps. They agree for some seconds, then part for good: every error grows tenfold about every second and a half. A smaller timestep buys a few seconds more, never the whole future.",
    panel: "compare",
    settings: (links) => from(links, {}),
    runs: [["rk4", 0.01], ["rk4", 0.005], ["rk4", 0.0025]],
    seconds: 20,
  },
  {
    id: "sag",
    name: "P sags, I holds",
    text: "Without integral gain the arm rests below its setpoint: the position error times the gain carries its weight. Raise the integral gain (300 will do). The error is summed up until nothing is left of it.",
    panel: "plots",
    settings: (links) => from(links, {
      gains: { ...structuredClone(SOFT[links]), ki: new Array(links).fill(0) }, servo: true, setpoint: first(links, [0.6, -0.4, 0.2]),
    }),
  },
  {
    id: "own",
    name: "Your own arm",
    text: "Set the masses and lengths of your arm, then its gains. Each integrator’s button shows its largest stable timestep at the setpoint, and “Why?” under the arm says what limits it. If no timestep is stable, or the arm is slow, take the suggested gains, or lower the integral ones and raise the others.",
    panel: "stability",
    settings: (links) => from(links, { servo: true, setpoint: first(links, FOLDED) }),
  },
];
