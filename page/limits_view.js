// @ts-check
// The largest stable timestep of each method on its button, and in the Stability panel why it is that.
// Invariant: all limits are the study's answers to the question about the loop in force; a stale one is never shown.

import { byId, el, setText } from "./dom.js";
import { METHODS } from "./format.js";
import { answerInForce, limitText, limitsOf, question } from "./policy.js";
import { stability } from "./runtime.js";
import { state, watch } from "./store.js";
import { openTab } from "./tabs.js";
import { whyText } from "./why.js";

/** @type {Map<string, HTMLElement>} */
const labels = new Map();
/** Answers by method. @type {Record<string, any>} */
let answers = {};
let loop = ""; // the question that they answer, without its method
let busy = false;
let again = false;

export function startLimits() {
  for (const cause of ["integrator", "gains", "params", "setpoint", "enabled", "stability", "links", "period", "diagnostics"]) watch(cause, look);
  byId("why").addEventListener("click", () => {
    openTab("stability");
    byId("why-text").scrollIntoView({ block: "nearest" });
  });
}

/** Where the limit of `method` is shown. @param {string} method */
export function limitLabel(method) {
  const label = el("small", { class: "limit" }, "…");
  labels.set(method, label);
  return label;
}

/** The limits that are known, by method [s]. @returns {Record<string, number>} */
export function methodLimits() {
  return limitsOf(state, answers);
}

function look() {
  const asked = question(state);
  const now = asked ? JSON.stringify({ ...asked, integrator: "" }) : "";
  if (now !== loop) {
    loop = now;
    answers = {};
  }
  const own = answerInForce(state);
  const method = state.integrator?.method;
  if (own && answers[method] !== own) {
    answers[method] = own;
    again = true;
    askOthers();
  }
  show();
}

/** Asks about the other methods, one at a time, each time the study has answered about the present one. */
async function askOthers() {
  if (busy) return;
  busy = true;
  while (again) {
    again = false;
    const mine = loop;
    for (const [method] of METHODS) {
      if (method === state.integrator?.method || again || mine !== loop) continue;
      const answer = await stability({ ...JSON.parse(mine), integrator: method });
      if (mine !== loop || !answer.result) continue;
      answers[method] = answer.values;
      show();
    }
  }
  busy = false;
}

function show() {
  const limits = methodLimits();
  for (const [method, label] of labels) setText(label, limitText(limits[method] ?? NaN));
  const known = METHODS.every(([method]) => method in limits);
  const held = Object.fromEntries(Object.entries(answers).map(([method, one]) => [method, one.timestep_limit_held ?? Infinity]));
  const why = known ? whyText(state, answerInForce(state), held) : "";
  setText(byId("why-text"), why);
  // It stays while limits are computed anew, so that a click on its way meets it.
  if (known || !question(state)) byId("why").hidden = why === "";
}
