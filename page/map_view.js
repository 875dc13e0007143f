// @ts-check
// The stability map: gains against timestep, where the loop with held efforts is stable and where not, the present point in it.
// A click goes there; so do the arrow keys.
// Invariant: the boundary is that of the arm's own settings, drawn as far as it is known; a click sends what it shows.

import { beginAnew } from "./actions.js";
import { byId, setText } from "./dom.js";
import { duration, methodName } from "./format.js";
import { onFrame, wake } from "./frames.js";
import { answerInForce } from "./policy.js";
import { factorOf, scaled } from "./gains.js";
import { setGains, setIntegrator, stability } from "./runtime.js";
import { LogScale } from "./scale.js";
import { state, watch } from "./store.js";
import { Surface } from "./surface.js";
import { colors, onTheme } from "./theme.js";

const ROWS = 17; // gains whose limits are found, the present ones in the middle
const LEFT = 46;
const RIGHT = 10;
const TOP = 8;
const BOTTOM = 32;
/** Present gains times this much, and this little. */
const WIDEST = 16;
const FINE = 1.1; // one arrow key

const factors = new LogScale(1 / WIDEST, WIDEST);
const timesteps = new LogScale(1e-4, 0.1);

let surface;
let asked = ""; // the settings that `rows` are about
let rows = []; // { held, continuous } [s] for each factor, as far as they are known
/** Gains that the map's scale begins from: they stay while the arm's own are a multiple of them, so that the dot moves and the border stays. */
let anchor = null;
let stale = true;

export function startMap() {
  const canvas = byId("map");
  surface = new Surface(canvas, redraw);
  onTheme(redraw);
  for (const key of ["integrator", "gains", "params", "setpoint", "stability", "enabled", "tab", "links"]) watch(key, redraw);
  canvas.addEventListener("click", (event) => goTo(event.offsetX, event.offsetY));
  canvas.addEventListener("keydown", arrows);
  onFrame(draw);
}

function redraw() {
  stale = true;
  wake();
}

/** Settings that move the boundary; the timestep does not. */
function settings() {
  const { integrator, gains, params, setpoint, links } = state;
  if (!integrator || !gains || !params || gains.kp.length !== links || params.masses.length !== links) return null;
  const pose = (state.enabled && answerInForce(state)?.equilibrium) || Array.from(setpoint.subarray(0, links));
  if (!(factorOf(gains, anchor) > 0)) anchor = gains;
  return { method: integrator.method, gains: anchor, params, pose };
}

/** Asks the study for the border, a row at a time; a new question ends the old one. */
async function ask() {
  const present = settings();
  if (!present) return;
  const key = JSON.stringify(present);
  if (key === asked) return;
  asked = key;
  rows = [];
  const { params, method: integrator, pose: setpoint } = present;
  while (rows.length < ROWS) {
    const factor = factors.value(rows.length / (ROWS - 1));
    const { result, values } = await stability({ params, integrator, setpoint, gains: scaled(present.gains, factor), control_period: 0 });
    if (asked !== key) return;
    if (!result) {
      asked = ""; // asked again at the next news
      return;
    }
    rows.push({ factor, held: values.timestep_limit_held ?? Infinity, continuous: values.timestep_limit_continuous ?? Infinity });
    redraw();
  }
}

function draw() {
  if (!stale || state.tab !== "stability" || surface.width === 0) return false;
  stale = false;
  ask();
  const { context, width, height } = surface;
  surface.clear();
  drawFrame(context, width, height);
  if (rows.length > 1) drawBoundaries(context, width, height);
  drawPoint(context);
  describe();
  return false;
}

function x(timestep) {
  return LEFT + timesteps.place(timestep) * (surface.width - LEFT - RIGHT);
}

function y(factor) {
  return surface.height - BOTTOM - factors.place(factor) * (surface.height - TOP - BOTTOM);
}

function within(timestep) {
  return Math.min(timesteps.high, Math.max(timesteps.low, timestep));
}

function drawFrame(context, width, height) {
  // Only as far up as the limits are known: points beyond are neither stable nor unstable.
  const known = rows.length > 0 ? y(rows.at(-1).factor) : height - BOTTOM;
  context.fillStyle = colors.unstable;
  context.fillRect(LEFT, known, width - LEFT - RIGHT, height - BOTTOM - known);
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = colors.muted;
  context.textAlign = "center";
  for (const tick of [1e-4, 1e-3, 1e-2, 1e-1]) context.fillText(duration(tick), Math.min(x(tick), width - 22), height - 18);
  context.fillText("timestep", LEFT + (width - LEFT - RIGHT) / 2, height - 4);
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const factor of [1 / 16, 1 / 4, 1, 4, 16]) context.fillText(factor < 1 ? `1/${1 / factor}` : `${factor}×`, LEFT - 6, y(factor));
  context.textBaseline = "alphabetic";
}

