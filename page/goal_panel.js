// @ts-check
// The goal's panel: a target in numbers, its tolerance, and what became of it. Dragging in the view uses the same options.
// Invariant: a goal is shown as active only while the runtime says so.

import { byId, el, setText } from "./dom.js";
import { option, refusal } from "./field.js";
import { fixed } from "./format.js";
import { DEFAULT_EPSILON, cancelGoal, sendGoal } from "./runtime.js";
import { state, watch } from "./store.js";

const fields = {
  x: option({ label: "x", unit: "m" }),
  y: option({ label: "y", unit: "m" }),
  phi: option({ label: "orientation", unit: "rad", placeholder: "any" }),
  epsilon: option({ label: "tolerance", unit: "m", placeholder: String(DEFAULT_EPSILON) }),
  success_hold: option({ label: "hold", unit: "s", placeholder: "0.5" }),
};
let said;
let text;
let shownId = ""; // of the goal that is shown

export function startGoalPanel() {
  const send = el("button", { type: "submit", class: "primary" }, "Send goal");
  const cancel = el("button", { type: "button", onclick: () => report(cancelGoal()) }, "Cancel goal");
  said = refusal(fields.x.input, fields.y.input, fields.phi.input, fields.epsilon.input, fields.success_hold.input);
  text = el("p", { class: "note", id: "goal-text" }, "Drag in the view, or type a place for the end effector.");
  const form = el("form", { onsubmit: submit, novalidate: true },
    el("div", { class: "options" }, ...Object.values(fields).map((one) => one.element)),
    el("div", { class: "buttons" }, send, cancel), said.element, text);
  byId("goal-body").append(form);
  watch("links", (links) => { fields.phi.element.hidden = links < 3; });
  watch("goal", show);
}

function submit(event) {
  event.preventDefault();
  // The runtime names the fields that are missing.
  report(sendGoal({ x: fields.x.number(), y: fields.y.number(), ...goalOptions() }));
}

async function report(call) {
  const answer = await call;
  said.show(answer.result ? "" : answer.status);
}

/** Orientation and tolerance for the next goal; an empty field is left to the runtime. */
export function goalOptions() {
  return {
    phi: state.links > 2 ? fields.phi.number() : undefined,
    epsilon: fields.epsilon.number(),
    success_hold: fields.success_hold.number(),
  };
}

export function showGoalRefusal(status) {
  setText(said.element, status);
}

export function showGoalPlace({ x, y }) {
  fields.x.input.value = String(Number(x.toFixed(3)));
  fields.y.input.value = String(Number(y.toFixed(3)));
}

function show(goal) {
  if (goal && goal.id !== shownId) {
    shownId = goal.id;
    said.show(""); // what was refused before is of the past
  }
  if (!goal) setText(text, "Drag in the view, or type a place for the end effector.");
  else if (goal.outcome === "active") setText(text, `On the way: ${fixed(goal.distance, 3)} m left, ${fixed(goal.elapsed, 1)} s.`);
  else if (goal.outcome === "reached") setText(text, `Reached, ${fixed(goal.distance * 1000, 1)} mm from the target.`);
  else setText(text, "Given up: another goal, a cancellation or a reset took its place.");
}
