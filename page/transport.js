// Pause, single step and reset, and what the view says over the arm: hints, warnings, divergence.
// Invariant: a notice offers what can be done about it, and goes when its cause is gone.

import { announce } from "./announce.js";
import { byId, el, setText } from "./dom.js";
import { switchServo } from "./controls.js";
import { refusal } from "./field.js";
import { duration } from "./format.js";
import { nobodyProvides } from "./rosbridge.js";
import { pause, reset, setIntegrator, step } from "./runtime.js";
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
  byId("reset").addEventListener("click", resetArm);
  watch("paused", (paused) => {
    setText(byId("pause-text"), paused ? "Run" : "Pause");
    byId("pause").classList.toggle("is-paused", paused === true);
    announce(paused ? "Paused." : "Running.");
  });
  for (const key of ["diagnostics", "connection", "enabled", "goal", "integrator", "stability", "trial"]) watch(key, showNotice);
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

export async function resetArm() {
  if ((await report(reset())).result) announce("Reset: the arm is in its starting pose.");
}

// Notices, the gravest first

/**
 * The largest stable timestep [s] that is predicted for the present setting, control being held over each step; 0 where
 * no timestep is stable, infinite where every one is, NaN where nothing is known.
 */
export function limit() {
  if (state.stability) return state.stability.timestep_limit_held ?? Infinity;
  return state.estimate?.predicted_limit ?? NaN;
}

export function exceedsLimit() {
  return state.integrator != null && state.integrator.timestep > limit();
}

function showNotice() {
  const notice = choose();
  const key = notice ? notice.key : "";
  const box = byId("notice");
  if (key === shownNotice) {
    if (notice) setText(box.firstChild, notice.text);
    return;
  }
  shownNotice = key;
  box.className = notice ? `notice ${notice.kind}` : "notice";
  box.hidden = !notice;
  byId("stage").classList.toggle("diverged", key === "diverged");
  if (notice) box.replaceChildren(el("p", {}, notice.text), ...notice.buttons.map(([text, act]) => el("button", { type: "button", onclick: act }, text)));
}

function choose() {
  const { diagnostics, goal, integrator } = state;
  if (state.connection !== "open") {
    return state.links === 0
      ? { key: "connecting", kind: "calm", text: "Looking for the arm…", buttons: [] }
      : { key: "lost", kind: "bad", text: "Connection lost. Trying again…", buttons: [] };
  }
  const advised = state.stability?.advised_timestep;
  const calm = Number.isFinite(advised) && advised > 0 && advised < integrator?.timestep
    ? [[`Use ${duration(advised)}`, () => report(setIntegrator({ timestep: advised }))]] : [];
  if (diagnostics?.state === "diverged") {
    const why = exceedsLimit() ? ` ${overLimit()}` : "";
    return { key: "diverged", kind: "bad", text: `Diverged. ${sentence(diagnostics.message)}${why}`, buttons: [["Reset", resetArm], ...calm] };
  }
  // A free arm under a method that feeds it energy at any timestep is no news at every moment; the figures say it.
  if (exceedsLimit() && (limit() > 0 || state.enabled)) return { key: "limit", kind: "warn", text: overLimit(), buttons: calm };
  if (diagnostics?.level === 1 && diagnostics.real_time_factor < SLOW) {
    return { key: "slow", kind: "warn", text: `The runtime can't keep up: ${diagnostics.real_time_factor.toFixed(2)} of real time.`, buttons: calm };
  }
  if (state.enabled === false && (goal?.outcome === "active" || state.trial?.running)) {
    return { key: "servo", kind: "calm", text: "The servo is off, so the arm swings freely and doesn't follow.", buttons: [["Turn the servo on", () => switchServo(true)]] };
  }
  if (state.paused && goal?.outcome === "active") {
    return { key: "paused", kind: "calm", text: "Paused: the arm doesn't move.", buttons: [["Run", togglePause]] };
  }
  return null;
}

function overLimit() {
  return limit() > 0
    ? `Timestep ${duration(state.integrator.timestep)} is above the predicted stability limit ${duration(limit())}.`
    : "No timestep is stable with this integrator and these gains, by prediction.";
}

/** "diverged: step 12 was ...; reset clears this" as a sentence of its own. */
function sentence(message) {
  const text = message.replace(/^diverged:\s*/, "").replace(/;.*$/, "").replace(/\d+\.\d{5,}/g, (digits) => String(Number(Number(digits).toPrecision(6))));
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;
}
