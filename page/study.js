// Requests to the study that take several calls: a series of errors, a column of limits, a push.
// Invariant: the live arm does not change, and outdated results are not reported.

import { read, rungs } from "./ladder.js";
import { fromRest } from "./question.js";
import { rollout, stability } from "./runtime.js";

/** @typedef {import("./question.js").Question} Question */

const SAMPLES = 101;
const PUSH_SPEED = 1e-6; // rad/s
/** Number of samples of the deviation after a push. */
export const LOOKS = 14;

/**
 * Runs the series on one move of a loop, one run at a time. Returns the refusal, if there is one.
 * @param {Question} move @param {number} length [s] @param {() => boolean} isWanted whether to go on
 * @param {(rung: import("./ladder.js").Rung) => void} tell
 */
export async function climb(move, length, isWanted, tell) {
  const run = { duration: length, samples: SAMPLES, reference: true };
  for (const rung of rungs(move.control_period)) {
    const question = { ...move, integrator: rung.method, timestep: rung.timestep };
    const answer = await rollout(question, run);
    if (!isWanted()) return "";
    if (!answer.result) return answer.status;
    // The shorter of two times, which reduces the effect of other work on the machine.
    const again = await rollout(question, { ...run, reference: false });
    const wall = Math.min(answer.values.wall_time, again.values.wall_time ?? Infinity);
    if (!isWanted()) return "";
    tell(read(rung, { ...answer.values, wall_time: wall }));
  }
  return "";
}

/**
 * Asks the study about `count` multiples of the gains, the lowest first, and reports each answer on arrival.
 * @param {import("./scale.js").LogScale} scale of the multiples
 * @param {number} count
 * @param {(factor: number) => Question} ask the question at a multiple
 * @param {() => boolean} isWanted whether to go on
 * @param {(factor: number, values: any) => void} tell
 */
export async function climbRows(scale, count, ask, isWanted, tell) {
  for (let row = 0; row < count && isWanted(); row += 1) {
    const factor = scale.value(row / (count - 1));
    const { result, values } = await stability(ask(factor));
    if (result && isWanted()) tell(factor, values);
  }
}

/**
 * A tiny push of the last joint at rest: its speed [rad/s] at each of the next samples, `every` [s] apart. It is the
 * difference of two runs, with and without the push, and null if they are refused.
 * @param {Question} loop @param {number[]} rest pose [rad] @param {number} every
 */
export async function deviation(loop, rest, every) {
  const question = fromRest(loop, rest);
  const run = { duration: LOOKS * every, samples: LOOKS + 1 };
  const pushedOne = { ...question, qd: question.qd.with(-1, PUSH_SPEED) };
  const [still, pushed] = await Promise.all([rollout(question, run), rollout(pushedOne, run)]);
  if (!still.result || !pushed.result) return null;
  return pushed.values.velocities.slice(1).map((row, k) => row.at(-1) - (still.values.velocities[k + 1]?.at(-1) ?? 0));
}
