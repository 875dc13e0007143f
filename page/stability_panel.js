// The limits of the timestep. Each method's button has its limit. The panel Stability has the reason, a map, and a small push of
// the active loop, step by step. The map shows where the loop is stable, gains over timestep, with the present point as a dot.
// A click or an arrow key moves the dot, and with it the settings.
// Invariant: all limits are the study's answers for the active loop, and an outdated one is never shown. The boundary is drawn
// as far as it is known. A click sets the shown values. The bars are a run of the runtime at the present timestep.

import { beginAnew } from "./actions.js";
import { Chart, drawBars, drawMap } from "./chart.js";
import { shrinks } from "./course.js";
import { byId, el, setText } from "./dom.js";
import { duration, methodName, METHODS } from "./format.js";
import { latestOnly } from "./latest.js";
import { answerInForce, factorOf, isFree, limitInForce, limitText, question, scaled, stepsPerUpdate, whyText } from "./policy.js";
import { setGains, setIntegrator } from "./runtime.js";
import { LogScale } from "./scale.js";
import { LOOP, state, watch } from "./store.js";
import { climbRows, deviation, LOOKS } from "./study.js";
import { Surface } from "./surface.js";
import { openTab } from "./views.js";

const ROWS = 17; // rows of gains with limits, the present ones in the middle
/** Largest and smallest multiple of the present gains. */
const WIDEST = 16;
const FINE = 1.1; // one arrow key

const factors = new LogScale(1 / WIDEST, WIDEST, [1 / 16, 1 / 4, 1, 4, 16].map((one) => [one, one < 1 ? `1/${1 / one}` : `${one}×`]));
const timesteps = new LogScale(1e-4, 0.1);

let map;
let chart;
let mapAsked = ""; // the settings of `rows`
/** Limits with a hold and with control in every stage [s], as far as they are known. @type {import("./chart.js").Row[]} */
let rows = [];
/** The base gains of the map's scale. They do not change while the arm's gains are a multiple of them, so the dot moves and the border stays. */
let anchor = null;

export function startStability() {
  startLimits();
  const canvas = byId("map");
  map = new Surface(canvas, drawStability);
  watch(["integrator", "gains", "params", "setpoint", "limits", "enabled", "tab", "links"], () => map.redraw());
  canvas.addEventListener("click", (event) => goTo(event.offsetX, event.offsetY));
  canvas.addEventListener("keydown", byArrows);
  bars = new Surface(byId("push-bars"), (surface) => drawBars(surface, heights, state.enabled ? "measurement of the controller" : "step"));
  watch([...LOOP, "tab", "view"], lookAtPush);
}

/** Settings that move the boundary; the timestep does not. */
function mapSettings() {
  const { integrator, gains, params, setpoint, links } = state;
  if (!integrator || gains?.kp.length !== links || params?.masses.length !== links) return null;
  const pose = (state.enabled && answerInForce(state)?.equilibrium) || Array.from(setpoint.subarray(0, links));
  if (!(factorOf(gains, anchor) > 0)) anchor = gains;
  return { method: integrator.method, gains: anchor, params, pose };
}

/** Asks the study for the border. A new request ends the old one. */
async function askBorder() {
  const present = mapSettings();
  if (!present) return;
  const key = JSON.stringify(present);
  if (key === mapAsked) return;
  mapAsked = key;
  rows = [];
  const { params, method: integrator, pose: setpoint } = present;
  const ask = (factor) => ({ params, integrator, setpoint, gains: scaled(present.gains, factor) });
  await climbRows(factors, ROWS, ask, () => mapAsked === key, (factor, values) => {
    rows.push({ factor, limit: values.timestep_limit_held ?? Infinity, continuous: values.timestep_limit_continuous ?? Infinity });
    map.redraw();
  });
  if (mapAsked === key && rows.length < ROWS) mapAsked = ""; // asked again at the next message
}

