// A number of the runtime: label, slider, input, and the runtime's answer to the last change.
// Invariant: the field has the present value, except while a user changes it.

import { el, setText, warn } from "./dom.js";
import { inPageNames, plain, significant } from "./format.js";
import { latestOnly } from "./latest.js";
import { watch } from "./store.js";

const SLIDER_STEPS = 400;
const SEND_MS = 70;
/** Digits by which two values are compared. The conversion of units changes the last ones. */
const DIGITS = 12;
const LONG = 20; // a longer choice needs a row of its own [characters]
let nextId = 1;

/** The place for a refusal or a note, shown until its cause is gone. `describes` are its controls. */
export function refusal(...describes) {
  const text = el("p", { class: "refusal", id: `refusal-${nextId}` });
  nextId += 1;
  for (const one of describes) one.setAttribute("aria-describedby", text.id);
  const show = (status, isNote = false) => {
    const words = inPageNames(status);
    setText(text, words);
    text.classList.toggle("note", isNote);
    for (const one of describes) {
      if (status && !isNote) one.setAttribute("aria-invalid", "true");
      else one.removeAttribute("aria-invalid");
    }
    if (words) warn(words);
  };
  // Call this after a new connection, or when all settings are set again.
  watch("connection", (now) => { if (now === "open") show(""); });
  watch("anew", () => show(""));
  /**
   * Shows the outcome of a call, a refusal as `words` gives it, and returns the answer. @param {Promise<{result:
   * boolean, status: string, values: any}>} call @param {(status: string) => string} [words]
   */
  const report = async (call, words = (status) => status) => {
    const answer = await call;
    show(answer.result ? "" : words(answer.status));
    return answer;
  };
  return { element: text, show, report };
}

/** Shows `text` on the button and disables it while `work` runs. @param {HTMLButtonElement} button @param {string} text @param {() => Promise<any>} work */
export async function busy(button, text, work) {
  if (button.disabled) return;
  const before = button.textContent;
  const hadFocus = document.activeElement === button; // a disabled button loses it
  button.disabled = true;
  setText(button, text);
  await work();
  button.disabled = false;
  setText(button, before);
  if (hadFocus && document.activeElement === document.body) button.focus();
}

/**
 * A form: options, buttons, and the place for a refusal. Returns the latter, and the buttons. A button of the type
 * submit is pressed by Enter too. @param {HTMLElement} place @param {{input: HTMLElement, element: HTMLElement}[]}
 * options @param {[string, () => void, object?][]} buttons @param {...HTMLElement} last
 */
export function panel(place, options, buttons, ...last) {
  const made = buttons.map(([text, act, attributes]) => el("button", { type: "button", onclick: act, ...attributes }, text));
  const said = refusal(...options.map(({ input }) => input), ...made);
  place.append(el("form", { novalidate: true, onsubmit: (event) => event.preventDefault() },
    el("div", { class: "options" }, ...options.map(({ element }) => element)), el("div", { class: "buttons" }, ...made), said.element, ...last));
  return { ...said, buttons: made };
}

/** A refusal without the figures of a time, which are in seconds and therefore not the typed ones. @param {string} status */
export function withoutFigure(status) {
  return status.replace(/((?:timestep|period|duration)\b[^;]*?), got [^,;]*(?=;|$)/g, "$1");
}

/**
 * @param {object} options
 * @param {string} options.label what it is, for everybody
 * @param {string} [options.short] what is shown instead of the label, if the place explains the rest
 * @param {string} options.unit
 * @param {number} options.low left end of the slider @param {number} options.high right end
 * @param {boolean} [options.log] whether the slider goes by ratios; with `low` > 0, or `zero` at its left end
 * @param {boolean} [options.zero] whether the left end means 0
 * @param {string} [options.zeroText] what 0 means, in words under the left end
 * @param {(value: number) => Promise<{result: boolean, status: string, values: any}>} options.commit
 * @param {(value: number) => number} [options.fit] the value that is sent for a chosen one @param {string} [options.rule] the reason for it
 * @param {string} [options.className] of the slider
 */
