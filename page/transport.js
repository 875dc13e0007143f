// Under the arm: pause, single step and reset; and the notices: the verdict on the timestep, warnings, divergence.
// Invariant: a notice offers a remedy, and disappears with its cause.

import { beginAnew, recover, resetArm } from "./actions.js";
import { switchController, takeSuggestion } from "./controls.js";
import { announce, byId, el, passFocus, setText, warn } from "./dom.js";
import { refusal } from "./field.js";
import { duration, fixed } from "./format.js";
import { limitInForce, SLOW, verdict } from "./policy.js";
import { connectionText, MANY } from "./readouts.js";
import { change, pause, step } from "./runtime.js";
import { LOOP, state, watch } from "./store.js";

let said;
let shownNotice = "";

export function startTransport() {
  said = refusal(byId("pause"), byId("step"), byId("reset"));
  byId("transport").after(said.element);
  byId("pause").addEventListener("click", togglePause);
  byId("step").addEventListener("click", singleStep);
  byId("reset").addEventListener("click", resetNow);
  watch("paused", (paused) => {
    setText(byId("pause-text"), paused ? "Run" : "Pause");
    announce(paused ? "Paused." : "Running.");
  });
  watch([...LOOP, "goal", "trial"], showNotice);
}

export function resetNow() {
  return said.report(resetArm());
}

export function togglePause() {
  return setPaused(!state.paused);
}

export function setPaused(paused) {
  return said.report(pause(paused));
}

/** Takes the number of steps in the box. The arm is paused first, because only a paused arm can be stepped. */
export async function singleStep() {
  const steps = Number(byId("step-count").value);
  if (!state.paused && !(await said.report(pause(true))).result) return;
  said.report(step(steps));
}

// Notices, the most serious first

function showNotice() {
  const notice = choose();
  // A button with another figure is another button.
  const key = notice ? `${notice.key} ${notice.buttons.map(([text]) => text)}` : "";
  const box = byId("notice");
  if (key === shownNotice) {
    if (notice) setText(box.firstChild, notice.text);
    return;
  }
  shownNotice = key;
  passFocus(box);
  box.className = notice ? `notice ${notice.kind}` : "notice";
  box.hidden = !notice;
  byId("stage").classList.toggle("diverged", notice?.key === "diverged");
  if (notice?.kind === "bad" && notice.key !== "diverged" && notice.key !== "lost") warn(notice.text); // those two are announced already
  if (notice) box.replaceChildren(el("p", {}, notice.text),
    ...notice.buttons.map(([text, act]) => el("button", { type: "button", class: "small", onclick: act }, text)));
}

function choose() {
  const { diagnostics, goal } = state;
  const { kind, sentence, advised, slow } = verdict(state);
  if (kind === "offline") {
    const { connection, failures, links } = state;
    const key = connection === "silent" ? connection : links > 0 ? "lost" : "connecting";
    return { key, kind: links > 0 || failures >= MANY ? "bad" : "calm", text: connectionText(), buttons: [] };
  }
  const smaller = slow ? [["Control at every step", () => said.report(change("period", { period: 0 }))]]
    : advised > 0 ? [[`Restart at ${duration(advised)}`, () => said.report(recover(advised))]] : [];
  // No timestep helps if the gains are the cause.
  const other = state.enabled && limitInForce(state).everyPose === 0 ? [["Suggest gains", takeSuggestion]] : [];
  if (kind === "diverged") {
    return { key: "diverged", kind: "bad", text: `Diverged${whenOf(diagnostics.message)}. ${sentence}`,
      buttons: [...smaller, ...other, ["Restart", () => said.report(beginAnew())]] };
  }
  if (kind === "beyond" || (kind === "never" && state.enabled)) return { key: "limit", kind: "bad", text: sentence, buttons: [...smaller, ...other] };
  if (diagnostics?.level === 1 && !state.paused && diagnostics.real_time_factor < SLOW) {
    return { key: "slow", kind: "warn", text: `The runtime can't keep up: ${diagnostics.real_time_factor.toFixed(2)} of real time.`, buttons: [] };
  }
  if (state.enabled === false && (goal?.outcome === "active" || state.trial?.running)) {
    return { key: "controller", kind: "calm", text: "The controller is off, so the arm swings freely and does not follow.",
      buttons: [["Turn the controller on", () => switchController(true)]] };
  }
  if (state.paused && goal?.outcome === "active") {
    return { key: "paused", kind: "calm", text: "Paused: the arm does not move.", buttons: [["Run", togglePause]] };
  }
  return kind === "here" ? { key: "here", kind: "warn", text: sentence, buttons: [...smaller, ...other] } : null;
}

/** The time in "diverged: step 12 from t = 0.6 s was not finite ..."; nothing if it names none. */
function whenOf(message) {
  const time = /t = ([\d.e-]+) s/.exec(message);
  return time ? ` at t = ${fixed(Number(time[1]), 3)} s` : "";
}