function drawStability() {
  askBorder();
  chart = new Chart(map, timesteps, factors, { right: 10, top: 8, bottom: 36 });
  chart.frame({ across: "timestep", grid: false });
  const factor = factorOf(state.gains, anchor);
  if (state.integrator && state.gains) drawMap(chart, rows, state.integrator.timestep, factor > 0 ? factor : 1);
  describeMap();
}

function describeMap() {
  const row = rows[Math.round(factors.place(factorOf(state.gains, anchor)) * (ROWS - 1))];
  if (!row || !state.integrator) return;
  setText(byId("map-value"), `at ${duration(state.integrator.timestep)}`);
  setText(byId("map-text"), `Solid line: limit of ${methodName(state.integrator.method)}, ${limitText(row.limit)} with these gains. Dashed line: limit of a controller without a hold, ${limitText(row.continuous)}. `
    + `The map is for a controller that acts at every step. The dot is the arm${state.enabled ? "" : " once the controller is on"}. Click to set gains and timestep.`);
}

function goTo(left, top) {
  if (!state.integrator || !state.gains || !anchor || !chart) return;
  const place = (left - chart.left) / (chart.right - chart.left);
  const rise = (chart.bottom - top) / (chart.bottom - chart.top);
  if (place < 0 || place > 1 || rise < 0 || rise > 1) return;
  moveTo(timesteps.value(place), factors.value(rise));
}

/** A diverged arm restarts there, because otherwise the new settings would show no effect. */
async function moveTo(timestep, factor) {
  const short = (value) => Number(value.toPrecision(3));
  const gains = scaled(anchor, factor);
  const changes = [];
  if (Math.abs(Math.log(factor / factorOf(state.gains, anchor))) > 0.02) changes.push(setGains({ kp: gains.kp.map(short), ki: gains.ki.map(short), kd: gains.kd.map(short) }));
  if (timestep !== state.integrator.timestep) changes.push(setIntegrator({ timestep: short(timestep) }));
  await Promise.all(changes);
  if (state.diverged) beginAnew();
}

function byArrows(event) {
  const step = { ArrowLeft: [1 / FINE, 1], ArrowRight: [FINE, 1], ArrowUp: [1, FINE], ArrowDown: [1, 1 / FINE] }[event.key];
  if (!step || !state.integrator || !state.gains || !anchor) return;
  event.preventDefault();
  moveTo(timesteps.moved(state.integrator.timestep, step[0]), factors.moved(factorOf(state.gains, anchor), step[1]));
}

const ASK_MS = 60;

let bars;
let heights = /** @type {number[]} */ ([]);
let pushAsked = "";

function lookAtPush() {
  const loop = question(state);
  if (!loop || state.tab !== "stability" || state.view !== "workbench") return;
  const key = JSON.stringify([loop, state.integrator]);
  if (key === pushAsked) return;
  pushAsked = key;
  push({ loop, key });
}

const push = latestOnly(async ({ loop, key }) => {
  const { method: integrator, timestep } = state.integrator;
  const rest = answerInForce(state)?.equilibrium ?? loop.setpoint ?? new Array(state.links).fill(0);
  const steps = state.enabled ? stepsPerUpdate(state) : 1;
  const found = await deviation({ setpoint: rest, ...loop, integrator, timestep }, rest, steps * timestep);
  if (key !== pushAsked || !found) return;
  heights = found;
  const outcome = isFree(loop.gains) ? "nothing damps the push"
    : `the push ${shrinks(heights) ? "shrinks" : "does not shrink"} over ${LOOKS} ${steps > 1 ? "measurements" : "steps"}`;
  setText(byId("push-text"), `${state.enabled ? "The controller’s loop" : "The free arm"} at ${steps > 1 ? "a control period of " : ""}${duration(steps * timestep)}: ${outcome}.`);
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
  if (METHODS.every(([method]) => answerInForce(state, method)) || !question(state)) byId("why").hidden = why === "";
}
