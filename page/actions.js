// Actions on all settings at once: the page applies them, undoes the last change, goes back to the defaults, sets a scene;
// and the reset that belongs to it.
// Invariant: every change can be undone, and what the runtime refused is said.

import { announce, byId } from "./dom.js";
import { enable, pause, reset, sendSetpoint, setGains, setIntegrator, setParams, setPeriod, setState } from "./runtime.js";
import { DEFAULTS, Undo, presentSettings } from "./settings.js";
import { state, tell, watch } from "./store.js";

const undo = new Undo();
let applying = false;

/** Before any change that the page makes. */
export function remember() {
  if (applying) return;
  undo.remember(presentSettings(state), performance.now());
}

function showUndo() {
  byId("undo").disabled = !undo.leadsBackFrom(presentSettings(state));
}

export function startActions() {
  byId("undo").addEventListener("click", takeBack);
  byId("defaults").addEventListener("click", async () => {
    remember();
    await apply(DEFAULTS[state.links]);
    announce("All settings are the defaults again.");
  });
  watch("links", () => {
    undo.past.length = 0;
    showUndo();
  });
  watch(["integrator", "params", "gains", "period", "enabled", "setpoint"], showUndo);
}

export async function takeBack() {
  const settings = undo.take(presentSettings(state));
  showUndo();
  if (!settings) return;
  await apply(settings);
  announce("Undone.");
}

/** Applies what is given, and gives the refusals. The controller comes last, so that it never acts on half of the settings. */
export async function apply(/** @type {import("./settings.js").Settings} */ { integrator, params, gains, period, controller, setpoint, start }) {
  applying = true;
  tell("anew");
  const answers = [];
  if (controller === false) answers.push(await enable(false));
  if (params) answers.push(await setParams(params));
  if (gains) answers.push(await setGains(gains));
  if (integrator) answers.push(await setIntegrator(integrator));
  if (period) answers.push(await setPeriod(period));
  if (setpoint) sendSetpoint(setpoint);
  if (start) answers.push(await setState(start.position ?? new Array(state.links).fill(0), start.velocity));
  if (controller) answers.push(await enable(true));
  applying = false;
  return answers.filter((answer) => !answer.result).map((answer) => answer.status);
}

/** Sets all of the settings, from the starting pose, then running or paused; gives the refusals. @param {import("./settings.js").Settings} settings @param {boolean} paused */
export async function setScene({ controller, setpoint, ...rest }, paused) {
  await enable(false);
  const refusals = await apply({ ...rest, controller: null, setpoint: null });
  const answer = await reset();
  // A reset takes the setpoint to the starting pose, so it is sent after it.
  refusals.push(...await apply({ integrator: null, params: null, gains: null, period: null, controller, setpoint }));
  if (state.paused !== paused) await pause(paused);
  return answer.result ? refusals : [...refusals, answer.status];
}

/** Back to the starting pose. */
export async function resetArm() {
  const answer = await reset();
  if (answer.result) announce("Reset: the arm is in its starting pose.");
  return answer;
}

/** The way out of a blow-up in one click: a smaller timestep, then the reset; everything else stays, the setpoint too. */
export async function recover(timestep) {
  const set = await setIntegrator({ timestep });
  return set.result ? beginAnew() : set;
}

/** From the starting pose with all settings as they are; the setpoint stays too. */
export async function beginAnew() {
  const setpoint = state.setpointKnown ? Array.from(state.setpoint.subarray(0, state.links)) : null;
  const answer = await reset();
  if (answer.result && setpoint) sendSetpoint(setpoint);
  return answer;
}
