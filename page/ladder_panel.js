// Error against run time, live: all methods over a series of timesteps, on one named move of the active loop.
// Invariant: every point is a run of the runtime, and the result is removed as soon as its settings change.

import { Chart, DASHED, line, STRONG, TEXT, write } from "./chart.js";
import { copyable } from "./copy.js";
import { announce, byId, fillTable, setText } from "./dom.js";
import { busy, option, panel } from "./field.js";
import { duration, methodName, METHODS, shortName, significant } from "./format.js";
import { cheapest, errorText, moveOf, stamp, timestepsFor, uncertaintyOf } from "./ladder.js";
import { loopKey, questionOf } from "./question.js";
import { LogScale, powerOfTen } from "./scale.js";
import { known, state, unknown, watch } from "./store.js";
import { Series } from "./study.js";
import { Surface } from "./surface.js";
import { colors } from "./theme.js";

const WANTED = 1e-3; // rad: the accuracy in the sentence
const SECONDS = 2;
const INVITATION = "Runs this arm on one fixed move, with every method at eight timesteps, and compares each run with the exact motion.";

/** @typedef {import("./ladder.js").Rung} Rung */

let surface;
let said;
const seconds = option({ label: "duration", unit: "s", value: SECONDS });
const series = new Series();

export function startLadder() {
  copyable(byId("ladder").previousElementSibling, () => series.content());
  surface = new Surface(byId("ladder"), (one) => drawLadder(one, series.runs));
  said = panel(byId("ladder-form"), [seconds], [["Measure", () => busy(said.buttons[0], "Measuring…", measure), { type: "submit", class: "primary" }]]);
  setText(byId("ladder-text"), INVITATION);
  // The measurement belongs to another loop.
  watch(["links", "params", "gains", "period", "enabled"], () => { if (series.move && keyOf(series.move) !== keyOf(presentMove())) forget(INVITATION); });
}

/** The measured move of the active loop; null until its settings are known. */
export function presentMove() {
  const question = questionOf({ ...state, setpointKnown: true }); // the move has its own
  return question && moveOf(question);
}

/** What a measurement of a move depends on, as a text. */
export function keyOf(/** @type {import("./question.js").Question | null} */ move) {
  return move ? loopKey(move) : "";
}

/** Shows no figure, and ignores pending ones. @param {string} text the text in its place */
function forget(text) {
  series.forget();
  setText(byId("ladder-text"), text);
  byId("ladder-table").replaceChildren();
  surface.redraw();
}

async function measure() {
  const move = await known(presentMove);
  if (!move || state.connection !== "open") return said.show(unknown().status);
  said.show("");
  forget("");
  const length = seconds.number() ?? SECONDS;
  const refused = await series.measure(move, length, () => true, () => surface.redraw());
  if (refused === null) return;
  said.show(refused);
  describe(series.runs, stamp(move, length), timestepsFor(move.control_period));
}

/** @param {Rung[]} found @param {string} about the move @param {number[]} timesteps [s] */
function describe(found, about, timesteps) {
  const text = found.length > 0 ? `${inWords(found, cheapest(found, WANTED))} ${about}` : INVITATION;
  setText(byId("ladder-text"), text);
  if (found.length === 0) return;
  announce(text);
  fillTable(byId("ladder-table"), ["timestep", ...METHODS.map(([method], i) => [shortName(method), `method${i + 1}`])],
    timesteps.map((timestep) => [duration(timestep), ...METHODS.map(([method]) => cellOf(found, method, timestep))]));
}

/** @param {Rung[]} found @param {Rung[]} best the cheapest sufficient run of each method */
function inWords(found, best) {
  const controlled = found.some(({ sampling }) => sampling !== null);
  const meaning = controlled
    ? " Solid lines: error of the method. Dashed lines: distance from a controller without a hold. The table shows both [rad]: method + hold."
    : " The table shows the errors [rad].";
  if (best.length === 0) {
    return `No run ${controlled ? "keeps both errors" : "came"} within ${WANTED} rad${controlled ? "" : " of the exact motion"}.${meaning}`;
  }
  const cheap = best.reduce((a, b) => (b.wall < a.wall ? b : a));
  const uncertainty = uncertaintyOf(found);
  return `For ${WANTED} rad ${methodName(cheap.method)} costs least here: ${duration(cheap.wall)} of run time, at a timestep of `
    + `${duration(cheap.timestep)}.${meaning}`
    + (uncertainty === null ? "" : ` The reference itself is known to ${significant(uncertainty, 1)} rad.`);
}

function cellOf(found, method, timestep) {
  const one = found.find((rung) => rung.method === method && rung.timestep === timestep);
  return one ? errorText(one).replace(" + ", "\u00a0+\u00a0") : "–"; // only other texts may break
}

const ROOM = { left: 62, right: 14, top: 30, bottom: 36, font: TEXT };
const CROSS = 4;
const NARROW = 360; // px

/** @param {import("./surface.js").Surface} surface @param {Rung[]} found */
export function drawLadder(surface, found) {
  const { context, width, height } = surface;
  const runs = found.filter(({ wall }) => wall > 0);
  const errors = runs.flatMap(({ error, sampling }) => [error ?? 0, sampling ?? 0]).filter((error) => error > 0);
  if (errors.length === 0) return write(context, "no measurement yet", width / 2, height / 2, "center");
  const [across, up] = [LogScale.around(runs.map(({ wall }) => wall), 6, duration), LogScale.around(errors, 8, powerOfTen)];
  const chart = new Chart(surface, across, up, ROOM);
  chart.frame({ across: "run time", up: "error [rad]" });
  METHODS.forEach(([method], i) => {
    const color = colors.methods[i];
    const own = runs.filter((one) => one.method === method);
    const points = (/** @type {"error" | "sampling"} */ key) => own.flatMap((one) => (Number(one[key]) > 0 ? [[one.wall, Number(one[key])]] : []));
    chart.path(points("error"), color);
    for (const [wall, error] of points("error")) chart.dot(wall, error, color, 3);
    chart.path(points("sampling"), color, { dash: DASHED });
    for (const { wall, divergedAt } of own) {
      if (divergedAt === null) continue;
      const [x, y] = [chart.x(wall), chart.top];
      line(context, x - CROSS, y - CROSS, x + CROSS, y + CROSS, color, 1.75);
      line(context, x - CROSS, y + CROSS, x + CROSS, y - CROSS, color, 1.75);
    }
    // The methods in their colours, side by side, so that names do not overlap.
    const from = width < NARROW ? 8 : chart.left;
    chart.words(shortName(method), from + (i * (chart.right - from)) / METHODS.length, 10, "left", color, STRONG);
  });
}
