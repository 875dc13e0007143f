// The panel Realism: what a real arm has and the ideal one has not, each with a switch. A text says which number of a data sheet it is.
// Invariant: a switch shows what the runtime has. The panel is hidden while the runtime has none of it.

import { byId, el } from "./dom.js";
import { refusal } from "./field.js";
import { gravityLoad } from "./mechanics.js";
import { setFriction, setMotors, setSensors } from "./runtime.js";
import { state, watch } from "./store.js";

/** A first limit is this multiple of the weight of the stretched arm, so it holds the arm and saturates in a move. */
const MARGIN = 1.5;
/** The first limit without a weight [N m]. */
const LEAST = 5;
const CURES = { clamp: "bound of 50 rad s", none: "none", conditional: "conditional integration", back_calculation: "back-calculation" };

/** The bits of encoders on offer: counts of a turn are a power of two. The first one is that of a cheap magnetic encoder. */
const BITS = [12, 10, 11, 14, 16, 18, 20];
const EXACT = "exact";

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
  const sensing = switchOf("sensors-switch", "Sensors", () => said.report(switchSensors()));
  const bits = chosen([[EXACT, EXACT], ...BITS.toSorted((one, other) => one - other).map((one) => [String(one), `${one} bits`])],
    (value) => setSensors({ encoder_step: steps(value === EXACT ? 0 : stepOf(Number(value))) }));
  const speed = chosen([["exact", "exact"], ["difference", "difference"]], (velocity) => setSensors({ velocity }));
  const delay = chosen(Array.from({ length: 17 }, (_, periods) => [String(periods), String(periods)]), (value) => setSensors({ delay: Number(value) }));
  const said = refusal(limited, rubbed, sensing, cure, bits, speed, delay);
  byId("realism-switches").append(limited, rubbed, sensing);
  for (const [name, one] of /** @type {[string, HTMLElement][]} */ ([["encoder", bits], ["velocity", speed], ["delay [periods]", delay]])) {
    byId("sensors-options").append(el("label", { class: "option" }, el("span", {}, name), one));
  }
  /** A list that sends the chosen value. @param {string[][]} options @param {(value: string) => any} send @returns {HTMLSelectElement} */
  function chosen(options, send) {
    const list = el("select", { onchange: () => said.report(send(list.value)) }, ...options.map(([value, text]) => el("option", { value }, text)));
    return list;
  }
  byId("limit-options").append(el("label", { class: "option" }, el("span", {}, "anti-windup"), cure), said.element);
  watch(["motors", "links"], () => {
    const { motors } = state;
    byId("realism").hidden = motors === null;
    if (!motors) return;
    const isOn = motors.effort !== null;
    limited.setAttribute("aria-checked", String(isOn));
    byId("limit-options").hidden = byId("limit-fields").hidden = byId("limit-text").hidden = !isOn;
    cure.value = motors.anti_windup;
  });
  watch(["friction", "links"], () => {
    const { friction } = state;
    rubbed.hidden = friction === null;
    if (!friction) return;
    const isOn = friction.viscous.some((one) => one > 0);
    rubbed.setAttribute("aria-checked", String(isOn));
    byId("friction-fields").hidden = byId("friction-text").hidden = !isOn;
  });
  watch(["sensors", "links"], () => {
    const { sensors } = state;
    sensing.hidden = sensors === null;
    byId("sensors-options").hidden = byId("sensors-text").hidden = !sensors || !isReal(sensors);
    if (!sensors) return;
    sensing.setAttribute("aria-checked", String(isReal(sensors)));
    const shown = BITS.find((one) => Math.abs(stepOf(one) - sensors.encoder_step[0]) < 1e-12);
    bits.value = sensors.encoder_step[0] === 0 ? EXACT : String(shown ?? "");
    speed.value = sensors.velocity;
    delay.value = String(sensors.delay);
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

/** @param {import("./question.js").Sensors} sensors */
function isReal({ encoder_step, velocity, delay }) {
  return encoder_step.some((one) => one > 0) || velocity !== "exact" || delay > 0;
}

/** The step of an encoder with this number of bits [rad]. @param {number} bits */
function stepOf(bits) {
  return (2 * Math.PI) / 2 ** bits;
}

/** @param {number} step [rad] @returns {number[]} */
function steps(step) {
  return new Array(state.links).fill(step);
}

function switchSensors() {
  const isOn = state.sensors !== null && isReal(state.sensors);
  return setSensors(isOn ? { encoder_step: steps(0), velocity: "exact", delay: 0 } : { encoder_step: steps(stepOf(BITS[0])), velocity: "difference" });
}

/** @returns {number[]} [N m] */
function firstLimits() {
  const load = new Float64Array(state.links);
  if (state.params) gravityLoad(state.links, load.slice(), state.params, load);
  return Array.from(load, (one) => Math.max(LEAST, Math.ceil(MARGIN * one)));
}
