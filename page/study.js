// Requests to the study that take several calls: a series of errors, a column of limits, a push.
// Invariant: the live arm does not change, and outdated results are not reported.

import { read, rungs } from "./ladder.js";
import { fromRest, rolloutArgs, stabilityArgs } from "./question.js";
import { rollout, stability } from "./runtime.js";

/** @typedef {import("./question.js").Question} Question */

const SAMPLES = 101;
const PUSH_SPEED = 1e-6; // rad/s
/** Number of samples of the deviation after a push. */
export const LOOKS = 14;

/** Runs of one move with all methods and timesteps. A new measurement ends the old one. */
export class Series {
  runs = /** @type {import("./ladder.js").Rung[]} */ ([]);
  asked = /** @type {import("./copy.js").Asked[]} */ ([]); // the requests of the runs
  move = /** @type {Question | null} */ (null);

  /**
   * Runs the series, one run at a time. Returns the refusal, if there is one, and null if it was ended.
   * @param {Question} move @param {number} length [s] @param {() => boolean} isWanted whether to go on @param {() => void} tell
   */
  async measure(move, length, isWanted, tell) {
    this.forget();
    const { runs, asked } = Object.assign(this, { move });
    const run = { duration: length, samples: SAMPLES, reference: true };
    for (const rung of rungs(move.control_period)) {
      const question = { ...move, integrator: rung.method, timestep: rung.timestep };
      const answer = await rollout(question, run);
      if (this.runs !== runs || !isWanted()) return null;
      if (!answer.result) return answer.status;
      // The shorter of two times, which reduces the effect of other work on the machine.
      const again = await rollout(question, { ...run, reference: false });
      const wall = Math.min(answer.values.wall_time, again.values.wall_time ?? Infinity);
      if (this.runs !== runs || !isWanted()) return null;
      runs.push(read(rung, { ...answer.values, wall_time: wall }));
      asked.push(rolloutArgs(question, run));
      tell();
    }
    return "";
  }

  forget() {
    Object.assign(this, { runs: [], asked: [], move: null });
  }

  /** The runs, to be copied. A run that diverged has no error. @returns {import("./copy.js").Content} */
  content() {
    return {
      name: "Error over run time", columns: ["method", "timestep [s]", "error of the method [rad]", "error of the hold [rad]", "run time [s]"],
      rows: this.runs.map(({ method, timestep, error, sampling, wall }) => [method, timestep, error, sampling, wall]), asked: this.asked,
      python: '[(one["method"], one["timestep"], run.error, run.sampling_error, run.wall_time) for one, run in zip(asked, runs)]',
      note: "Run times differ from machine to machine, and from run to run.",
    };
  }
}

/**
 * The border of a map: the limits at multiples of the gains, the lowest first, as far as they are known. They belong to one question, and
 * another question ends the old requests.
 */
export class Border {
  rows = /** @type {import("./chart.js").Row[]} */ ([]);
  about = ""; // the question of the rows
  at = /** @type {(factor: number) => Question} */ (() => { throw new Error("no question yet"); });
  names = /** @type {Record<string, string>} */ ({});

  /** @param {import("./scale.js").LogScale} scale of the multiples @param {number} count of rows @param {() => void} tell called at each new row */
  constructor(scale, count, tell) {
    this.scale = scale;
    this.count = count;
    this.tell = tell;
  }

  /** Asks, unless it was asked already. @param {(factor: number) => Question} at @param {Record<string, string>} names of a row's limits in an answer */
  async ask(at, names) {
    const about = JSON.stringify([at(1), names]);
    if (about === this.about) return;
    Object.assign(this, { about, at, names, rows: [] });
    for (let row = 0; row < this.count; row += 1) {
      const factor = this.scale.value(row / (this.count - 1));
      const { result, values } = await stability(at(factor));
      if (this.about !== about) return;
      if (!result) continue;
      this.rows.push({ factor, limit: NaN, ...Object.fromEntries(Object.entries(names).map(([key, name]) => [key, values[name] ?? Infinity])) });
      this.tell();
    }
    if (this.rows.length < this.count) this.about = ""; // asked again at the next message
  }

  /** The rows, to be copied. @param {string} name @returns {import("./copy.js").Content} */
  content(name) {
    const factors = this.rows.map(({ factor }) => factor);
    const kind = this.names.continuous ? "timestep, torque held" : "control period";
    return {
      name, columns: ["multiple of the gains", `limit of the ${kind} [s]`], rows: this.rows.map((row) => [row.factor, row.limit]),
      asked: factors.map((factor) => stabilityArgs(this.at(factor))),
      python: `zip([${factors.join(", ")}], [run.${this.names.limit} for run in runs])`,
    };
  }
}

/**
 * A tiny push of the last joint at rest: its speed [rad/s] at each of the next samples, `every` [s] apart. It is the difference of two runs, with and without
 * the push, and null if they are refused. Also what can be copied of it. @param {Question} loop @param {number[]} rest pose [rad] @param {number} every
 */
export async function deviation(loop, rest, every) {
  const question = fromRest(loop, rest);
  const run = { duration: LOOKS * every, samples: LOOKS + 1 };
  const pushedOne = { ...question, qd: question.qd.with(-1, PUSH_SPEED) };
  const [still, pushed] = await Promise.all([rollout(question, run), rollout(pushedOne, run)]);
  if (!still.result || !pushed.result) return null;
  const bars = pushed.values.velocities.slice(1).map((row, k) => row.at(-1) - (still.values.velocities[k + 1]?.at(-1) ?? 0));
  return { bars, content: {
    name: "A tiny push, at each measurement", columns: ["measurement", "speed of the last joint [rad/s]"], rows: bars.map((bar, k) => [k + 1, bar]),
    asked: [rolloutArgs(question, run), rolloutArgs(pushedOne, run)],
    python: "[(k, b[-1] - a[-1]) for k, (a, b) in enumerate(zip(runs[0].velocities, runs[1].velocities)) if k > 0]",
  } };
}
