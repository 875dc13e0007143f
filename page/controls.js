// The settings: integrator and timestep, controller and gains, gravity, masses, lengths and setpoint.
// Invariant: a control shows only values that the runtime accepted. A refusal is shown beside it.

import { announce, byId, el, setText, warn } from "./dom.js";
import { busy, numberField, refusal } from "./field.js";
import { METHODS, seconds, shortName } from "./format.js";
import { limitLabel } from "./stability_panel.js";
import { controlPeriodLimit, limitInForce, periodText } from "./policy.js";
import { questionOf } from "./question.js";
import { change, enable, sendSetpoint, suggestGains } from "./runtime.js";
import { known, LOOP, set, settingsKnown, state, unknown, watch, whenKnown } from "./store.js";

const PLACES = [["Earth", 9.81], ["Moon", 1.62], ["Mars", 3.72], ["Jupiter", 24.79], ["none", 0]];
/** The same range for both clocks, so their sliders can be compared [ms]. */
const CLOCK = { unit: "ms", low: 0.01, high: 200, log: true };

const ECHO_MS = 300;

let placed = []; // the last sent setpoint
let placedAt = -Infinity;
let perJoint = []; // functions that write the stored values to the fields of each joint
let methodsSaid;
let controllerSaid;
let setpointSaid;
let suggestButton;
let suggestSaid;

export function startControls() {
  startIntegrator();
  startClocks();
  startGravity();
  startController();
  setpointSaid = refusal();
  byId("setpoint-fields").after(setpointSaid.element);
  suggestButton = el("button", { type: "button", class: "small", onclick: takeSuggestion }, "Suggest gains for this arm");
  suggestSaid = refusal(suggestButton);
  byId("suggest").append(suggestButton, suggestSaid.element);
  watch("links", makeJointFields);
  watch(["params", "gains", "friction", "motors", "setpoint"], showStored);
  watch("joint", (joint) => { for (const [i, radio] of radios("joint").entries()) radio.checked = i === joint; });
}

function showStored() {
  for (const take of perJoint) take();
}

function startIntegrator() {
  methodsSaid = refusal(byId("methods"));
  byId("methods").append(...METHODS.map(([method, name], i) => el("label", { class: "segment", title: `${name} (key ${i + 1}), and its limit of the timestep` },
    el("input", { type: "radio", name: "method", value: method, onchange: () => chooseMethod(method) }),
    el("span", {}, `${shortName(method)} `, limitLabel(method)))));
  byId("methods").after(methodsSaid.element);
  watch("integrator", checkMethod);
}

function checkMethod() {
  for (const radio of radios("method")) radio.checked = radio.value === state.integrator?.method;
}

export async function chooseMethod(method) {
  const answer = await methodsSaid.report(change("integrator", { method }));
  checkMethod();
  return answer;
}

function startClocks() {
  const timestep = numberField({ label: "timestep", ...CLOCK, commit: (ms) => change("integrator", { timestep: seconds(ms) }) });
  const period = numberField({ label: "control period", ...CLOCK, zero: true, zeroText: "every step",
    commit: (ms) => change("period", { period: seconds(ms) }) });
  byId("timestep-field").append(timestep.element);
  byId("period-field").append(period.element);
  watch("integrator", ({ timestep: accepted }) => timestep.accept(1e3 * accepted));
  watch("period", ({ period: accepted }) => period.accept(1e3 * accepted));
  watch(LOOP, () => {
    timestep.mark(1e3 * limitInForce(state).limit);
    period.mark(1e3 * controlPeriodLimit(state));
    setText(byId("period-text"), periodText(state));
  });
}

function startGravity() {
  const gravity = numberField({ label: "gravity", unit: "m/s²", low: 0, high: 30, commit: (value) => change("params", { gravity: value }) });
  byId("gravity-field").append(gravity.element);
  byId("gravity-places").append(...PLACES.map(([name, value]) => el("button",
    { type: "button", class: "small", onclick: () => gravity.report(change("params", { gravity: value })) }, name)));
  watch("params", (params) => gravity.accept(params.gravity));
}

function startController() {
  const button = byId("controller");
  controllerSaid = refusal(button);
  byId("transport").after(controllerSaid.element);
  button.addEventListener("click", () => switchController(!state.enabled));
  watch("enabled", (on) => {
    button.setAttribute("aria-checked", String(on));
    setText(byId("controller-text"), on ? "Controller on" : "Controller off");
    byId("gains-off").hidden = on;
    for (const key of ["kp", "ki", "kd"]) byId(`${key}-fields`).classList.toggle("off", !on);
  });
}

