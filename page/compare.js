// @ts-check
// Any number of integrators and timesteps against a reference: the same arm, from the same state, computed offline by the
// runtime, drawn over one another and played back together.
// Invariant: the runs that are compared are the runtime's answers; the live arm is not touched.

import { announce } from "./announce.js";
import { CompareView } from "./compare_view.js";
import { byId, el, setText } from "./dom.js";
import { option, refusal } from "./field.js";
import { METHODS, duration, fixed, shortName } from "./format.js";
import { commonSamples } from "./resample.js";
import { nobodyProvides } from "./rosbridge.js";
import { rollout } from "./runtime.js";
import { describeRun, distances, divergedAt, partsAt } from "./runs.js";
import { state, watch } from "./store.js";

const MOST_RUNS = 6;
/** The reference is Runge-Kutta 4 at this part of the smallest timestep. */
const REFERENCE_PART = 1 / 8;
const PARTED = 0.1; // rad: from there on it is another motion

const SECONDS = 5; // where no duration is given

let view;
let said;
let rows = [];
let seconds;
let from;
let servo;
let go;
let add;

export function startCompare() {
  seconds = option({ label: "duration", unit: "s", value: SECONDS, placeholder: String(SECONDS) });
  from = select("start", [["now", "as it is"], ["rest", "stretched out"]]);
  servo = select("servo", [["off", "off"], ["on", "on"]]);
  go = el("button", { type: "submit", class: "primary" }, "Compare");
  add = el("button", { type: "button", class: "small", onclick: () => addRow("rk4", 0.001) }, "Add a run");
  said = refusal(go);
  byId("compare-form").append(
    el("div", { class: "compare-rows" }, el("div", { id: "compare-rows", class: "as-parts" }), add),
    el("div", { class: "compare-row" }, seconds.element, from.element, servo.element, go), said.element,
  );
  addRow("euler", 0.01);
  addRow("rk4", 0.01);
  byId("compare-form").addEventListener("submit", (event) => { event.preventDefault(); compare(); });
  view = new CompareView();
  watch("links", () => { byId("compare-result").hidden = true; });
  watch("lesson", (lesson) => { if (lesson?.runs) showLesson(lesson); });
}

function select(label, choices) {
  const input = el("select", {}, ...choices.map(([value, text]) => el("option", { value }, text)));
  return { input, element: el("label", { class: "option" }, el("span", {}, label), input) };
}

function addRow(method, timestep) {
  if (rows.length >= MOST_RUNS) return;
  const choice = el("select", { "aria-label": "integrator" }, ...METHODS.map(([value]) => el("option", { value }, shortName(value))));
  choice.value = method;
  const step = el("input", { type: "number", step: "any", inputmode: "decimal", "aria-label": "timestep", value: timestep });
  const remove = el("button", { type: "button", class: "small", "aria-label": "remove this run", onclick: () => drop(row) }, "✕");
  const element = el("div", { class: "side" }, choice, step, el("span", { class: "unit" }, "s"), remove);
  const row = { choice, step, element };
  rows.push(row);
  byId("compare-rows").append(element);
  number();
}

function drop(row) {
  if (rows.length === 1) return;
  rows = rows.filter((one) => one !== row);
  row.element.remove();
  number();
}

function number() {
  rows.forEach(({ element }, i) => { element.className = `side run${i + 1}`; });
  add.disabled = rows.length >= MOST_RUNS;
}

async function showLesson({ runs, seconds: wanted }) {
  for (const { element } of rows) element.remove();
  rows = [];
  for (const [method, timestep] of runs) addRow(method, timestep);
  seconds.input.value = String(wanted);
  from.input.value = "rest";
  servo.input.value = "off";
  await new Promise((done) => setTimeout(done, 300)); // the arm has its settings by then
  compare();
}

function request(method, timestep, samples) {
  const n = state.links;
  const still = from.input.value === "rest";
  const zero = new Array(n).fill(0);
  return {
    q0: still ? zero : Array.from(state.position.subarray(0, n)),
    qdot0: still ? zero : Array.from(state.velocity.subarray(0, n)),
    duration: lasting(),
    timestep,
    integrator: method,
    params: state.params,
    samples,
    ...(servo.input.value === "on" ? { gains: state.gains, setpoint: Array.from(state.setpoint.subarray(0, n)) } : {}),
  };
}

/** How long the runs last [s]. */
const lasting = () => seconds.number() ?? SECONDS;

async function compare() {
  if (state.links === 0 || !state.params) {
    said.show("There is no arm to compare with: not connected.");
    return;
  }
  go.disabled = true;
  setText(go, "Reckoning…");
  const wanted = rows.map(({ choice, step }) => [choice.value, step.value === "" ? state.integrator?.timestep : Number(step.value)]);
  const finest = Math.min(...wanted.map(([, timestep]) => timestep)) * REFERENCE_PART;
  wanted.push(["rk4", finest]);
  const samples = commonSamples(lasting(), wanted.map(([, timestep]) => timestep));
  const requests = wanted.map(([method, timestep]) => request(method, timestep, samples));
  const answers = await Promise.all(requests.map((args) => rollout(args)));
  go.disabled = false;
  setText(go, "Compare");
  const failed = answers.findIndex((answer) => !answer.result);
  if (failed >= 0) {
    const answer = answers[failed];
    const name = failed < rows.length ? `run ${failed + 1}` : "the reference";
    said.show(nobodyProvides(answer) ? `This runtime can't compare: ${answer.status}` : `${name}: ${answer.status}`);
    return;
  }
  said.show("");
  const runs = answers.map(({ values }, i) => ({ ...values, method: requests[i].integrator, timestep: requests[i].timestep }));
  const reference = runs.pop();
  const away = runs.map((run) => distances(run, reference));
  byId("compare-result").hidden = false;
  view.show(runs, away, reference, state.params.lengths, state.links, lasting());
  showTable(runs, away, reference);
}

function showTable(runs, away, reference) {
  const lasted = lasting();
  const columns = [["outcome", "outcome"], ["energy", "energy gained"], ["error", "largest error"], ["evaluations", "evaluations"], ["time", "run time"]];
  const lines = runs.map((run, i) => describeRun(run, away[i], lasted));
  byId("compare-table").replaceChildren(
    el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "run"), ...columns.map(([, name]) => el("th", { scope: "col" }, name)))),
    el("tbody", {}, ...lines.map((line, i) => el("tr", {}, el("th", { scope: "row", class: `run${i + 1}` }, line.name), ...columns.map(([key]) => el("td", {}, line[key]))))),
  );
  const words = runs.map((run, i) => {
    const ended = divergedAt(run, lasted);
    const parts = partsAt(reference.times, away[i], PARTED);
    if (ended !== null) return `${lines[i].name} diverged at t = ${fixed(ended, 2)} s`;
    return parts === null ? `${lines[i].name} stays within ${PARTED} rad` : `${lines[i].name} is ${PARTED} rad off after ${fixed(parts, 2)} s`;
  });
  const text = `Against Runge–Kutta 4 at ${duration(reference.timestep)}: ${words.join("; ")}.`;
  setText(byId("compare-text"), text);
  announce(text);
}
