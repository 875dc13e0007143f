// @ts-check
// A small push, in speed, of the loop in force, step by step: whether it dies away, and whether it flips.
// Invariant: the bars are a run of the runtime's own at the present timestep.

import { shrinks } from "./course.js";
import { drawBars } from "./course_charts.js";
import { byId, setText } from "./dom.js";
import { duration } from "./format.js";
import { onFrame, wake } from "./frames.js";
import { latestOnly } from "./latest.js";
import { answerInForce, question } from "./policy.js";
import { rollout } from "./runtime.js";
import { state, watch } from "./store.js";
import { Surface } from "./surface.js";
import { onTheme } from "./theme.js";

const PUSH = 1e-6; // rad/s
const STEPS = 14;
const ASK_MS = 60;

let surface;
let bars = /** @type {number[]} */ ([]);
let asked = "";
let stale = true;

export function startSteps() {
  surface = new Surface(byId("push-bars"), redraw);
  onTheme(redraw);
  for (const key of ["integrator", "gains", "params", "setpoint", "stability", "enabled", "period", "tab", "view"]) watch(key, look);
  onFrame(draw);
}

function redraw() {
  stale = true;
  wake();
}

function look() {
  const loop = question(state);
  if (!loop || state.tab !== "stability" || state.view !== "workbench") return;
  const key = JSON.stringify([loop, state.integrator]);
  if (key !== asked) {
    asked = key;
    inquire({ loop, key });
  }
  redraw();
}

/** The same run with the push and without it: their difference is the deviation. */
const inquire = latestOnly(async ({ loop, key }) => {
  const n = state.links;
  const { timestep } = state.integrator;
  const rest = answerInForce(state)?.equilibrium ?? loop.setpoint ?? new Array(n).fill(0);
  const common = { ...loop, timestep, setpoint: loop.setpoint ?? rest, duration: STEPS * timestep, samples: STEPS + 1 };
  const [still, pushed] = [await rollout({ ...common, q0: rest }), await rollout({ ...common, q0: rest, qdot0: rest.map((_, i) => (i === n - 1 ? PUSH : 0)) })];
  if (key !== asked || !still.result || !pushed.result) return;
  bars = pushed.values.velocities.slice(1).map((row, k) => row[n - 1] - (still.values.velocities[k + 1]?.[n - 1] ?? 0));
  setText(byId("push-text"), `${state.enabled ? "The controller’s loop" : "The free arm"} at ${duration(timestep)}: the push ${shrinks(bars) ? "dies away" : "does not die away"} within ${STEPS} steps.`);
  redraw();
}, ASK_MS);

function draw() {
  if (!stale || state.tab !== "stability" || surface.width === 0) return false;
  stale = false;
  drawBars(surface, bars, "step");
  return false;
}
