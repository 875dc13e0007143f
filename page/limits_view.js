// @ts-check
// The largest stable timestep of each method on its button, and in the Stability panel why it is that.
// Invariant: nothing stale is shown: while limits are computed, one in each frame, there is none.

import { byId, el, setText } from "./dom.js";
import { METHODS } from "./format.js";
import { onFrame, wake } from "./frames.js";
import { loopInForce } from "./growth.js";
import { limitOf } from "./loop.js";
import { limitText } from "./policy.js";
import { state, watch } from "./store.js";
import { openTab } from "./tabs.js";
import { limitsKey, whyText } from "./why.js";

/** A setpoint that is dragged changes many times a second; limits are computed once it rests [ms]. */
const REST_MS = 200;

/** @type {Map<string, HTMLElement>} */
const labels = new Map();
/** @type {Record<string, number>} */
let limits = {};
let key = "";
let timer = 0;
let computes = false;

export function startLimits() {
  for (const cause of ["integrator", "gains", "params", "setpoint", "enabled", "stability", "links"]) watch(cause, look);
  byId("why").addEventListener("click", () => {
    openTab("stability");
    byId("why-text").scrollIntoView({ block: "nearest" });
  });
  onFrame(compute);
}

/** Where the limit of `method` is shown. @param {string} method */
export function limitLabel(method) {
  const label = el("small", { class: "bears" }, "…");
  labels.set(method, label);
  return label;
}

function look() {
  const now = limitsKey(state);
  if (now !== key) {
    key = now;
    limits = {};
    computes = false;
    clearTimeout(timer);
    timer = setTimeout(() => { computes = true; wake(); }, REST_MS);
  }
  show();
}

/** One method in a frame: a limit takes some milliseconds. Gives whether more are to come. */
function compute() {
  if (!computes) return false;
  const found = loopInForce(state);
  const next = METHODS.find(([method]) => !(method in limits));
  if (!found || !next) {
    computes = false;
    return false;
  }
  limits[next[0]] = limitOf(found.loop, next[0], true);
  show();
  return true;
}

function show() {
  for (const [method, label] of labels) setText(label, limitText(limits[method] ?? NaN));
  const known = METHODS.every(([method]) => method in limits);
  const why = known ? whyText(state, limits) : "";
  setText(byId("why-text"), why);
  // It stays while limits are computed anew, so that a click on its way meets it.
  if (known || !loopInForce(state)) byId("why").hidden = why === "";
}
