// Actions on all settings at once: apply them, undo the last change, return to the defaults, set a scene; and the matching reset.
// Invariant: every change can be undone, and refusals are shown.

import { announce, byId, passFocus, warn } from "./dom.js";
import { inPageNames } from "./format.js";
import { change, enable, GROUPS, pause, reset, sendSetpoint, setState } from "./runtime.js";
import { DEFAULTS, Undo, presentSettings } from "./settings.js";
import { known, settingsKnown, state, tell, unknown, watch } from "./store.js";

const undo = new Undo();
let applying = false;

/** Call this before every change by the page. */
export function remember() {
  if (applying) return;
  undo.remember(presentSettings(state), performance.now());
}

function showUndo() {
  const leadsBack = state.connection === "open" && undo.leadsBackFrom(presentSettings(state));
  if (!leadsBack) passFocus(byId("undo"));
  byId("undo").disabled = !leadsBack;
}

export function startActions() {
  byId("undo").addEventListener("click", takeBack);
  byId("defaults").addEventListener("click", async () => {
    const links = await known(settingsKnown);
    if (links === null) return warn(unknown().status);
    remember();
    report(await apply(DEFAULTS[links]), "All settings are the defaults again.");
  });
  watch("links", () => {
    undo.past.length = 0;
    showUndo();
  });
  watch(["connection", ...GROUPS, "enabled", "setpoint"], showUndo);
}

/** Announces the refusals, or that there are none. @param {string} refused @param {string} done */
function report(refused, done) {
  if (refused) warn(refused);
  else announce(done);
}

export async function takeBack() {
  // Before its answer the last change is not seen in the settings.
  await known(settingsKnown);
  await known(() => state.changing === 0 || null);
  if (!undo.leadsBackFrom(presentSettings(state))) return announce("There is nothing to undo.");
  const settings = undo.take(presentSettings(state));
  showUndo();
  if (!settings) return;
  report(await apply(settings), "Undone.");
}

const LATE = ["friction", "motors", "sensors"]; // settings that an older server does not have

/**
 * Applies the given settings, and returns the text of all refusals. The controller is last, so it never acts with half of the settings.
 * @param {Partial<import("./settings.js").Settings>} settings
 */
export async function apply({ controller, setpoint, start, ...groups }) {
  await known(settingsKnown);
  applying = true;
  tell("anew");
  const answers = [];
  if (controller === false) answers.push(await enable(false));
  for (const group of GROUPS) {
    if (groups[group] && (state[group] || !LATE.includes(group))) answers.push(await change(group, groups[group]));
  }
  if (setpoint) answers.push(setSetpoint(setpoint));
  if (start) answers.push(await setState(start.position ?? new Array(state.links).fill(0), start.velocity));
  if (controller != null && controller !== false) answers.push(await enable(controller));
  applying = false;
  return textOf(answers);
}

/** Sends the setpoint if the runtime will accept it. A refusal has the words of the services. @param {number[]} setpoint */
function setSetpoint(setpoint) {
  const wrong = setpoint.findIndex((angle) => !Number.isFinite(angle));
  const status = setpoint.length !== state.links ? `setpoint must have ${state.links} entries, got ${setpoint.length}` : wrong >= 0
    ? `setpoint[${wrong}] must be a number` : "";
  return status ? { result: false, status } : sendSetpoint(setpoint);
}

/** The refusals among these answers, with the page's names. @param {{ result: boolean, status?: string }[]} answers */
function textOf(answers) {
  return inPageNames([...new Set(answers.filter((answer) => !answer.result).map((answer) => answer.status))].join("; "));
}

/**
 * Sets all settings, from the starting pose, then running or paused. Returns the text of all refusals. @param
 * {import("./settings.js").Settings} settings @param {boolean} paused
 */
export async function setScene({ controller, setpoint, ...rest }, paused) {
  await enable(false);
  const early = await apply(rest);
  const answer = await reset();
  // A reset changes the setpoint to the starting pose, so the setpoint is sent after it.
  const late = await apply({ controller, setpoint });
  if (state.paused !== paused) await pause(paused);
  return [...new Set([early, late, textOf([answer])])].filter(Boolean).join("; ");
}

/** Back to the starting pose. */
export async function resetArm() {
  const answer = await reset();
  if (answer.result) announce("Reset: the arm is in its starting pose.");
  return answer;
}

/** Recovers from a divergence in one click: a smaller timestep, then a reset. Everything else stays, including the setpoint. */
export async function recover(timestep) {
  const set = await change("integrator", { timestep });
  return set.result ? beginAnew() : set;
}

/** Restarts from the starting pose with the present settings, including the setpoint. */
export async function beginAnew() {
  const setpoint = state.setpointKnown ? Array.from(state.setpoint.subarray(0, state.links)) : null;
  const answer = await reset();
  if (answer.result && setpoint) sendSetpoint(setpoint);
  return answer;
}
