// Two motions of a scene beside each other: the correct one, slowly, and one that fails, with a longer timestep or another method.
// Invariant: both are runs of the runtime, from the same start. The live arm does not change.

import { circle, links as drawLinks, STRONG, TEXT, write } from "./chart.js";
import { duration, shortName, significant } from "./format.js";
import { endOf } from "./ladder.js";
import { joints, reach } from "./mechanics.js";
import { noGains } from "./question.js";
import { settingsOf } from "./scenes.js";
import { colors } from "./theme.js";

/** @typedef {import("./scenes.js").Scene} Scene */
/** @typedef {import("./question.js").Question} Question */
/** @typedef {{question: Question, run: import("./question.js").Run}} Wanted */
/** @typedef {{name: string, note: string, poses: (number[] | null)[], lengths: number[], color: string, target?: number[]}} Motion */

/** The scenes of the course, each with method and timestep [s] of the motion that fails. @type {Record<string, {method?: string, timestep: number}>} */
export const FAILING = {
  S04: { method: "euler", timestep: 0.02 }, S05: { method: "euler", timestep: 0.01 }, S07: { timestep: 0.004 }, S08: { timestep: 0.001 },
  S09: { timestep: 0.001 }, S10: { timestep: 0.004 }, S11: { timestep: 0.05 }, S16: { timestep: 0.001 }, S17: { timestep: 0.001 },
  S18: { timestep: 0.001 }, S27: { timestep: 0.05 }, S29: { timestep: 1 },
};

const SAMPLES = 241; // pictures of a motion
const LEAST_STEPS = 24; // a failing run has at least this many steps, so that its failure shows

/** The correct and the failing run of a scene. @param {Scene} scene @returns {{correct: Wanted, failing: Wanted}} */
export function motionsOf(scene) {
  const { params, gains, period, controller, setpoint, integrator } = /** @type {any} */ (settingsOf(scene));
  const { seconds = 2, timestep = integrator.timestep, start = scene.start } = scene.watch ?? {};
  const fails = FAILING[scene.id] ?? { timestep: 0.05 };
  const loop = {
    params, gains: controller ? gains : noGains(scene.links), setpoint: setpoint ?? start, q: start, qd: scene.velocity ?? start.map(() => 0),
    control_period: controller ? period.period : 0, delay: controller ? period.delay : false,
  };
  const lasts = Math.max(seconds, LEAST_STEPS * fails.timestep);
  return {
    correct: { question: { ...loop, integrator: integrator.method, timestep }, run: { duration: seconds, samples: SAMPLES } },
    failing: { question: { ...loop, integrator: fails.method ?? integrator.method, timestep: fails.timestep }, run: { duration: lasts, samples: SAMPLES } },
  };
}

/** What is drawn of an answer. @param {Wanted} wanted @param {any} values @param {boolean} isCorrect @param {number} playedIn [s] @returns {Motion} */
export function motionOf({ question, run }, values, isCorrect, playedIn) {
  const ended = endOf(values);
  const slower = playedIn / run.duration;
  const pace = slower > 1 ? `${significant(slower, 2)} times slower` : `${significant(1 / slower, 2)} times faster`;
  return {
    name: `${isCorrect ? "Correct" : "Failing"}: ${shortName(question.integrator)}, ${duration(question.timestep)}`,
    note: ended !== null ? `diverged at ${duration(ended)}` : `${duration(run.duration)}, ${pace}`,
    poses: values.positions.map((/** @type {number[]} */ q) => (q?.every(Number.isFinite) ? q : null)),
    lengths: question.params.lengths, color: isCorrect ? "good" : "bad",
  };
}

const SHADOWS = 6; // most poses of the past that are drawn behind the present one
const APART = 4; // samples between them

/**
 * Plays motions on a surface, from the clock at which they began, in `lasts` [ms] each time; then it shows their ends.
 * @param {import("./surface.js").Surface} surface @param {Motion[]} motions @param {number} began @param {number} lasts @param {number} [rounds]
 */
export function playMotions(surface, motions, began, lasts, rounds = 1) {
  const part = (performance.now() - began) / lasts;
  drawMotions(surface, motions, part < rounds ? part % 1 : 1);
  if (part < rounds && motions.length > 0) requestAnimationFrame(() => surface.redraw());
}

/** @param {import("./surface.js").Surface} surface @param {Motion[]} motions @param {number} part of the time, from 0 to 1 */
function drawMotions({ context, width, height }, motions, part) {
  const count = Math.max(...motions.map(({ poses }) => poses.length)); // fewer are those of a run that diverged
  const half = width / motions.length;
  motions.forEach(({ name, note, poses, lengths, color, target }, side) => {
    const scale = Math.min(half, height - 48) / (2.1 * reach(lengths));
    const px = (/** @type {number} */ metres) => half * (side + 0.5) + scale * metres;
    const py = (/** @type {number} */ metres) => 44 + (height - 48) / 2 - scale * metres;
    const at = Math.min(poses.length - 1, Math.floor(part * (count - 1)));
    if (target) circle(context, px(target[0]), py(target[1]), 6, "", colors.target, 2);
    context.lineCap = context.lineJoin = "round";
    for (let k = SHADOWS; k >= 0; k -= 1) {
      const q = poses[Math.max(0, at - APART * k)];
      if (!q) continue;
      const [x, y] = [/** @type {number[]} */ ([]), /** @type {number[]} */ ([])];
      joints(lengths.length, q, lengths, x, y);
      context.globalAlpha = k === 0 ? 1 : 0.25 * (1 - k / (SHADOWS + 1));
      drawLinks(context, lengths.length, x, y, px, py, colors[color], 5);
    }
    context.globalAlpha = 1;
    write(context, name, half * (side + 0.5), 12, "center", colors.ink, STRONG);
    write(context, note, half * (side + 0.5), 32, "center", colors.muted, TEXT);
  });
}
