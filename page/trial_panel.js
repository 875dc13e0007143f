// @ts-check
// The timed trial: start, skip, stop, with its clock and count.
// Invariant: the clock and the count are those of the runtime, whoever started the trial.

import { announce } from "./announce.js";
import { byId, el, setText } from "./dom.js";
import { option, refusal } from "./field.js";
import { fixed } from "./format.js";
import { trialSkip, trialStart, trialStop } from "./runtime.js";
import { state, watch } from "./store.js";

const fields = {
  duration: option({ label: "duration", unit: "s", placeholder: "default" }),
  epsilon: option({ label: "tolerance", unit: "m", placeholder: "default" }),
  success_hold: option({ label: "hold", unit: "s", placeholder: "default" }),
};
let said;
let wasRunning = false;

export function startTrialPanel() {
  const start = el("button", { type: "button", class: "primary", id: "trial-start", onclick: begin }, "Start trial");
  const skip = el("button", { type: "button", id: "trial-skip", onclick: () => report(trialSkip()) }, "Skip");
  const stop = el("button", { type: "button", id: "trial-stop", onclick: () => report(trialStop()) }, "Stop");
  said = refusal(start, skip, stop, ...Object.values(fields).map((one) => one.input));
  byId("trial-body").append(
    el("div", { class: "options" }, ...Object.values(fields).map((one) => one.element)),
    el("div", { class: "buttons" }, start, skip, stop), said.element,
  );
  watch("trial", show);
}

async function begin() {
  const args = {};
  for (const [name, one] of Object.entries(fields)) if (one.number() !== undefined) args[name] = one.number();
  const answer = await trialStart(args);
  said.show(answer.result ? "" : answer.status);
  for (const [name, one] of Object.entries(fields)) {
    const accepted = answer.values[name];
    if (Number.isFinite(accepted)) one.input.placeholder = String(accepted);
  }
}

async function report(call) {
  const answer = await call;
  said.show(answer.result ? "" : answer.status);
}

function show(trial) {
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
  setText(byId("trial-note"), waits ? "Another goal took over: skip to go on." : trial.running && state.enabled === false ? "The controller is off: nothing will be reached." : "");
  if (wasRunning && !trial.running) announce(`Trial over: ${count}.`);
  wasRunning = trial.running;
}
