// Responses of the first joint to one move, drawn over each other: those that are complete, with their settings, and the present one.
// Invariant: a response is the recorded motion of the live arm since its last reset, and belongs to one setting.

import { significant } from "./format.js";
import { POSITION, record, TIME } from "./history.js";
import { rolloutArgs } from "./question.js";

/** @typedef {import("./question.js").Gains} Gains */
/** @typedef {{effort: number[] | null, anti_windup: string}} Motors */
/**
 * @typedef {{gains: Gains, motors: Motors | null, name: string, question: import("./question.js").Question, points: number[][], overshoot: number,
 * error: number}} Response
 */

/** Length of a response [s]. */
export const LASTS = 5;
const MOST = 4; // responses that are kept
const SMALL = 0.02; // smaller overshoots and errors are not seen [rad]
const LARGE = 0.05;

/** The present motion of the first joint since the reset: pairs of time [s] and angle [rad]. The reset itself is in another pose. */
export function present() {
  const points = [];
  for (let i = 0; i < record.length; i += 1) {
    const row = record.at(i);
    const time = record.data[row + TIME];
    if (time > 0 && time <= LASTS) points.push([time, record.data[row + POSITION]]);
  }
  return points;
}

/** How far a motion passed the setpoint, and how far from it it ends [rad]. @param {number[][]} points @param {number} setpoint */
export function judge(points, setpoint) {
  const overshoot = Math.max(0, ...points.map(([, q]) => q - setpoint));
  const [, last] = points.at(-1) ?? [0, NaN];
  return { overshoot, error: Math.abs(last - setpoint) };
}

/** The settings of a response in words. @param {Gains} gains @param {Motors | null} motors */
export function nameOf({ kp, ki, kd }, motors) {
  const limit = motors?.effort ? `, ${significant(motors.effort[0], 3)} N m, ${WORDS[motors.anti_windup] ?? motors.anti_windup}` : "";
  return `kp ${significant(kp[0], 3)}, ki ${significant(ki[0], 3)}, kd ${significant(kd[0], 3)}${limit}`;
}

/** @type {Record<string, string>} */
export const WORDS = { clamp: "no cure", none: "no cure", conditional: "conditional", back_calculation: "back-calculation" };

/** Adds a complete response. One with the same settings replaces the old one. @param {Response[]} responses @param {Response} one */
export function keep(responses, one) {
  return [...responses.filter(({ name }) => name !== one.name), one].slice(-MOST);
}

/** Complete responses, to be copied. @param {Response[]} responses @returns {import("./copy.js").Content} */
export function responsesContent(responses) {
  return {
    name: "Joint 1 comes up to its setpoint", columns: ["settings", "time [s]", "joint 1 [rad]"],
    rows: responses.flatMap(({ name, points }) => points.map(([time, angle]) => [name, time, angle])),
    asked: responses.map(({ question }) => rolloutArgs(question, { duration: LASTS, samples: 60 * LASTS + 1 })),
    python: `[(name, t, q[0]) for name, run in zip(${JSON.stringify(responses.map(({ name }) => name))}, runs) for t, q in zip(run.times, run.positions)]`,
  };
}

/** What the complete responses show: a sag, too much integral, windup, its cure with the same gains. @param {Response[]} responses */
export function shown(responses) {
  const has = (/** @type {Response} */ { gains }) => gains.ki[0] > 0;
  const isCured = (/** @type {Response} */ { motors }) => WORDS[motors?.anti_windup ?? ""] !== "no cure";
  const limited = responses.filter(({ motors }) => motors?.effort);
  const windups = limited.filter((one) => has(one) && !isCured(one) && one.overshoot > LARGE);
  const same = (/** @type {Response} */ one) => windups.some(({ gains }) => JSON.stringify(gains) === JSON.stringify(one.gains));
  return {
    sag: responses.some((one) => !has(one) && one.error > SMALL && one.overshoot < LARGE),
    overshoot: responses.some((one) => has(one) && !one.motors?.effort && one.overshoot > LARGE),
    windup: windups.length > 0,
    cure: limited.some((one) => has(one) && isCured(one) && one.overshoot < SMALL && one.error < SMALL && same(one)),
  };
}
