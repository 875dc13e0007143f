// The panel of goals, timed trials and pushes. Dragging in the view uses the goal's options.
// Invariant: a goal is shown as active only while the runtime reports it so. The clock and the count of a trial come from the
// runtime, whichever client started it.

import { announce, byId, el, setText, warn } from "./dom.js";
import { option, panel } from "./field.js";
import { fixed } from "./format.js";
import { DEFAULT_EPSILON, cancelGoal, disturb, sendGoal, trialSkip, trialStart, trialStop } from "./runtime.js";
import { settingsKnown, state, watch, whenKnown } from "./store.js";

export function startTasks() {
  startGoal();
  startTrial();
  startPush();
}

const fields = {
  x: option({ label: "x", unit: "m" }),
  y: option({ label: "y", unit: "m" }),
  phi: option({ label: "orientation", unit: "rad", placeholder: "any" }),
  epsilon: option({ label: "tolerance", unit: "m", placeholder: String(DEFAULT_EPSILON) }),
  success_hold: option({ label: "hold", unit: "s", placeholder: "0.5" }),
};
let goalSaid;
let text;
let shownId = ""; // of the shown goal

function startGoal() {
  text = el("p", { class: "note", id: "goal-text" });
  goalSaid = panel(byId("goal-body"), Object.values(fields), [
    // The runtime names the missing fields.
    ["Send target", () => goalSaid.report(sendGoal({ x: fields.x.number(), y: fields.y.number(), ...goalOptions() })), { type: "submit", class: "primary" }],
    ["Cancel target", cancelTarget],
  ], text);
  watch("links", (links) => { fields.phi.element.hidden = links < 3; });
  watch("goal", showGoal);
  showGoal(null);
}

/** Orientation and tolerance for the next goal. An empty field has the runtime's default, as have all in the course. */
export function goalOptions() {
  if (state.view === "course") return {};
  return {
    phi: state.links > 2 ? fields.phi.number() : undefined,
    epsilon: fields.epsilon.number(),
    success_hold: fields.success_hold.number(),
  };
}

export function cancelTarget() {
  return goalSaid.report(cancelGoal());
}

/** A refusal of a place in the view, which is not a refusal of the fields. */
export function showGoalRefusal(status) {
  setText(goalSaid.element, status);
  if (status) warn(status);
}

export function showGoalPlace({ x, y }) {
  fields.x.input.value = String(Number(x.toFixed(3)));
  fields.y.input.value = String(Number(y.toFixed(3)));
}

function showGoal(goal) {
  if (goal && goal.id !== shownId) {
    shownId = goal.id;
    goalSaid.show(""); // an earlier refusal is outdated
  }
  if (!goal) setText(text, "Drag in the view, or type a place for the end effector.");
  else if (goal.outcome === "active") setText(text, `On the way: ${fixed(goal.distance, 3)} m left, ${fixed(goal.elapsed, 1)} s.`);
  else if (goal.outcome === "reached") setText(text, `Reached, ${fixed(goal.distance * 1000, 1)} mm from the target.`);
  else setText(text, "Ended by another target, a cancellation or a reset.");
}

// The timed trial

const trialFields = {
  duration: option({ label: "duration", unit: "s", placeholder: "default" }),
  epsilon: option({ label: "tolerance", unit: "m", placeholder: "default" }),
  success_hold: option({ label: "hold", unit: "s", placeholder: "default" }),
};
let trialSaid;
let wasRunning = false;

function startTrial() {
  trialSaid = panel(byId("trial-body"), Object.values(trialFields), [
    ["Start trial", begin, { class: "primary", id: "trial-start" }],
    ["Skip", () => trialSaid.report(trialSkip()), { id: "trial-skip" }],
    ["Stop", () => trialSaid.report(trialStop()), { id: "trial-stop" }],
  ]);
  watch("trial", showTrial);
}

async function begin() {
  const given = Object.entries(trialFields).map(([name, one]) => [name, one.number()]).filter(([, value]) => value !== undefined);
  const { values } = await trialSaid.report(trialStart(Object.fromEntries(given)));
  for (const [name, one] of Object.entries(trialFields)) if (Number.isFinite(values[name])) one.input.placeholder = String(values[name]);
}

function showTrial(trial) {
  const score = byId("trial-score");
  score.hidden = !trial;
  byId("trial-hud").hidden = !trial?.running;
  if (!trial) {
    wasRunning = false;
    return;
  }
  const left = Math.max(0, trial.duration - trial.elapsed);
  const clock = trial.running ? `${fixed(left, 1)} s left` : `ended after ${fixed(trial.elapsed, 1)} s`;
  const count = `${trial.targets_reached} reached`;
  setText(byId("trial-clock"), clock);
  setText(byId("trial-count"), count);
  setText(byId("trial-hud"), `${count} · ${clock}`);
  byId("trial-progress").value = trial.duration > 0 ? Math.min(1, trial.elapsed / trial.duration) : 0;
  setText(byId("trial-error"), trial.error == null ? "" : `${fixed(trial.error, 3)} m to go`);
  const waits = trial.running && trial.action_status === "preempted";
  setText(byId("trial-note"), waits ? "Another target replaced this one. Press Skip to continue." : trial.running && state.enabled === false
    ? "The controller is off, so the arm does not move to the targets." : "");
  if (wasRunning && !trial.running) announce(`Trial over: ${count}.`);
  wasRunning = trial.running;
}

// Pushes

const PUSH_EFFORT = 50; // N m, as on the classic page
const PUSH_SECONDS = 0.1;

const pushEffort = option({ label: "torque", unit: "N m", value: PUSH_EFFORT });
const pushSeconds = option({ label: "duration", unit: "s", value: PUSH_SECONDS });
let pushSaid;

function startPush() {
  pushSaid = panel(byId("push-body"), [pushEffort, pushSeconds], [
    ["↺ Push", () => push(1), { "aria-label": "Push counter-clockwise" }], ["↻ Push", () => push(-1), { "aria-label": "Push clockwise" }],
  ]);
}

/** Pushes the chosen joint, counter-clockwise for 1, clockwise for -1. */
export function push(sign) {
  const efforts = (links) => new Array(links).fill(0).with(state.joint, sign * (pushEffort.number() ?? PUSH_EFFORT));
  pushSaid.report(whenKnown(settingsKnown, (links) => disturb(efforts(links), pushSeconds.number() ?? PUSH_SECONDS)));
}