function drawBoundaries(context, width, height) {
  context.fillStyle = colors.stable;
  context.beginPath();
  context.moveTo(LEFT, y(rows[0].factor));
  for (const { factor, held } of rows) context.lineTo(x(within(held)), y(factor));
  context.lineTo(LEFT, y(rows.at(-1).factor));
  context.closePath();
  context.fill();
  for (const name of ["held", "continuous"]) {
    context.strokeStyle = colors.ink;
    context.lineWidth = name === "held" ? 2 : 1.25;
    context.setLineDash(name === "held" ? [] : [5, 4]);
    context.beginPath();
    for (const row of rows) context.lineTo(x(within(row[name])), y(row.factor));
    context.stroke();
  }
  context.setLineDash([]);
  context.strokeStyle = colors.muted;
  context.lineWidth = 1;
  context.strokeRect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
  context.font = "600 12px system-ui, sans-serif";
  context.fillStyle = colors.ink;
  context.textAlign = "left";
  context.fillText("stable", LEFT + 8, y(1) - 8); // the very low gains of the lower edge hold the arm at no timestep
  context.textAlign = "right";
  context.fillText("unstable", width - RIGHT - 8, TOP + 16);
}

function drawPoint(context) {
  if (!state.integrator || !state.gains) return;
  const { timestep } = state.integrator;
  const factor = factorOf(state.gains, anchor);
  context.fillStyle = colors.accent;
  context.strokeStyle = colors.panel;
  context.lineWidth = 2;
  context.beginPath();
  context.arc(x(within(timestep)), y(factor > 0 ? factor : 1), 6, 0, 2 * Math.PI);
  context.fill();
  context.stroke();
}

function describe() {
  const row = rows[Math.round(factors.place(factorOf(state.gains, anchor)) * (ROWS - 1))];
  if (!row || !state.integrator) return;
  const words = (limit) => (limit === 0 ? "no timestep" : limit === Infinity ? "any timestep" : `up to ${duration(limit)}`);
  setText(byId("map-value"), `at ${duration(state.integrator.timestep)}`);
  setText(byId("map-text"), `Solid line: ${methodName(state.integrator.method)} with efforts held over each step, ${words(row.held)} with these gains; dashed: with control in every stage, ${words(row.continuous)}. `
    + `Higher gains need a smaller timestep, and gains that are too low hold the arm at none. The dot is the arm${state.enabled ? "" : " once the controller is on"}; click to go elsewhere.`);
}

function goTo(left, top) {
  if (!state.integrator || !state.gains || !anchor) return;
  const place = (left - LEFT) / (surface.width - LEFT - RIGHT);
  const rise = (surface.height - BOTTOM - top) / (surface.height - TOP - BOTTOM);
  if (place < 0 || place > 1 || rise < 0 || rise > 1) return;
  move(timesteps.value(place), factors.value(rise));
}

/** An arm that has diverged begins anew there: it could not be seen otherwise whether the place is a better one. */
async function move(timestep, factor) {
  const short = (value) => Number(value.toPrecision(3));
  const gains = scaled(anchor, factor);
  const changes = [];
  if (Math.abs(Math.log(factor / factorOf(state.gains, anchor))) > 0.02) changes.push(setGains({ kp: gains.kp.map(short), ki: gains.ki.map(short), kd: gains.kd.map(short) }));
  if (timestep !== state.integrator.timestep) changes.push(setIntegrator({ timestep: short(timestep) }));
  await Promise.all(changes);
  if (state.diagnostics?.state === "diverged") beginAnew();
}

function arrows(event) {
  const step = { ArrowLeft: [1 / FINE, 1], ArrowRight: [FINE, 1], ArrowUp: [1, FINE], ArrowDown: [1, 1 / FINE] }[event.key];
  if (!step || !state.integrator || !state.gains || !anchor) return;
  event.preventDefault();
  const factor = factorOf(state.gains, anchor) * step[1];
  move(within(state.integrator.timestep * step[0]), Math.min(WIDEST, Math.max(1 / WIDEST, factor)));
}
