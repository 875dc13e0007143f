// The longest control period of any robot near a pose: a form for its matrices, and the study's answer in words.
// Invariant: an answer belongs to the numbers in the form, so it goes with the first change. The live arm does not change.

import { el } from "./dom.js";
import { busy, option, panel, withoutFigure } from "./field.js";
import { exact, inPageNames, METHODS, seconds } from "./format.js";
import { linearised } from "./mechanics.js";
import { answerInForce, limitText } from "./policy.js";
import { questionOf } from "./question.js";
import { heldLimit } from "./runtime.js";
import { known, state, unknown } from "./store.js";

/** @type {[string, string, boolean?][]} fields of numbers; a matrix has several rows */
const LISTS = [["mass_matrix", "mass matrix M at the pose [kg m²], a row in each line", true], ["kp", "kp [N m/rad]"], ["ki", "ki [N m/(rad s)]"],
  ["kd", "kd [N m s/rad]"], ["damping", "damping of the joints [N m s/rad]"], ["stiffness", "stiffness: springs and gravity [N m/rad]", true]];
const BETWEEN = /** @type {[string, string][]} */ ([["exact", "exact motion, as a real robot"], ["semi_implicit", "semi-implicit Euler"],
  ["implicit", "Euler, implicit in the damping"], ...METHODS.map(([method, name]) => [method, name])]);
const DIGITS = 10; // digits of the numbers of the present arm

/** The form in a part that opens. It begins with the present arm, controlled. */
export function robotForm() {
  const lists = LISTS.map(([name, label, isMatrix]) => ({ name, ...option({ label, rows: isMatrix ? 3 : 1 }) }));
  const period = option({ label: "control period", unit: "ms" });
  const delay = option({ label: "delay", unit: "periods" });
  const between = option({ label: "motion between two runs of the controller", choices: BETWEEN });
  const steps = option({ label: "steps in a period", value: 1 });
  const options = [...lists, between, period, steps, delay];
  const answer = el("div", { class: "robot-answer", role: "status" });

  const fill = async () => {
    const question = await known(() => questionOf({ ...state, enabled: true, setpointKnown: true }));
    if (!question) return said.show(unknown().status);
    const args = heldArgs(question, state.enabled ? answerInForce(state)?.equilibrium ?? question.setpoint : question.q);
    const text = (/** @type {any} */ value) => (Array.isArray(value) ? value.map(text).join(Array.isArray(value[0]) ? "\n" : " ")
      : exact(Number(value.toPrecision(DIGITS))));
    for (const { name, input } of lists) input.value = text(args[name]);
    period.input.value = text(1e3 * args.period);
    delay.input.value = String(args.delay);
    forget();
  };
  const forget = () => {
    said.show("");
    answer.replaceChildren();
  };
  const ask = async () => {
    forget();
    const { result, values } = await said.report(heldLimit({
      ...Object.fromEntries(lists.map(({ name, input }) => [name, numbersIn(input.value)])),
      period: period.number() === undefined ? undefined : seconds(period.number()), delay: delay.number(), between: between.input.value, steps: steps.number(),
    }), withoutFigure);
    if (result) answer.replaceChildren(...inWords(values));
  };
  const form = el("div", { oninput: forget });
  const said = panel(form, options, [["Find the longest period", () => busy(said.buttons[0], "Computing…", ask), { type: "submit", class: "primary" }],
    ["Take the present arm", fill]], answer);
  return el("details", { class: "robot", ontoggle: () => { if (lists[0].input.value === "") fill(); } },
    el("summary", {}, "Another robot, by its mass matrix"), form);
}

/**
 * The loop near a pose as the arguments of `/study/held_limit`: its matrices by rows. @param {import("./question.js").Question} question @param {number[]} pose
 * @returns {Record<string, any>}
 */
function heldArgs({ params, gains, viscous = [0], control_period, timestep, delay, sensors }, pose) {
  const { mass, stiffness } = linearised(pose, params);
  return { mass_matrix: mass, ...gains, damping: viscous, stiffness, period: control_period || timestep, delay: sensors?.delay ?? Number(delay) };
}

/** The numbers in a text: a copied matrix may have brackets, commas and semicolons. @param {string} text */
function numbersIn(text) {
  return text.split(/[\s,;()[\]]+/).filter(Boolean).map(Number);
}

function inWords({ period_limit: limit, explanation }) {
  const parts = inPageNames(explanation).replaceAll("kg m^2", "kg m²").split("; ");
  const figure = limit === 0 ? "none is stable" : limit === null ? "no limit was found" : limitText(limit);
  return [el("p", {}, "Longest control period: ", el("b", {}, figure)),
    el("ul", {}, ...parts.map((part) => el("li", {}, `${part[0].toUpperCase()}${part.slice(1)}.`)))];
}
