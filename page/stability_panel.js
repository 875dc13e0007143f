// The limits of the timestep. Each method's button has its limit. The panel Stability has the reason, a map, and a small push of
// the active loop, step by step. The map shows where the loop is stable, gains over the time for which a torque is held: the
// timestep or, if it is longer, the control period. A dot is the present point. A click or an arrow key moves it, and with it the settings.
// Invariant: all limits are the study's answers for the active loop, and an outdated one is never shown. The boundary is drawn
// as far as it is known. A click sets the shown values. The bars are a run of the runtime at the present timestep.

import { beginAnew } from "./actions.js";
import { Chart, drawBars, drawMap } from "./chart.js";
import { copyable } from "./copy.js";
import { shrinks } from "./course.js";
import { byId, el, setText } from "./dom.js";
import { refusal } from "./field.js";
import { duration, methodName, METHODS } from "./format.js";
import { robotForm } from "./held_limit.js";
import { latestOnly } from "./latest.js";
import { answerInForce, factorOf, limitInForce, limitText, scaled, whyText } from "./policy.js";
import { fromRest, heldTime, isFree, questionOf, stepsPerUpdate } from "./question.js";
import { change } from "./runtime.js";
import { LogScale } from "./scale.js";
import { known, LOOP, settingsKnown, state, unknown, watch } from "./store.js";
import { Border, deviation, LOOKS } from "./study.js";
import { Surface } from "./surface.js";
import { openTab } from "./views.js";

const ROWS = 17; // rows of gains with limits, the present ones in the middle
const WIDEST = 16; // largest and smallest multiple of the present gains
const FINE = 1.1; // one arrow key

const factors = new LogScale(1 / WIDEST, WIDEST, [1 / 16, 1 / 4, 1, 4, 16].map((one) => [one, one < 1 ? `1/${1 / one}` : `${one}×`]));
const times = new LogScale(1e-4, 0.1); // the held time [s]

let map;
let said;
const border = new Border(factors, ROWS, () => map.redraw());
let anchor = /** @type {import("./question.js").Gains | null} */ (null); // as `baseGains` left it
let wish = /** @type {{time: number, factor: number} | null} */ (null); // the chosen point, until the runtime has answered

export function startStability() {
  startLimits();
  byId("stability").append(robotForm());
  const canvas = byId("map");
  map = new Surface(canvas, drawStability);
  said = refusal(canvas);
  byId("map-text").after(said.element);
  watch(["integrator", "gains", "params", "period", "setpoint", "limits", "enabled", "tab", "links"], () => map.redraw());
  canvas.addEventListener("click", (event) => goTo(event.offsetX, event.offsetY));
  canvas.addEventListener("keydown", byArrows);
  copyable(canvas.previousElementSibling, () => border.content("Where the loop is stable"));
  copyable(byId("push-bars").previousElementSibling, () => pushed);
  bars = new Surface(byId("push-bars"), (surface) => drawBars(surface, heights, state.enabled ? "measurement of the controller" : "step"));
  watch([...LOOP, "tab", "view"], lookAtPush);
}

/** Whether the control law runs less often than the steps. */
function isSampled() {
  return state.integrator && stepsPerUpdate(state) > 1;
}

/** The base gains of the map's scale. They do not change while the arm's gains are a multiple of them, so the dot moves and the border stays. */
function baseGains() {
  if (!(factorOf(state.gains, anchor) > 0)) anchor = state.gains;
  return anchor;
}

/** Asks for the border of the loop once the controller is on. The timestep does not move it. */
function askBorder() {
  const question = questionOf({ ...state, enabled: true });
  if (!question) return;
  const base = baseGains();
  const common = { ...question, control_period: 0, timestep: 0.001, q: question.setpoint, qd: question.qd.map(() => 0) };
  border.ask((factor) => ({ ...common, gains: scaled(base, factor) }), isSampled() ? { limit: "control_period_limit" }
    : { limit: "timestep_limit_held", continuous: "timestep_limit_continuous" });
}

function chartOf(surface) {
  return new Chart(surface, times, factors, { right: 10, top: 8, bottom: 36 });
}

function drawStability() {
  askBorder();
  const chart = chartOf(map);
  chart.frame({ across: isSampled() ? "control period" : "timestep", grid: false });
  const factor = factorOf(state.gains, baseGains());
  if (state.integrator && state.gains) drawMap(chart, border.rows, heldTime(state), factor > 0 ? factor : 1);
  describeMap();
}

