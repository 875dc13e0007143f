// A student's own arm: a form, and a printable sheet with its limits, the reason, the benefit of a better method, and a link.
// Invariant: the sheet asks the study about the form's arm alone, from rest, whatever the live arm does. The live arm does not change.

import { byId, el } from "./dom.js";
import { busy, option, panel } from "./field.js";
import { METHODS, significant } from "./format.js";
import { errorText, moveOf, read } from "./ladder.js";
import { cause, limitText, others } from "./policy.js";
import { isFree } from "./question.js";
import { rollout, stability } from "./runtime.js";
import { DEFAULTS, toFragment } from "./settings.js";
import { state } from "./store.js";

const MOVE = 2; // duration of the move with the error on the sheet [s]
const AT = 0.001; // its timestep and control period [s]
const SAMPLES = 101; // times at which the error is measured; the largest counts

/** @type {[string, string][]} */
const LISTS = [["masses", "mass [kg]"], ["lengths", "length [m]"], ["kp", "kp [N m/rad]"], ["ki", "ki [N m/(rad s)]"], ["kd", "kd [N m s/rad]"]];

/** @type {Record<string, any[]>} */
let fields = {};
let gravity;
let said;

/**
 * Puts the form into `place`, with the present arm's values. `whenMade` is called after a sheet has been made. @param
 * {HTMLElement} place @param {() => void} whenMade
 */
export function showForm(place, whenMade) {
  const known = /** @type {any} */ ({ ...DEFAULTS[state.links].params, ...DEFAULTS[state.links].gains, ...state.params, ...state.gains });
  gravity = option({ label: "gravity", unit: "m/s²", value: known.gravity });
  fields = Object.fromEntries(LISTS.map(([key, name]) => [key,
    known[key].map((/** @type {number} */ value, /** @type {number} */ i) => option({ label: `${name} ${i + 1}`, value }))]));
  const form = el("div", { id: "own-form" });
  const go = () => busy(said.buttons[0], "Computing…", async () => { if (await make()) whenMade(); });
  said = panel(form, [...Object.values(fields).flat(), gravity], [["Make my sheet", go, { type: "submit", class: "primary" }]]);
  place.replaceChildren(form, el("div", { id: "sheet", role: "region", "aria-label": "The sheet of your arm", hidden: true }));
}

async function make() {
  const list = (/** @type {string} */ key) => fields[key].map((one) => one.number() ?? NaN);
  const params = { gravity: gravity.number() ?? NaN, masses: list("masses"), lengths: list("lengths") };
  const gains = { kp: list("kp"), ki: list("ki"), kd: list("kd") };
  const setpoint = new Array(state.links).fill(0);
  /** @type {Record<string, any>} */
  const answers = {};
  for (const [integrator] of METHODS) {
    const question = { params, gains, setpoint, q: setpoint, qd: setpoint, control_period: 0, delay: false, integrator, timestep: AT };
    const answer = await stability(question);
    if (!answer.result) {
      said.show(answer.status);
      byId("sheet").hidden = true;
      return false;
    }
    const move = await rollout(moveOf(question), { duration: MOVE, samples: SAMPLES, reference: true });
    const error = move.result ? errorText({ ...read({ method: integrator, timestep: AT }, move.values), sampling: null }) : move.status;
    answers[integrator] = { ...answer.values, error };
  }
  said.show("");
  const link = new URL(location.href);
  link.search = "";
  link.hash = toFragment({ ...DEFAULTS[state.links], params, gains, controller: true, setpoint }, state.links);
  byId("sheet").replaceChildren(...sheet(params, gains, answers, link.href));
  byId("sheet").hidden = false;
  byId("sheet").scrollIntoView({ block: "nearest" });
  return true;
}

/** @param {any} params @param {any} gains @param {Record<string, any>} answers @param {string} link */
function sheet(params, gains, answers, link) {
  const text = (/** @type {number[]} */ values) => values.map((one) => significant(one, 4)).join(", ");
  const row = (/** @type {string} */ name, /** @type {string} */ value) => el("tr", {}, el("th", { scope: "row" }, name), el("td", {}, value));
  const period = answers.rk4.control_period_limit ?? Infinity;
  const free = isFree(gains);
  const reason = free ? "all gains are 0, so no controller holds this arm." : period === Infinity ? "no limit of this arm was found."
    : cause(answers.rk4, period);
  return [
    el("h3", {}, "My arm and its two clocks"),
    el("table", {}, el("tbody", {},
      row("Masses", `${text(params.masses)} kg`), row("Lengths", `${text(params.lengths)} m`), row("Gravity", `${significant(params.gravity, 4)} m/s²`),
      row("Gains kp", `${text(gains.kp)} N m/rad`), row("Gains ki", `${text(gains.ki)} N m/(rad s)`), row("Gains kd", `${text(gains.kd)} N m s/rad`),
      row("Longest control period, stretched out", free ? "no controller" : period === 0 ? "none" : limitText(period)),
      ...METHODS.map(([method, name]) => row(`Longest timestep, ${free ? "small swings" : "the controller at each step, stretched out"}, ${name}`,
        limitText(held(answers[method])))),
      row("Longest timestep in every pose, Runge–Kutta 4", limitText(answers.rk4.minimum_over_poses_held ?? Infinity)),
      ...METHODS.map(([method, name]) => row(`Largest error of the method [rad] in a ${free ? "swing" : "move"} of ${MOVE} s at ${1e3 * AT} ms, `
        + `${name}`, answers[method].error)),
    )),
    el("p", {}, `Reason: ${reason}`),
    ...(free || period === 0 ? [] : [el("p", {}, others(Object.fromEntries(METHODS.map(([method]) => [method, held(answers[method])]))))]),
    el("p", { class: "sheet-link" }, "This arm as a link: ", el("a", { href: link }, link)),
    el("div", { class: "buttons no-print" }, el("button", { type: "button", onclick: () => print() }, "Print")),
  ];
}

/** The limit of small motions [s]. A limit of fast motions is an estimate of another kind. @param {any} answer */
function held(answer) {
  return answer.timestep_limit_held ?? Infinity;
}