export function switchController(on) {
  return controllerSaid.report(enable(on));
}

/** Requests gains for the present arm and sets them. The change can be undone. */
export function takeSuggestion() {
  return busy(suggestButton, "Searching…", async () => {
    const asked = () => questionOf({ ...state, setpointKnown: true }); // gains do not depend on it
    const { result, values } = await suggestSaid.report(whenKnown(asked, suggestGains));
    const { kp, ki, kd } = values.gains ?? values;
    if (result) suggestSaid.report(change("gains", { kp, ki, kd }));
  });
}

/** Moves the setpoint of the chosen joint by `angle` [rad]. */
export function nudgeSetpoint(angle) {
  setpointSaid.report(whenKnown(presentSetpoint, (present) => place(present.with(state.joint, Number((present[state.joint] + angle).toFixed(6))))));
}

/** The setpoint, or the one just sent, because a held key repeats faster than the runtime answers; null if it is not known. */
function presentSetpoint() {
  if (performance.now() - placedAt < ECHO_MS && placed.length === state.links) return placed;
  return state.setpointKnown ? Array.from(state.setpoint.subarray(0, state.links)) : null;
}

/** There is no answer to a trajectory. It arrives on its topic when it takes effect. */
function place(positions) {
  placed = positions;
  placedAt = performance.now();
  return sendSetpoint(positions);
}

/** Chooses the joint after the present one, of which there may be none yet. */
export async function nextJoint() {
  const links = await known(settingsKnown);
  if (links === null) return warn(unknown().status);
  set("joint", (state.joint + 1) % links);
  announce(`Joint ${state.joint + 1}.`);
}

// Fields with one entry per joint

/** Their place, their setting, their name and unit, the ends of their sliders, and whether the left end means 0. */
const JOINT_FIELDS = /** @type {const} */ ([
  ["masses-fields", "params", "masses", "mass", "kg", 0.05, 20, false],
  ["lengths-fields", "params", "lengths", "length", "m", 0.1, 3, false],
  ["kp-fields", "gains", "kp", "proportional gain", "N m/rad", 2, 20000, true],
  ["ki-fields", "gains", "ki", "integral gain", "N m/(rad s)", 5, 50000, true],
  ["kd-fields", "gains", "kd", "derivative gain", "N m s/rad", 0.1, 1000, true],
  ["friction-fields", "friction", "viscous", "friction", "N m s/rad", 0.01, 100, true],
  ["limit-fields", "motors", "effort", "effort limit", "N m", 1, 1000, false],
]);

function makeJointFields(links) {
  perJoint = [];
  for (const [id, group, key, name, unit, low, high, zero] of JOINT_FIELDS) {
    fill(id, links, { name, unit, low, high, zero, log: true, stored: () => state[group]?.[key], send: (values) => change(group, { [key]: values }) });
  }
  fill("setpoint-fields", links, { unit: "rad", low: -Math.PI, high: Math.PI, name: "setpoint",
    stored: () => (state.setpointKnown ? Array.from(state.setpoint.subarray(0, links)) : undefined), values: presentSetpoint, send: place,
  });
  byId("joint-choice").replaceChildren(...Array.from({ length: links },
    (_, joint) => el("label", { class: `segment joint${joint + 1}`, title: `Joint ${joint + 1} (key j for the next)` },
    el("input", { type: "radio", name: "joint", onchange: () => set("joint", joint) }), el("span", {}, `${joint + 1}`))));
  set("joint", state.joint < links ? state.joint : 0);
  showStored();
}

/** @param {string} name @returns {HTMLInputElement[]} */
function radios(name) {
  return /** @type {any} */ ([...document.getElementsByName(name)]);
}

/** One field per joint of the `stored` array. A change sends all `values`, which may be newer. */
function fill(id, links, /** @type {any} */ { name, stored, values = stored, send, ...options }) {
  const fields = Array.from({ length: links }, (_, joint) => numberField({
    label: `${name} ${joint + 1}`, short: String(joint + 1), className: `joint${joint + 1}`, ...options,
    commit: (value) => whenKnown(values, (present) => send(present.with(joint, value))),
  }));
  byId(id).replaceChildren(...fields.map((one) => one.element));
  perJoint.push(() => { if (stored()?.length === links) fields.forEach((one, joint) => one.accept(stored()[joint])); });
}
