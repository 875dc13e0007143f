// The panel Realism: what a real arm has and the ideal one has not, each with a switch. A text says which number of a data sheet it is.
// Invariant: a switch shows what the runtime has. The panel is hidden while the runtime has none of it.

import { byId, el, setText } from "./dom.js";
import { refusal } from "./field.js";
import { gravityLoad } from "./mechanics.js";
import { setFriction, setMotors } from "./runtime.js";
import { state, watch } from "./store.js";

/** A first limit is this multiple of the weight of the stretched arm, so it holds the arm and saturates in a move. */
const MARGIN = 1.5;
/** The first limit without a weight [N m]. */
const LEAST = 5;
const CURES = { clamp: "bound of 50 rad s", none: "none", conditional: "conditional integration", back_calculation: "back-calculation" };

/** The first friction [N m s/rad]. */
const SOME = 1;

/** @param {string} id @param {string} name @param {() => void} onclick */
function switchOf(id, name, onclick) {
  return el("button", { type: "button", class: "switch", id, role: "switch", onclick },
    el("span", { class: "knob", "aria-hidden": "true" }), el("span", {}, name));
}

export function startRealism() {
  const limited = switchOf("limit-switch", "Effort limit", () => said.report(switchLimit()));
  const rubbed = switchOf("friction-switch", "Friction", () => said.report(switchFriction()));
  const cure = el("select", { onchange: () => said.report(setMotors({ anti_windup: cure.value })) },
    ...Object.entries(CURES).map(([value, text]) => el("option", { value }, text)));
  const said = refusal(limited, rubbed, cure);
  byId("realism-switches").append(limited, rubbed);
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
  watch(["friction", "links"], () => {
    const { friction } = state;
    rubbed.hidden = byId("friction-text").hidden = friction === null;
    if (!friction) return;
    const isOn = friction.viscous.some((one) => one > 0);
    rubbed.setAttribute("aria-checked", String(isOn));
    byId("friction-fields").hidden = !isOn;
    setText(byId("friction-text"), isOn
      ? "The viscous friction in the data sheet of a gear: a torque against the speed, in proportion to it. It takes energy, and limits include it."
      : "Off: the joints have no friction.");
  });
}

let before = /** @type {number[] | null} */ (null); // the limits at the last switching off

function switchLimit() {
  const { motors, links } = state;
  if (motors?.effort) before = motors.effort;
  return setMotors({ effort: motors?.effort ? null : before?.length === links ? before : firstLimits() });
}

function switchFriction() {
  const isOn = state.friction?.viscous.some((/** @type {number} */ one) => one > 0);
  return setFriction({ viscous: new Array(state.links).fill(isOn ? 0 : SOME) });
}

/** @returns {number[]} [N m] */
function firstLimits() {
  const load = new Float64Array(state.links);
  if (state.params) gravityLoad(state.links, load.slice(), state.params, load);
  return Array.from(load, (one) => Math.max(LEAST, Math.ceil(MARGIN * one)));
}
