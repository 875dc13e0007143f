// What a chart shows, to keep: its numbers as a table, and a Python program for the wheel `pendularm` that computes them.
// Invariant: the program has every request of the chart with all its settings. It does not depend on the live arm.

import { byId, el, setText } from "./dom.js";
import { exact } from "./format.js";

/** @typedef {Record<string, any>} Asked the arguments of a request to `/study/rollout`, or `/study/stability` */
/**
 * @typedef {object} Content
 * @property {string} name
 * @property {string[]} columns their names and units
 * @property {any[][]} rows
 * @property {Asked[]} asked the requests of which the rows are the answers
 * @property {string} python an expression for the rows, with `asked`, `common` and the answers `runs`
 * @property {string[]} [computed] the columns of the expression, if they are not all
 * @property {string} [note]
 */

/** Tabs between the numbers, so that a spreadsheet has columns. @param {Content} content */
export function tableText({ columns, rows }) {
  return [columns, ...rows].map((row) => row.map((one) => (typeof one === "number" ? exact(one) : one ?? "")).join("\t")).join("\n");
}

/** Keywords that the program writes for each run, even if they are the same in all. */
const VARIED = ["method", "timestep"];

/** The keywords of a function of the wheel, without those of an ideal robot. @param {Asked} asked @returns {Record<string, any>} */
function keywords({ params, viscous, integrator, q0, qdot0, delay, limits, sensors, ...rest }) {
  const { effort = null, anti_windup = "clamp", tracking_time } = limits ?? {};
  const { encoder_step = [], velocity = "exact", delay: late = Number(delay ?? 0) } = sensors ?? {};
  return {
    method: integrator, ...(q0 && { q: q0, qd: qdot0 }), ...rest, ...(late > 0 && { control_delay: late }), ...(effort && { effort_limit: effort }),
    ...((effort || anti_windup !== "clamp") && { anti_windup, tracking_time }), ...(encoder_step.some(Boolean) && { encoder_step }),
    ...(velocity !== "exact" && { velocity_source: velocity }),
  };
}

/** A value in Python. No text of a request is one of these words. @param {any} value */
const literal = (value) => JSON.stringify(value).replace(/\b(true|false|null)\b/g, (word) => ({ true: "True", false: "False" })[word] ?? "None")
  .replace(/([,:])(?=\S)/g, "$1 ");

/** @param {Content} content */
export function pythonText({ name, columns, asked, python, computed = columns, note = "" }) {
  const service = "duration" in asked[0] ? "rollout" : "stability";
  const all = asked.map(keywords);
  // Limits do not depend on the present timestep.
  const left = service === "stability" ? ["timestep"] : [];
  const isCommon = (/** @type {string} */ key) => !VARIED.includes(key) && all.every((one) => JSON.stringify(one[key]) === JSON.stringify(all[0][key]));
  const part = (/** @type {Asked} */ one, /** @type {boolean} */ common) => Object.entries(one)
    .filter(([key, value]) => value !== undefined && !left.includes(key) && isCommon(key) === common).map(([key, value]) => `"${key}": ${literal(value)}`);
  const { params, viscous = [] } = asked[0];
  const parts = Object.entries({ ...params, ...(viscous.some(Boolean) && { viscous }) });
  return [
    `# pendularm: ${name}`, ...(note ? [`# ${note}`] : []), "import pendularm", "",
    `arm = pendularm.Arm(${[params.masses.length, ...parts.map(([key, one]) => `${key}=${literal(one)}`)].join(", ")})`,
    "common = {", ...part(all[0], true).map((one) => `    ${one},`), "}", "asked = [", ...all.map((one) => `    {${part(one, false).join(", ")}},`), "]",
    `runs = [pendularm.${service}(arm, **common, **one) for one in asked]`,
    `print(${computed.map((one) => JSON.stringify(one)).join(", ")}, sep="\\t")`, `for row in ${python}:`, '    print(*row, sep="\\t")', "",
  ].join("\n");
}

/** @type {Content | null} */
let shown = null;

/** Puts a button into the caption of a chart. @param {Element | null} caption @param {() => Content | null} content */
export function copyable(caption, content) {
  caption?.append(el("button", {
    type: "button", class: "copy no-print", title: "Copy this chart as a table or as Python", onclick: () => open(content()),
  }, "Copy"));
}

function open(content) {
  shown = content && content.rows.length > 0 ? content : null;
  byId("copy-area").value = "";
  byId("copy-table").disabled = !shown;
  byId("copy-python").disabled = !shown || shown.asked.length === 0;
  setText(byId("copy-title"), shown ? `Copy: ${shown.name}` : "Copy");
  setText(byId("copy-text"), shown ? shown.note ?? "" : "This chart has no numbers yet.");
  byId("copy").showModal();
}

export function startCopy() {
  const by = (/** @type {(content: Content) => string} */ write) => async () => {
    if (!shown) return;
    const area = byId("copy-area");
    area.value = write(shown);
    const said = await navigator.clipboard?.writeText(area.value).then(() => "Copied.", () => null) ?? "Copying is not allowed here. Select the text.";
    setText(byId("copy-text"), said);
    area.select();
  };
  byId("copy-table").addEventListener("click", by(tableText));
  byId("copy-python").addEventListener("click", by(pythonText));
}
