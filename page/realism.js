// The panel Realism: what a real arm has and the ideal one has not, each with a switch. A text says which number of a data sheet it is.
// Invariant: a switch shows what the runtime has. The panel is hidden while the runtime has none of it.

import { byId, el, setText } from "./dom.js";
import { refusal } from "./field.js";
import { gravityLoad } from "./mechanics.js";
import { setMotors } from "./runtime.js";
import { state, watch } from "./store.js";

/** A first limit is this multiple of the weight of the stretched arm, so it holds the arm and saturates in a move. */
const MARGIN = 1.5;
/** The first limit without a weight [N m]. */
const LEAST = 5;
const CURES = { clamp: "bound of 50 rad s", none: "none", conditional: "conditional integration", back_calculation: "back-calculation" };

export function startRealism() {
  const limited = el("button", { type: "button", class: "switch", id: "limit-switch", role: "switch", onclick: () => said.report(switchLimit()) },
    el("span", { class: "knob", "aria-hidden": "true" }), el("span", {}, "Effort limit"));
  const cure = el("select", { onchange: () => said.report(setMotors({ anti_windup: cure.value })) },
    ...Object.entries(CURES).map(([value, text]) => el("option", { value }, text)));
  const said = refusal(limited, cure);
  byId("realism-switches").append(limited);
  byId("limit-options").append(el("label", { class: "option" }, el("span", {}, "anti-windup"), cure), said.element);
  watch(["motors", "links"], () => {
    const { motors } = state;
    byId("realism").hidden = motors === null;
    if (!motors) return;
    const isOn = motors.effort !== null;
    limited.setAttribute("aria-checked", String(isOn));
    byId("limit-options").hidden = byId("limit-fields").hidden = !isOn;
    cure.value = motors.anti_windup;
    setText(byId("limit-text"), isOn
      ? "The peak torque in the data sheet of a motor with its gear. Stability limits hold while no torque is at its limit."
      : "Off: the motors give any torque.");
  });
}

let before = /** @type {number[] | null} */ (null); // the limits at the last switching off

function switchLimit() {
  const { motors, links } = state;
  if (motors?.effort) before = motors.effort;
  return setMotors({ effort: motors?.effort ? null : before?.length === links ? before : firstLimits() });
}

/** @returns {number[]} [N m] */
function firstLimits() {
  const load = new Float64Array(state.links);
  if (state.params) gravityLoad(state.links, load.slice(), state.params, load);
  return Array.from(load, (one) => Math.max(LEAST, Math.ceil(MARGIN * one)));
}