function describeMap() {
  const row = border.rows[Math.round(factors.place(factorOf(state.gains, baseGains())) * (ROWS - 1))];
  if (!row || !state.integrator) return;
  setText(byId("map-value"), `at ${duration(heldTime(state))}`);
  const lines = isSampled() ? `Line: limit of the control period, ${limitText(row.limit)} with these gains.`
    : `Solid line: limit of ${methodName(state.integrator.method)}, ${limitText(row.limit)} with these gains, for a controller that acts at every step. `
      + `Dashed line: limit of a controller without a hold, ${limitText(row.continuous)}.`;
  const clock = isSampled() ? "control period" : "timestep";
  setText(byId("map-text"), `${lines} The dot is the arm${state.enabled ? "" : " once the controller is on"}. Click to set gains and ${clock}.`);
}

function goTo(left, top) {
  const chart = chartOf(map);
  const place = (left - chart.left) / (chart.right - chart.left);
  const rise = (chart.bottom - top) / (chart.bottom - chart.top);
  if (place < 0 || place > 1 || rise < 0 || rise > 1) return;
  moveTo(() => ({ time: times.value(place), factor: factors.value(rise) }));
}

function byArrows(event) {
  const step = { ArrowLeft: [1 / FINE, 1], ArrowRight: [FINE, 1], ArrowUp: [1, FINE], ArrowDown: [1, 1 / FINE] }[event.key];
  if (!step) return;
  event.preventDefault();
  moveTo(({ time, factor }) => ({ time: times.moved(time, step[0]), factor: factors.moved(factor, step[1]) }));
}

/**
 * Moves the dot to another point once the settings are known. A held key repeats faster than the runtime answers, so it moves on from the last chosen
 * point. A diverged arm restarts there, because otherwise the new settings would show no effect.
 * @param {(point: {time: number, factor: number}) => {time: number, factor: number}} next
 */
async function moveTo(next) {
  if (await known(settingsKnown) === null) return said.show(unknown().status);
  const present = factorOf(state.gains, baseGains());
  const point = next(wish ?? { time: heldTime(state), factor: present });
  wish = point;
  const short = (value) => Number(value.toPrecision(3));
  const changes = [];
  if (Math.abs(Math.log(point.factor / present)) > 0.02) {
    const gains = Object.entries(scaled(baseGains(), point.factor)).map(([key, values]) => [key, values.map(short)]);
    changes.push(change("gains", Object.fromEntries(gains)));
  }
  if (point.time !== heldTime(state)) {
    changes.push(isSampled() ? change("period", { period: short(point.time) }) : change("integrator", { timestep: short(point.time) }));
  }
  const answers = await Promise.all(changes);
  if (wish === point) wish = null;
  said.show(answers.find(({ result }) => !result)?.status ?? "");
  if (state.diverged) beginAnew();
}

const ASK_MS = 60;

let bars;
let heights = /** @type {number[]} */ ([]);
let pushed = /** @type {import("./copy.js").Content | null} */ (null);
let pushAsked = "";

function lookAtPush() {
  const present = questionOf(state);
  if (!present || state.tab !== "stability" || state.view !== "workbench") return;
  const loop = fromRest(present, answerInForce(state)?.equilibrium ?? present.setpoint);
  const key = JSON.stringify(loop);
  if (key === pushAsked) return;
  pushAsked = key;
  push({ loop, key, steps: state.enabled ? stepsPerUpdate(state) : 1 });
}

const push = latestOnly(async ({ loop, key, steps }) => {
  const every = steps * loop.timestep;
  const found = await deviation(loop, loop.q, every);
  if (key !== pushAsked || !found) return;
  pushed = found.content;
  heights = found.bars;
  const isOff = isFree(loop.gains);
  const outcome = isOff ? "nothing damps the push"
    : `the push ${shrinks(heights) ? "shrinks" : "does not shrink"} over ${LOOKS} ${steps > 1 ? "measurements" : "steps"}`;
  setText(byId("push-text"), `${isOff ? "The free arm" : "The controller’s loop"} at `
    + `${steps > 1 ? "a control period of " : ""}${duration(every)}: ${outcome}.`);
  bars.redraw();
}, ASK_MS);

/** @type {Map<string, HTMLElement>} */
const labels = new Map();

function startLimits() {
  watch(LOOP, showLimits);
  byId("why").addEventListener("click", () => {
    openTab("stability");
    byId("why-text").scrollIntoView({ block: "nearest" });
  });
}

/** The element with the limit of `method`. @param {string} method */
export function limitLabel(method) {
  const label = el("small", { class: "limit" }, "…");
  labels.set(method, label);
  return label;
}

function showLimits() {
  for (const [method, label] of labels) setText(label, limitText(limitInForce(state, method).limit));
  const why = whyText(state);
  setText(byId("why-text"), why);
  // It stays visible while limits are computed again, so that a click still works.
  if (METHODS.every(([method]) => answerInForce(state, method)) || !questionOf(state)) byId("why").hidden = why === "";
}
