// The settings: integrator and timestep, controller and gains, gravity, masses, lengths and setpoint.
// Invariant: a control shows only values that the runtime accepted. A refusal is shown beside it.

import { byId, el, setText, warn } from "./dom.js";
import { busy, numberField, refusal } from "./field.js";
import { METHODS, seconds, shortName } from "./format.js";
import { limitLabel } from "./stability_panel.js";
import { controlPeriodLimit, limitInForce, periodText } from "./policy.js";
import { questionOf } from "./question.js";
import { enable, sendSetpoint, setFriction, setGains, setIntegrator, setMotors, setParams, setPeriod, suggestGains } from "./runtime.js";
import { LOOP, set, state, watch } from "./store.js";

const PLACES = [["Earth", 9.81], ["Moon", 1.62], ["Mars", 3.72], ["Jupiter", 24.79], ["none", 0]];
/** The same range for both clocks, so their sliders can be compared [ms]. */
const CLOCK = { unit: "ms", low: 0.01, high: 200, log: true };

const ECHO_MS = 300;

let placed = []; // the last sent setpoint
let placedAt = -Infinity;
let perJoint = []; // functions that write the stored values to the fields of each joint
let controllerSaid;
let suggestButton;
let suggestSaid;

export function startControls() {
  startIntegrator();
  startClocks();
  startGravity();
  startController();
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
  const check = () => { for (const radio of radios("method")) radio.checked = radio.value === state.integrator?.method; };
  const said = refusal(byId("methods"));
  byId("methods").append(...METHODS.map(([method, name], i) => el("label", { class: "segment", title: `${name} (key ${i + 1}), and its limit of the timestep` },
    el("input", { type: "radio", name: "method", value: method, onchange: () => said.report(setIntegrator({ method })).then(check) }),
    el("span", {}, `${shortName(method)} `, limitLabel(method)))));
  byId("methods").after(said.element);
  watch("integrator", check);
}

/** The timestep and the control period, each with its limit. */
function startClocks() {
  const timestep = numberField({ label: "timestep", ...CLOCK, commit: (ms) => setIntegrator({ timestep: seconds(ms) }) });
  const period = numberField({ label: "control period", ...CLOCK, zero: true, zeroText: "every step", commit: (ms) => setPeriod({ period: seconds(ms) }) });
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
  const gravity = numberField({ label: "gravity", unit: "m/s²", low: 0, high: 30, commit: (value) => setParams({ gravity: value }) });
  byId("gravity-field").append(gravity.element);
  byId("gravity-places").append(...PLACES.map(([name, value]) => el("button",
    { type: "button", class: "small", onclick: () => gravity.report(setParams({ gravity: value })) }, name)));
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
    const question = questionOf({ ...state, setpointKnown: true }); // gains do not depend on it
    if (!question) return;
    const { result, values } = await suggestSaid.report(suggestGains(question));
    const { kp, ki, kd } = values.gains ?? values;
    if (result) suggestSaid.report(setGains({ kp, ki, kd }));
  });
}

/** Moves the setpoint of the chosen joint by `angle` [rad], from the present pose if no setpoint is known. */
export function nudgeSetpoint(angle) {
  if (state.links === 0) return;
  const present = presentSetpoint();
  const answer = place(present.with(state.joint, Number((present[state.joint] + angle).toFixed(6))));
  if (!answer.result) warn(answer.status);
}

/** The setpoint, or the one just sent, because a held key repeats faster than the runtime answers. */
function presentSetpoint() {
  if (performance.now() - placedAt < ECHO_MS && placed.length === state.links) return placed;
  return Array.from((state.setpointKnown ? state.setpoint : state.position).subarray(0, state.links));
}

/** There is no answer to a trajectory. It arrives on its topic when it takes effect. */
function place(positions) {
  if (state.connection !== "open") return { result: false, status: "not connected", values: {} };
  placed = positions;
  placedAt = performance.now();
  sendSetpoint(positions);
  return { result: true, status: "", values: {} };
}

export function chooseJoint(joint) {
  if (state.links > 0) set("joint", (joint + state.links) % state.links);
}

// Fields with one entry per joint

function makeJointFields(links) {
  perJoint = [];
  const of = (group, key, send) => ({ stored: () => state[group]?.[key], send: (values) => send({ [key]: values }) });
  const gain = (key, unit, high, name) => fill(`${key}-fields`, links,
    { unit, low: high / 1e4, high, log: true, zero: true, name, ...of("gains", key, setGains) });
  fill("masses-fields", links, { unit: "kg", low: 0.05, high: 20, log: true, name: "mass", ...of("params", "masses", setParams) });
  fill("lengths-fields", links, { unit: "m", low: 0.1, high: 3, log: true, name: "length", ...of("params", "lengths", setParams) });
  gain("kp", "N m/rad", 20000, "proportional gain");
  gain("ki", "N m/(rad s)", 50000, "integral gain");
  gain("kd", "N m s/rad", 1000, "derivative gain");
  fill("friction-fields", links, {
    unit: "N m s/rad", low: 0.01, high: 100, log: true, zero: true, name: "friction", stored: () => state.friction?.viscous,
    send: (viscous) => setFriction({ viscous }),
  });
  fill("limit-fields", links, {
    unit: "N m", low: 1, high: 1000, log: true, name: "effort limit", stored: () => state.motors?.effort ?? undefined, send: (effort) => setMotors({ effort }),
  });
  fill("setpoint-fields", links, { unit: "rad", low: -Math.PI, high: Math.PI, name: "setpoint",
    stored: () => (state.setpointKnown ? Array.from(state.setpoint.subarray(0, links)) : undefined), values: presentSetpoint,
    send: async (positions) => place(positions),
  });
  byId("joint-choice").replaceChildren(...Array.from({ length: links },
    (_, joint) => el("label", { class: `segment joint${joint + 1}`, title: `Joint ${joint + 1} (key j for the next)` },
    el("input", { type: "radio", name: "joint", onchange: () => chooseJoint(joint) }), el("span", {}, `${joint + 1}`))));
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
    label: `${name} ${joint + 1}`, short: String(joint + 1), className: `joint${joint + 1}`, ...options, commit: (value) => send(values().with(joint, value)),
  }));
  byId(id).replaceChildren(...fields.map((one) => one.element));
  perJoint.push(() => { if (stored()?.length === links) fields.forEach((one, joint) => one.accept(stored()[joint])); });
}
