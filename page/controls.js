// @ts-check
// The settings: integrator and timestep, controller and gains, gravity, masses, lengths, setpoint and pushes.
// Invariant: a control changes only to values that the runtime accepted. A refusal is shown beside it.

import { warn } from "./announce.js";
import { byId, el, setText } from "./dom.js";
import { numberField, option, refusal } from "./field.js";
import { METHODS, shortName } from "./format.js";
import { limitLabel } from "./limits_view.js";
import { controlPeriodLimit, limitInForce, periodText } from "./policy.js";
import { disturb, enable, sendSetpoint, setGains, setIntegrator, setParams, setPeriod, suggestGains } from "./runtime.js";
import { set, state, watch } from "./store.js";

const PLACES = [["Earth", 9.81], ["Moon", 1.62], ["Mars", 3.72], ["Jupiter", 24.79], ["none", 0]];
const PUSH_EFFORT = 50; // N m, as on the classic page
const PUSH_SECONDS = 0.1;

/** The same for both clocks, so that places on their sliders compare [ms]. */
const CLOCK = { unit: "ms", low: 0.01, high: 200, log: true };

const SUGGEST = "Suggest gains for this arm";
const ECHO_MS = 300;

let placed = []; // the setpoint that was sent last
let placedAt = -Infinity;
let perJoint = []; // functions that take the stored values into the fields of each joint
let pushEffort;
let pushSeconds;
let pushSaid;
let servoSaid;
let suggestButton;
let suggestSaid;

export function startControls() {
  startIntegrator();
  startClocks();
  startGravity();
  startServo();
  startPush();
  startSuggestion();
  watch("links", makeJointFields);
  for (const key of ["params", "gains", "setpoint"]) watch(key, showStored);
}

function showStored() {
  for (const take of perJoint) take();
}

function startIntegrator() {
  const said = refusal(byId("methods"));
  byId("methods").append(...METHODS.map(([method, name], i) => {
    const radio = el("input", { type: "radio", name: "method", value: method, onchange: async () => {
      const answer = await setIntegrator({ method });
      said.show(answer.result ? "" : answer.status);
      check();
    } });
    return el("label", { class: "segment", title: `${name} (key ${i + 1}), and its largest stable timestep` }, radio, el("span", {}, `${shortName(method)} `, limitLabel(method)));
  }));
  byId("methods").after(said.element);
  const check = () => {
    for (const radio of radios("method")) radio.checked = radio.value === state.integrator?.method;
  };
  watch("integrator", check);
}

/** The timestep and the control period, one above the other, each with its limit. */
function startClocks() {
  const timestep = numberField({ label: "timestep", ...CLOCK, commit: (ms) => setIntegrator({ timestep: seconds(ms) }) });
  const period = numberField({
    label: "control period", ...CLOCK, zero: true, zeroText: "every step", commit: (ms) => setPeriod({ period: seconds(ms) }),
  });
  byId("timestep-field").append(timestep.element);
  byId("period-field").append(period.element);
  watch("integrator", ({ timestep: accepted }) => timestep.accept(1e3 * accepted));
  watch("period", ({ period: accepted }) => period.accept(1e3 * accepted));
  const mark = () => {
    timestep.mark(1e3 * limitInForce(state).limit);
    period.mark(1e3 * controlPeriodLimit(state));
    setText(byId("period-text"), periodText(state));
  };
  const causes = ["links", "integrator", "gains", "params", "period", "enabled", "setpoint", "diagnostics", "stability", "stabilityMissing"];
  for (const key of causes) watch(key, mark);
}

/** Of milliseconds: the nearest number of seconds, without the digits that a division leaves behind. @param {number} ms */
function seconds(ms) {
  return Number((ms / 1e3).toPrecision(15));
}

function startGravity() {
  const gravity = numberField({
    label: "gravity", unit: "m/s²", low: 0, high: 30, commit: (value) => setParams({ gravity: value }),
  });
  byId("gravity-field").append(gravity.element);
  byId("gravity-places").append(...PLACES.map(([name, value]) => el("button", { type: "button", class: "small", onclick: async () => {
    const answer = await setParams({ gravity: value });
    gravity.refuse(answer.result ? "" : answer.status);
  } }, name)));
  watch("params", (params) => gravity.accept(params.gravity));
}

function startServo() {
  const button = byId("servo");
  servoSaid = refusal(button);
  byId("transport").after(servoSaid.element);
  button.addEventListener("click", () => switchServo(!state.enabled));
  watch("enabled", (on) => {
    button.setAttribute("aria-checked", String(on));
    setText(byId("servo-text"), on ? "Controller on" : "Controller off");
    byId("gains-off").hidden = on;
    for (const key of ["kp", "ki", "kd"]) byId(`${key}-fields`).classList.toggle("off", !on);
  });
}

export async function switchServo(on) {
  const answer = await enable(on);
  servoSaid.show(answer.result ? "" : answer.status);
}

/** Gains that the runtime finds for the present arm; hidden where it offers none. */
function startSuggestion() {
  suggestButton = el("button", { type: "button", class: "small", onclick: takeSuggestion }, SUGGEST);
  suggestSaid = refusal(suggestButton);
  byId("suggest").append(suggestButton, suggestSaid.element);
}

/** Asks for gains, and sets them: a change like any other, which can be undone. */
export async function takeSuggestion() {
  if (suggestButton.disabled) return;
  suggestButton.disabled = true;
  setText(suggestButton, "Searching…");
  const found = await suggestGains();
  suggestButton.disabled = false;
  setText(suggestButton, SUGGEST);
  const { kp, ki, kd } = found.values.gains ?? found.values;
  const answer = found.result ? await setGains({ kp, ki, kd }) : found;
  suggestSaid.show(answer.result ? "" : answer.status);
}

