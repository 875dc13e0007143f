// @ts-check
// The largest stable timestep of each method on its button, and in the Stability panel why it is that.
// Invariant: a button has the limit that the verdict would have with its method; while an answer is on its way there is none.

import { byId, el, setText } from "./dom.js";
import { METHODS } from "./format.js";
import { loopInForce } from "./growth.js";
import { limitText, question, smallest } from "./policy.js";
import { stabilityOf } from "./runtime.js";
import { state, watch } from "./store.js";
import { openTab } from "./tabs.js";
import { whyText } from "./why.js";

/** A setpoint that is dragged changes many times a second; limits are asked for once it rests [ms]. */
const REST_MS = 200;

/** @type {Map<string, HTMLElement>} */
const labels = new Map();
/** The study's answer for each method. @type {Record<string, any>} */
let answers = {};
let key = "";
let timer = 0;

export function startLimits() {
  for (const cause of ["integrator", "gains", "params", "setpoint", "enabled", "stability", "links", "period"]) watch(cause, look);
  watch("diagnostics", show);
  byId("why").addEventListener("click", () => {
    openTab("stability");
    byId("why-text").scrollIntoView({ block: "nearest" });
  });
}

/** Where the limit of `method` is shown. @param {string} method */
export function limitLabel(method) {
  const label = el("small", { class: "bears" }, "…");
  labels.set(method, label);
  return label;
}

function look() {
  // The answer for the method in force comes anew when the motion has changed: the others are asked for again then.
  const { integrator: _, ...asked } = question(state) ?? {};
  const now = state.stability ? JSON.stringify([asked, state.stability.timestep_limit_motion]) : "";
  if (now !== key) {
    key = now;
    clearTimeout(timer);
    if (now === "") answers = {};
    else timer = setTimeout(ask, REST_MS);
  }
  show();
}

async function ask() {
  const mine = key;
  /** @type {Record<string, any>} */
  const found = {};
  for (const [method] of METHODS) {
    found[method] = await stabilityOf(method);
    if (mine !== key) return;
  }
  answers = found;
  show();
}

function show() {
  /** @param {string} method */
  const of = (method) => (state.stability && method === state.integrator?.method ? state.stability : answers[method]);
  for (const [method, label] of labels) {
    const answer = of(method);
    setText(label, limitText(answer ? smallest(state, answer).limit : NaN));
  }
  const known = METHODS.every(([method]) => of(method));
  const held = Object.fromEntries(METHODS.map(([method]) => [method, known ? smallest(state, of(method)).held : NaN]));
  const why = known ? whyText(state, held) : "";
  setText(byId("why-text"), why);
  // It stays while limits are asked for anew, so that a click on its way meets it.
  if (known || !loopInForce(state)) byId("why").hidden = why === "";
}
