// @ts-check
// Pause, single step and reset, and what is said under the arm: the verdict on the timestep, warnings, divergence.
// Invariant: a notice offers what can be done about it, and goes when its cause is gone.

import { beginAnew, recover, resetArm } from "./actions.js";
import { announce, warn } from "./announce.js";
import { byId, el, setText } from "./dom.js";
import { switchServo, takeSuggestion } from "./controls.js";
import { refusal } from "./field.js";
import { duration, fixed } from "./format.js";
import { limitInForce, verdict } from "./policy.js";
import { nobodyProvides } from "./rosbridge.js";
import { pause, setPeriod, step } from "./runtime.js";
import { state, watch } from "./store.js";

/** Below this real-time factor a warning of the runtime is about its pace. */
const SLOW = 0.95;

let said;
let shownNotice = "";

export function startTransport() {
  said = refusal(byId("pause"), byId("step"), byId("reset"));
  byId("transport").after(said.element);
  byId("pause").addEventListener("click", togglePause);
  byId("step").addEventListener("click", singleStep);
  byId("reset").addEventListener("click", () => report(resetArm()));
  watch("paused", (paused) => {
    setText(byId("pause-text"), paused ? "Run" : "Pause");
    byId("pause").classList.toggle("is-paused", paused === true);
    announce(paused ? "Paused." : "Running.");
  });
  const causes = ["diagnostics", "connection", "enabled", "goal", "integrator", "gains", "params", "period", "setpoint", "stability", "trial"];
  for (const key of causes) watch(key, showNotice);
}

async function report(call) {
  const answer = await call;
  said.show(answer.result ? "" : answer.status);
  return answer;
}

export function togglePause() {
  return report(pause(!state.paused));
}

export function setPaused(paused) {
  return report(pause(paused));
}

/** One step, or as many as the box says; the arm is paused first, since only then can it be stepped. */
export async function singleStep() {
  const steps = Number(byId("step-count").value);
  if (!state.paused && !(await report(pause(true))).result) return;
  const answer = await step(steps);
  said.show(nobodyProvides(answer) ? `This runtime can't be stepped: ${answer.status}` : answer.result ? "" : answer.status);
}

// Notices, the gravest first

function showNotice() {
  const notice = choose();
  // A button is another one when its figure is.
  const key = notice ? `${notice.key} ${notice.buttons.map(([text]) => text)}` : "";
  const box = byId("notice");
  if (key === shownNotice) {
    if (notice) setText(box.firstChild, notice.text);
    return;
  }
  shownNotice = key;
  box.className = notice ? `notice ${notice.kind}` : "notice";
  box.hidden = !notice;
  byId("stage").classList.toggle("diverged", notice?.key === "diverged");
  if (notice?.kind === "bad" && notice.key !== "diverged" && notice.key !== "lost") warn(notice.text); // those two are said already
  if (notice) box.replaceChildren(el("p", {}, notice.text), ...notice.buttons.map(([text, act]) => el("button", { type: "button", class: "small", onclick: act }, text)));
}

function choose() {
  const { diagnostics, goal } = state;
  const { kind, sentence, advised, slow } = verdict(state);
  if (kind === "offline") {
    return state.links === 0
      ? { key: "connecting", kind: "calm", text: "Looking for the arm…", buttons: [] }
      : { key: "lost", kind: "bad", text: "Connection lost. Trying again…", buttons: [] };
  }
  const smaller = slow ? [["Control at every step", () => report(setPeriod({ period: 0 }))]]
    : advised > 0 ? [[`Restart at ${duration(advised)}`, () => report(recover(advised))]] : [];
  // No timestep helps where the gains are at fault.
  const other = state.enabled && limitInForce(state).everyPose === 0 ? [["Suggest gains", takeSuggestion]] : [];
  if (kind === "diverged") {
    return { key: "diverged", kind: "bad", text: `Diverged${whenOf(diagnostics.message)}. ${sentence}`, buttons: [...smaller, ...other, ["Restart", () => report(beginAnew())]] };
  }
  if (kind === "beyond" || (kind === "never" && state.enabled)) return { key: "limit", kind: "bad", text: sentence, buttons: [...smaller, ...other] };
  if (diagnostics?.level === 1 && !state.paused && diagnostics.real_time_factor < SLOW) {
    return { key: "slow", kind: "warn", text: `The runtime can't keep up: ${diagnostics.real_time_factor.toFixed(2)} of real time.`, buttons: [] };
  }
  if (state.enabled === false && (goal?.outcome === "active" || state.trial?.running)) {
    return { key: "servo", kind: "calm", text: "The controller is off, so the arm swings freely and doesn't follow.", buttons: [["Turn the controller on", () => switchServo(true)]] };
  }
  if (state.paused && goal?.outcome === "active") {
    return { key: "paused", kind: "calm", text: "Paused: the arm doesn't move.", buttons: [["Run", togglePause]] };
  }
  return kind === "here" ? { key: "here", kind: "warn", text: sentence, buttons: [...smaller, ...other] } : null;
}

/** The time in "diverged: step 12 from t = 0.6 s was not finite ..."; nothing if it names none. */
function whenOf(message) {
  const time = /t = ([\d.e-]+) s/.exec(message);
  return time ? ` at t = ${fixed(Number(time[1]), 3)} s` : "";
}