export function numberField({ label, short = label, unit, low, high, log = false, zero = false, zeroText = "", commit, fit = (value) => value,
  rule = "", className = "" }) {
  const id = `field-${nextId}`;
  nextId += 1;
  const input = el("input", { type: "number", step: "any", id, inputmode: "decimal", autocomplete: "off" });
  const slider = el("input", { type: "range", min: "0", max: String(SLIDER_STEPS), step: "1", "aria-label": `${label}, slider`, class: className });
  slider.value = String(SLIDER_STEPS / 2);
  const limit = el("span", { class: "mark", hidden: true });
  const track = el("span", { class: "track" }, slider, limit);
  if (zeroText) track.append(el("small", { class: "left-end", "aria-hidden": "true" }, zeroText));
  input.placeholder = "–"; // until the runtime has answered
  const said = refusal(input);
  let accepted = NaN;
  let shown = ""; // the text of the accepted value
  let marked = NaN;
  let pending = 0;

  const fromSlider = (at) => {
    if (zero && at === 0) return 0;
    const part = at / SLIDER_STEPS;
    return Number((log ? low * (high / low) ** part : low + part * (high - low)).toPrecision(3));
  };
  const partOf = (value) => (log ? Math.log(Math.max(value, low) / low) / Math.log(high / low) : (value - low) / (high - low));
  const toSlider = (value) => Math.round(SLIDER_STEPS * Math.min(1, Math.max(0, partOf(value))));
  const describe = () => {
    const now = zeroText && accepted === 0 ? zeroText : `${plain(accepted)} ${unit}`;
    slider.setAttribute("aria-valuetext", limit.hidden ? now : `${now}, ${limit.title}`);
  };
  const show = () => {
    if (pending > 0) return;
    // A typed value keeps its digits.
    if (parseFloat(input.value).toPrecision(DIGITS) !== accepted.toPrecision(DIGITS)) input.value = plain(accepted);
    shown = input.value;
    slider.value = String(toSlider(accepted));
    describe();
  };
  const submit = async (value) => {
    pending += 1;
    const answer = await said.report(commit(value), unit === "ms" ? withoutFigure : undefined);
    pending -= 1;
    show();
    return answer;
  };
  const slide = latestOnly((value) => submit(fit(value)), SEND_MS);

  slider.addEventListener("input", () => {
    input.value = plain(fromSlider(Number(slider.value)));
    slide(Number(input.value));
  });
  const typed = async () => {
    if (input.value === shown) return;
    if (input.value === "") {
      said.show(`${label} must be a number`);
      show();
      return;
    }
    const value = Number(input.value);
    const used = fit(value);
    const { result } = await submit(used);
    if (result && used !== value) said.show(`The ${label} is ${plain(used)} ${unit}, because ${rule}.`, true);
  };
  input.addEventListener("input", () => said.show(""));
  input.addEventListener("change", typed);
  input.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    show();
    said.show("");
  });

  return {
    element: el("div", { class: "field" },
      el("label", { for: id, title: label }, el("span", { class: "visually-hidden" }, label), el("span", { "aria-hidden": "true" }, short)),
      track, input, el("span", { class: "unit" }, unit), said.element),
    /** Sets the runtime's value. It is not shown while a change is pending or the user types. */
    accept(value) {
      if (value === accepted) return;
      const typing = document.activeElement === input && input.value !== shown;
      accepted = value;
      if (typing) return;
      said.show("");
      show();
    },
    /** Marks the stability limit on the slider, if it is within its range. */
    mark(value) {
      if (Object.is(value, marked)) return;
      marked = value;
      limit.hidden = !(value >= low && value <= high);
      if (!limit.hidden) {
        limit.title = `stable up to ${significant(value, 3)} ${unit}`;
        limit.style.setProperty("--at", String(partOf(value)));
      }
      describe();
    },
    report: said.report,
  };
}

/**
 * A number for a later request: nothing is sent when it changes. An empty field is omitted. With `choices`, values and
 * their texts, one of them is chosen instead. With `rows` it is a text field of this height. @param {{label: string, unit?: string,
 * value?: string | number, placeholder?: string, choices?: [string, string][], rows?: number}} options
 */
export function option({ label, unit = "", value = "", placeholder = "", choices = [], rows = 0 }) {
  const input = choices.length > 0 ? el("select", {}, ...choices.map(([name, text]) => el("option", { value: name }, text)))
    : rows > 0 ? el("textarea", { rows, spellcheck: "false", autocomplete: "off" })
    : el("input", { type: "number", step: "any", inputmode: "decimal", autocomplete: "off", value, placeholder });
  return {
    element: el("label", { class: rows > 0 || choices.some(([, text]) => text.length > LONG) ? "option wide" : "option" }, el("span", {}, label),
      el("span", { class: "with-unit" }, input, ...(unit ? [el("span", { class: "unit" }, unit)] : []))),
    input,
    /** `undefined` if the field is empty, NaN if its text is no number. */
    number: () => (input.validity.badInput ? NaN : input.value === "" ? undefined : Number(input.value)),
  };
}
