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

/** Arguments that the library has not, because its arm has no such parts. */
const PARTS = ["delay", "limits", "viscous", "sensors"];
/** Arguments that each request names, also those that are the same in all. */
const VARIED = ["integrator", "timestep"];

/** Whether a request is about parts that the library does not have. @param {Asked} asked */
function hasParts({ delay, limits, viscous, sensors }) {
  const { encoder_step = [], velocity = "exact", delay: late = 0 } = sensors ?? {};
  return delay === true || limits?.effort != null || velocity !== "exact" || [...viscous ?? [], ...encoder_step, late].some((one) => one !== 0);
}

/** A value in Python. No text of a request is one of these words. @param {any} value */
const literal = (value) => JSON.stringify(value).replace(/\b(true|false|null)\b/g, (word) => ({ true: "True", false: "False" })[word] ?? "None")
  .replace(/([,:])(?=\S)/g, "$1 ");

/** @param {Content} content */
export function pythonText({ name, columns, asked, python, computed = columns, note = "" }) {
  const service = "duration" in asked[0] ? "rollout" : "stability";
  const isProgram = asked.some(hasParts);
  // Limits do not depend on the present timestep.
  const left = isProgram ? [] : ["params", ...PARTS, ...(service === "stability" ? ["timestep"] : [])];
  const isCommon = (/** @type {string} */ key) => !VARIED.includes(key) && asked.every((one) => JSON.stringify(one[key]) === JSON.stringify(asked[0][key]));
  const part = (/** @type {Asked} */ one, /** @type {boolean} */ common) => Object.entries(one)
    .filter(([key, value]) => value !== undefined && !left.includes(key) && isCommon(key) === common).map(([key, value]) => `"${key}": ${literal(value)}`);
  const { params } = asked[0];
  const arm = `arm = pendularm.Arm(${[params.masses.length, ...Object.entries(params).map(([key, one]) => `${key}=${literal(one)}`)].join(", ")})`;
  return [
    `# pendularm: ${name}`, ...(note ? [`# ${note}`] : []), ...(isProgram ? [PROGRAM] : ["import pendularm"]), "",
    ...(isProgram ? [server(params.masses.length, service)] : [arm]),
    "common = {", ...part(asked[0], true).map((one) => `    ${one},`), "}", "asked = [", ...asked.map((one) => `    {${part(one, false).join(", ")}},`), "]",
    isProgram ? "runs = [ask({**common, **one}) for one in asked]\nserver.terminate()"
      : `runs = [pendularm.${service}(arm, **common, **one) for one in asked]`,
    `print(${computed.map((one) => JSON.stringify(one)).join(", ")}, sep="\\t")`, `for row in ${python}:`, '    print(*row, sep="\\t")', "",
  ].join("\n");
}

const PROGRAM = ["# The library has no delay, effort limits, friction and sensors. So the program in the wheel computes this.",
  "import json", "import socket", "import subprocess", "import sys", "from types import SimpleNamespace", "", "import numpy as np"].join("\n");

/** @param {number} links @param {string} service */
const server = (links, service) => `command = [sys.executable, "-m", "pendularm", "--bind", "127.0.0.1:0", "--links", "${links}", "--log", "off"]
server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
host, port = server.stdout.readline().split()[-1].rsplit(":", 1)
stream = socket.create_connection((host, int(port))).makefile("rw")

def ask(args):
    print(json.dumps({"op": "call_service", "service": "/study/${service}", "args": args}), file=stream, flush=True)
    answer = next(one for one in map(json.loads, stream) if one["op"] == "service_response")
    assert answer["result"], answer
    return SimpleNamespace(**{key: np.array(one) if isinstance(one, list) else one for key, one in answer["values"].items()})
`;

/** @type {Content | null} */
let shown = null;

/** Puts a button into the caption of a chart. @param {Element | null} caption @param {() => Content | null} content */
export function copyable(caption, content) {
  caption?.append(el("button", {
    type: "button", class: "copy no-print", title: "Copy this chart as a table or as Python", onclick: () => open(content()),
  }, "Copy"));
}

/** @param {Content | null} content */
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
