// The panel Realism: what a real arm has and the ideal one has not, each with a switch. A text says which number of a data sheet it is.
// Invariant: a switch shows what the runtime has. The panel is hidden while the runtime has none of it.

import { byId, el } from "./dom.js";
import { refusal } from "./field.js";
import { gravityLoad } from "./mechanics.js";
import { change } from "./runtime.js";
import { state, watch } from "./store.js";

/** A first limit is this multiple of the weight of the stretched arm, so it holds the arm and saturates in a move. */
const MARGIN = 1.5;
const LEAST = 5; // the first limit without a weight [N m]
const CURES = { clamp: "bound of 50 rad s", none: "none", conditional: "conditional integration", back_calculation: "back-calculation" };

/** The bits of encoders on offer: counts of a turn are a power of two. The first switching on takes those of a cheap magnetic encoder. */
const BITS = [10, 11, 12, 14, 16, 18, 20];
const CHEAP = 12;
const EXACT = "exact";
const MOST_DELAY = 16; // periods

const SOME = 1; // the first friction [N m s/rad]

/** The limits at the last switching off. @type {number[] | null} */
let before = null;

/**
 * The label of a list, its values with their texts, the present value, and the settings of a chosen one.
 * @typedef {[string, string[][], (present: any) => any, (value: any) => object]} List
 */
/**
 * Each kind, the first part of the ids of its elements: its group of settings, its name, whether it is on, the settings of its switch, its lists.
 * @type {{id: string, group: string, name: string, isOn: (present: any) => boolean, turned: (on: boolean) => object, lists: List[]}[]}
 */
const KINDS = [
  {
    id: "limit", group: "motors", name: "Effort limit", isOn: ({ effort }) => effort !== null,
    turned(on) {
      if (!on) before = state.motors.effort;
      return { effort: !on ? null : before?.length === state.links ? before : firstLimits() };
    },
    lists: [["anti-windup", Object.entries(CURES), ({ anti_windup }) => anti_windup, (anti_windup) => ({ anti_windup })]],
  },
  {
    id: "friction", group: "friction", name: "Friction", isOn: ({ viscous }) => viscous.some((one) => one > 0),
    turned: (on) => ({ viscous: ofEach(on ? SOME : 0) }), lists: [],
  },
  {
    id: "sensors", group: "sensors", name: "Sensors",
    isOn: ({ encoder_step, velocity, delay }) => encoder_step.some((one) => one > 0) || velocity !== EXACT || delay > 0,
    turned: (on) => (on ? { encoder_step: ofEach(stepOf(CHEAP)), velocity: "difference" } : { encoder_step: ofEach(0), velocity: EXACT, delay: 0 }),
    lists: [
      ["encoder", [[EXACT, EXACT], ...BITS.map((one) => [String(one), `${one} bits`])], ({ encoder_step: [step] }) => (step === 0 ? EXACT
        : BITS.find((one) => Math.abs(stepOf(one) - step) < 1e-12) ?? ""), (value) => ({ encoder_step: ofEach(value === EXACT ? 0 : stepOf(Number(value))) })],
      ["velocity", [[EXACT, EXACT], ["difference", "difference"]], ({ velocity }) => velocity, (velocity) => ({ velocity })],
      ["delay [periods]", Array.from({ length: MOST_DELAY + 1 }, (_, one) => [String(one), String(one)]), ({ delay }) => delay,
        (value) => ({ delay: Number(value) })],
    ],
  },
];

export function startRealism() {
  const controls = KINDS.flatMap(startKind);
  const said = refusal(...controls);
  byId("realism-switches").after(said.element);
  watch(["motors", "friction", "sensors"], () => { byId("realism").hidden = KINDS.every(({ group }) => state[group] === null); });

  /** @param {(typeof KINDS)[number]} kind @returns {HTMLElement[]} its switch and lists */
  function startKind({ id, group, name, isOn, turned, lists }) {
    // A list shows the present value again after a refusal.
    const send = (settings) => said.report(change(group, settings)).then(show);
    const button = el("button", { type: "button", class: "switch", id: `${id}-switch`, role: "switch", onclick: () => send(turned(!isOn(state[group]))) },
      el("span", { class: "knob", "aria-hidden": "true" }), el("span", {}, name));
    byId("realism-switches").append(button);
    const made = lists.map(([label, options, , settings]) => {
      const list = el("select", { onchange: () => send(settings(list.value)) }, ...options.map(([value, text]) => el("option", { value }, text)));
      byId(`${id}-options`).append(el("label", { class: "option" }, el("span", {}, label), list));
      return list;
    });
    const show = () => {
      const present = state[group];
      button.hidden = present === null;
      const on = present !== null && isOn(present);
      byId(`${id}-parts`).hidden = !on;
      button.setAttribute("aria-checked", String(on));
      if (present) lists.forEach(([, , valueOf], i) => { made[i].value = String(valueOf(present)); });
    };
    watch([group, "links"], show);
    return [button, ...made];
  }
}

/** The step of an encoder with this number of bits [rad]. @param {number} bits */
function stepOf(bits) {
  return (2 * Math.PI) / 2 ** bits;
}

/** The same value for each joint. @param {number} value @returns {number[]} */
function ofEach(value) {
  return new Array(state.links).fill(value);
}

/** @returns {number[]} [N m] */
function firstLimits() {
  const load = new Float64Array(state.links);
  if (state.params) gravityLoad(state.links, load.slice(), state.params, load);
  return Array.from(load, (one) => Math.max(LEAST, Math.ceil(MARGIN * one)));
}