function startPush() {
  pushEffort = option({ label: "effort", unit: "N m", value: PUSH_EFFORT });
  pushSeconds = option({ label: "for", unit: "s", value: PUSH_SECONDS });
  const buttons = [el("button", { type: "button", onclick: () => push(1) }, "↺ Push"), el("button", { type: "button", onclick: () => push(-1) }, "↻ Push")];
  buttons[0].setAttribute("aria-label", "Push counter-clockwise");
  buttons[1].setAttribute("aria-label", "Push clockwise");
  pushSaid = refusal(...buttons);
  byId("push-body").append(
    el("div", { class: "options" }, pushEffort.element, pushSeconds.element),
    el("div", { class: "buttons" }, ...buttons), pushSaid.element,
  );
}

/** Pushes the chosen joint, counter-clockwise for 1, clockwise for -1. */
export async function push(sign) {
  if (state.links === 0) return;
  const effort = new Array(state.links).fill(0);
  effort[state.joint] = sign * (pushEffort.number() ?? PUSH_EFFORT);
  const answer = await disturb(effort, pushSeconds.number() ?? PUSH_SECONDS);
  pushSaid.show(answer.result ? "" : answer.status);
}

/** Moves the setpoint of the chosen joint by `angle` [rad]; from where the arm is, if none is known. */
export function nudgeSetpoint(angle) {
  if (state.links === 0) return;
  const positions = presentSetpoint();
  positions[state.joint] = Number((positions[state.joint] + angle).toFixed(6));
  const answer = place(positions);
  if (!answer.result) warn(answer.status);
}

/** The setpoint, or the one just sent: a held key is faster than the way to the runtime and back. */
function presentSetpoint() {
  if (performance.now() - placedAt < ECHO_MS && placed.length === state.links) return [...placed];
  return Array.from((state.setpointKnown ? state.setpoint : state.position).subarray(0, state.links));
}

function place(positions) {
  if (state.connection !== "open") return { result: false, status: "not connected" };
  placed = positions;
  placedAt = performance.now();
  sendSetpoint(positions);
  return { result: true, status: "" };
}

export function chooseJoint(joint) {
  if (state.links > 0) set("joint", (joint + state.links) % state.links);
}

// Fields that there are one of per joint

function makeJointFields(links) {
  perJoint = [];
  const masses = { key: "masses", unit: "kg", low: 0.05, high: 20, log: true, name: "mass" };
  const lengths = { key: "lengths", unit: "m", low: 0.1, high: 3, log: true, name: "length" };
  const gain = (key, unit, high, name) => ({ key, unit, low: high / 1e4, high, log: true, zero: true, name });
  fill("masses-fields", links, masses, "params", setParams);
  fill("lengths-fields", links, lengths, "params", setParams);
  fill("kp-fields", links, gain("kp", "N m/rad", 20000, "proportional gain"), "gains", setGains);
  fill("ki-fields", links, gain("ki", "N m/(rad s)", 50000, "integral gain"), "gains", setGains);
  fill("kd-fields", links, gain("kd", "N m s/rad", 1000, "derivative gain"), "gains", setGains);
  fillSetpoint(links);
  makeJointChoice(links);
  showStored();
}

/** @param {string} name @returns {HTMLInputElement[]} */
function radios(name) {
  return /** @type {any} */ ([...document.getElementsByName(name)]);
}

/** One field per joint of the array `key` in the stored `group`; a change sends the whole array. */
function fill(id, links, { key, unit, low, high, log, zero = false, name }, group, send) {
  const fields = Array.from({ length: links }, (_, joint) => numberField({
    label: `${name} ${joint + 1}`, short: String(joint + 1), unit, low, high, log, zero, className: `joint${joint + 1}`,
    commit: (value) => {
      const values = [...state[group][key]];
      values[joint] = value;
      return send({ [key]: values });
    },
  }));
  byId(id).replaceChildren(...fields.map((one) => one.element));
  perJoint.push(() => {
    const values = state[group]?.[key];
    if (values?.length === links) fields.forEach((one, joint) => one.accept(values[joint]));
  });
}

function fillSetpoint(links) {
  const fields = Array.from({ length: links }, (_, joint) => numberField({
    label: `setpoint ${joint + 1}`, short: String(joint + 1), unit: "rad", low: -Math.PI, high: Math.PI, className: `joint${joint + 1}`,
    // There is no answer to a trajectory: it comes back over its topic once it counts.
    commit: (value) => {
      const positions = presentSetpoint();
      positions[joint] = value;
      return Promise.resolve(place(positions));
    },
  }));
  byId("setpoint-fields").replaceChildren(...fields.map((one) => one.element));
  perJoint.push(() => { if (state.setpointKnown) fields.forEach((one, joint) => one.accept(state.setpoint[joint])); });
}

function makeJointChoice(links) {
  byId("joint-choice").replaceChildren(...Array.from({ length: links }, (_, joint) => {
    const radio = el("input", { type: "radio", name: "joint", onchange: () => chooseJoint(joint) });
    radio.checked = joint === state.joint;
    return el("label", { class: `segment joint${joint + 1}`, title: `Joint ${joint + 1} (key j for the next)` }, radio, el("span", {}, `${joint + 1}`));
  }));
  if (state.joint >= links) set("joint", 0);
}

watch("joint", (joint) => {
  const radio = radios("joint")[joint];
  if (radio) radio.checked = true;
});
