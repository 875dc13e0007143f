// Two integrators side by side: the same arm, from the same state, reckoned offline by the runtime, played back together.
// Invariant: what is compared is what the runtime answered; the live arm is not touched.

import { announce } from "./announce.js";
import { CompareView } from "./compare_view.js";
import { METHODS } from "./controls.js";
import { byId, el, setText } from "./dom.js";
import { option, refusal } from "./field.js";
import { duration, significant } from "./format.js";
import { methodName } from "./readouts.js";
import { commonSamples } from "./resample.js";
import { nobodyProvides } from "./rosbridge.js";
import { rollout } from "./runtime.js";
import { state, watch } from "./store.js";

let view;
let said;
let sides;
let seconds;
let from;
let servo;
let go;

export function startCompare() {
  sides = [side("first", "euler"), side("second", "rk4")];
  seconds = option({ label: "duration", unit: "s", value: 5 });
  from = select("start", [["now", "as it is"], ["rest", "stretched out"]]);
  servo = select("servo", [["off", "off"], ["on", "on"]]);
  go = el("button", { type: "submit", class: "primary" }, "Compare");
  said = refusal(go);
  byId("compare-form").append(el("div", { class: "compare-row" }, ...sides.map((one) => one.element), seconds.element, from.element, servo.element, go), said.element);
  byId("compare-form").addEventListener("submit", (event) => { event.preventDefault(); compare(); });
  view = new CompareView(byId("compare-arm"), byId("compare-chart"), byId("compare-scrub"), byId("compare-play"));
  watch("links", () => { byId("compare-result").hidden = true; });
}

function select(label, choices) {
  const input = el("select", {}, ...choices.map(([value, text]) => el("option", { value }, text)));
  return { input, element: el("label", { class: "option" }, el("span", {}, label), input) };
}

function side(name, method) {
  const choice = select(`${name} integrator`, METHODS);
  choice.input.value = method;
  const timestep = option({ label: "timestep", unit: "s", placeholder: "as the arm", value: 0.01 });
  return { name, choice, timestep, element: el("div", { class: `side ${name}` }, choice.element, timestep.element) };
}

function timestepOf(one) {
  return one.timestep.number() ?? state.integrator?.timestep;
}

function request(one, samples) {
  const n = state.links;
  const still = from.input.value === "rest";
  const args = {
    q0: still ? new Array(n).fill(0) : Array.from(state.position.subarray(0, n)),
    qdot0: still ? new Array(n).fill(0) : Array.from(state.velocity.subarray(0, n)),
    duration: seconds.number(),
    timestep: timestepOf(one),
    integrator: one.choice.input.value,
    params: state.params,
    samples,
    reference: true,
  };
  if (servo.input.value === "on") {
    args.gains = state.gains;
    args.setpoint = state.setpointKnown ? Array.from(state.setpoint.subarray(0, n)) : new Array(n).fill(0);
  }
  return args;
}

async function compare() {
  if (state.links === 0 || !state.params) {
    said.show("There is no arm to compare with: not connected.");
    return;
  }
  go.disabled = true;
  setText(go, "Reckoning…");
  const { lengths } = state.params;
  const samples = commonSamples(seconds.number(), sides.map(timestepOf));
  const requests = sides.map((one) => request(one, samples));
  const answers = await Promise.all(requests.map((args) => rollout(args)));
  go.disabled = false;
  setText(go, "Compare");
  const failed = answers.findIndex((answer) => !answer.result);
  if (failed >= 0) {
    const answer = answers[failed];
    said.show(nobodyProvides(answer) ? `This runtime can't compare: ${answer.status}` : `${sides[failed].name}: ${answer.status}`);
    return;
  }
  said.show("");
  const runs = answers.map(({ values }, i) => run(values, requests[i]));
  byId("compare-result").hidden = false;
  const apart = view.show(runs, lengths, state.links);
  showTable(runs, apart);
}

function run(values, args) {
  return { ...values, method: args.integrator, timestep: args.timestep };
}

function lastOf(list) {
  return list?.length > 0 ? list[list.length - 1] : NaN;
}

/** The worst of an error that may be one number, or one per sample. */
function worst(error) {
  if (Array.isArray(error)) return error.reduce((most, one) => Math.max(most, one ?? Infinity), 0);
  return error ?? NaN;
}

function showTable(runs, apart) {
  const rows = [
    ["timestep", (one) => duration(one.timestep)],
    ["energy gained", (one) => `${significant(lastOf(one.energy) - one.energy[0], 3)} J`],
    ["largest error", (one) => `${significant(worst(one.error), 3)} rad`],
    ["evaluations", (one) => significant(one.evaluations, 6)],
    ["reckoned in", (one) => duration(one.wall_time)],
  ];
  byId("compare-table").replaceChildren(
    el("thead", {}, el("tr", {}, el("td"), ...runs.map((one, i) => el("th", { scope: "col", class: sides[i].name }, methodName(one.method))))),
    el("tbody", {}, ...rows.map(([name, text]) => el("tr", {}, el("th", { scope: "row" }, name), ...runs.map((one) => el("td", {}, text(one)))))),
  );
  const end = `At the end the tips are ${significant(lastOf(apart), 3)} m apart, at most ${significant(Math.max(...apart.filter(Number.isFinite)), 3)} m.`;
  setText(byId("compare-text"), end);
  announce(end);
}
