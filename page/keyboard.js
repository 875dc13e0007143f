// Single-key shortcuts, those of the classic pendularm page first, and the overlay that lists them.
// Invariant: no shortcut acts while the user types, and all can be switched off.

import { takeBack } from "./actions.js";
import { chooseMethod, nextJoint, nudgeSetpoint, switchController } from "./controls.js";
import { announce, byId, el, keepChoice, remembered } from "./dom.js";
import { METHODS } from "./format.js";
import { zoomPlots } from "./plots.js";
import { state, watch } from "./store.js";
import { cancelTarget, push } from "./tasks_panel.js";
import { resetNow, setPaused, singleStep, togglePause } from "./transport.js";

const NUDGE = 0.05; // rad, as on the classic page
const PUSH_MS = 90; // a held key repeats faster than pushes are sent
const SWITCH = "pendularm-shortcuts";

let stoppedByZero = false;
let lastPush = -Infinity;
let lastSign = 0;

const shortcuts = [
  ["0", "no integrator: pause", () => { stoppedByZero = true; setPaused(true); }],
  ...METHODS.map(([method, name], i) => [String(i + 1), name, () => useMethod(method, name)]),
  ["a", "push the joint counter-clockwise", () => pushNow(1)],
  ["d", "push the joint clockwise", () => pushNow(-1)],
  ["q", "setpoint of the joint − 0.05 rad", () => nudgeSetpoint(-NUDGE)],
  ["e", "setpoint of the joint + 0.05 rad", () => nudgeSetpoint(NUDGE)],
  ["c", "controller on or off", () => switchController(!state.enabled)],
  ["x", "controller on or off", () => switchController(!state.enabled)],
  ["s", "controller off", () => switchController(false)],
  ["j", "next joint", nextJoint],
  [" ", "pause or run", togglePause],
  [".", "single step", singleStep],
  ["r", "reset", resetNow],
  ["z", "undo the last change", takeBack],
  ["g", "cancel the target", cancelTarget],
  ["+", "plots: less time", () => zoomPlots(1)],
  ["-", "plots: more time", () => zoomPlots(-1)],
  ["?", "this list", toggleHelp],
];
/** @type {Map<string, () => void>} */
const actions = new Map(shortcuts.map(([key, , act]) => /** @type {any} */ ([key, act])));

/** After key 0, choosing an integrator resumes the arm, if nothing else has resumed it. */
async function useMethod(method, name) {
  const goOn = stoppedByZero;
  stoppedByZero = false;
  if ((await chooseMethod(method)).result) announce(`${name}.`);
  if (goOn) setPaused(false);
}

function pushNow(sign) {
  const now = performance.now();
  if (sign === lastSign && now - lastPush < PUSH_MS) return;
  lastPush = now;
  lastSign = sign;
  push(sign);
}

export function startKeyboard() {
  const rows = shortcuts.map(([key, text]) => el("tr", {}, el("td", {}, el("kbd", {}, key === " " ? "space" : key)), el("td", {}, text)));
  rows.push(el("tr", {}, el("td", {}, el("kbd", {}, "← ↑ ↓ →")),
    el("td", {}, "in the view: move the choice beside “drag”; with shift, the setpoint")));
  byId("help-keys").append(...rows);
  byId("help-button").addEventListener("click", toggleHelp);
  for (const button of document.querySelectorAll("dialog .close")) button.addEventListener("click", () => button.closest("dialog")?.close());
  const box = byId("shortcuts-on");
  box.checked = remembered(SWITCH) !== "off";
  box.addEventListener("change", () => keepChoice(SWITCH, box.checked ? "on" : "off"));
  document.addEventListener("keydown", pressed);
  watch("paused", (paused) => { if (!paused) stoppedByZero = false; });
}

function pressed(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || event.isComposing) return;
  const { target, key } = event;
  const typing = target.matches("input:not([type=range], [type=radio], [type=checkbox]), select, textarea");
  // The focused element keeps the keys that it uses itself.
  const own = key === " " && target.matches("button, input, summary, select");
  if (typing || own) return;
  if (!byId("shortcuts-on").checked && key !== "?") return;
  if (document.querySelector("dialog[open]") && key !== "?") return;
  const act = actions.get(key.length === 1 ? key.toLowerCase() : key);
  if (!act) return;
  event.preventDefault();
  if (event.repeat && !["a", "d", "q", "e", "."].includes(key.toLowerCase())) return;
  act();
}

function toggleHelp() {
  const help = byId("help");
  if (help.open) help.close();
  else help.showModal();
}
