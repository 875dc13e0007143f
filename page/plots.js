// @ts-check
// The plots' panel: four strip charts and the phase plot, what they show, their legends and their common cursor.
// Invariant: pausing the plots stops only the drawing; recording goes on.

import { announce } from "./announce.js";
import { cursor, hover } from "./cursor.js";
import { byId, el, setText } from "./dom.js";
import { short, significant } from "./format.js";
import { onFrame, wake } from "./frames.js";
import { PhasePlot } from "./phase_plot.js";
import { shown as pose } from "./playback.js";
import { energyName } from "./policy.js";
import { EFFORT, ENERGY, KINETIC, LOAD, POSITION, POTENTIAL, SETPOINT, TIME, VELOCITY, firstAfter, record } from "./history.js";
import { state, watch } from "./store.js";
import { StripChart } from "./strip_chart.js";
import { colors, onTheme } from "./theme.js";

/** No more than this is shown of an arm that has diverged: the blow-up is the end of it [s]. */
const BLOW_UP_SECONDS = 2;

const shown = [true, true, true];
let charts = [];
let span = 10; // s
let frozenAt = NaN; // simulation time at which the plots were paused
let drawnVersion = -1;
let stale = true;
let legends = [];

export function startPlots() {
  const joint = (column) => ({ column, perJoint: true });
  charts = [
    new StripChart(byId("plot-position"), [joint(POSITION), { ...joint(SETPOINT), dashed: true }], 0.2, 300),
    new StripChart(byId("plot-velocity"), [joint(VELOCITY)], 0.2, 300),
    new StripChart(byId("plot-effort"), [joint(EFFORT), { ...joint(LOAD), dashed: true }], 1, 5000),
    new StripChart(byId("plot-energy"), [
      { column: KINETIC, perJoint: false, color: "kinetic" }, { column: POTENTIAL, perJoint: false, color: "potential" },
      { column: ENERGY, perJoint: false },
    ], 0.1, 5000),
    new PhasePlot(byId("plot-phase")),
  ];
  for (const one of charts) one.surface.onResize = redraw;
  for (const one of charts.slice(0, 4)) {
    const { canvas } = one.surface;
    canvas.addEventListener("pointermove", (event) => hover(one.timeAt(event.offsetX)));
    canvas.addEventListener("pointerleave", () => hover(NaN));
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return; // without it the wheel scrolls
      event.preventDefault();
      zoomPlots(event.deltaY < 0 ? 1 : -1);
    }, { passive: false });
  }
  onTheme(redraw);
  onFrame(drawPlots);
  watch("cursor", () => { redraw(); showValues(); });
  watch("playback", () => { if (pose.playing) return; redraw(); showValues(); });
  watch("links", makeLegends);
  let diverged = false;
  watch("diagnostics", (report) => {
    if ((report.state === "diverged") !== diverged) redraw();
    diverged = report.state === "diverged";
  });
  byId("plot-span").addEventListener("change", (event) => {
    span = Number(event.target.value);
    redraw();
  });
  byId("plot-pause").addEventListener("click", togglePlots);
  byId("plot-fix").addEventListener("click", toggleScales);
}

export function togglePlots() {
  const paused = Number.isNaN(frozenAt);
  frozenAt = paused ? newest() : NaN;
  press("plot-pause", paused, paused ? "Resume" : "Pause");
  announce(paused ? "Plots paused." : "Plots running.");
  redraw();
}

/** Shows less time for 1, more for -1. */
export function zoomPlots(way) {
  const choice = byId("plot-span");
  choice.selectedIndex = Math.min(choice.length - 1, Math.max(0, choice.selectedIndex - way));
  choice.dispatchEvent(new Event("change"));
}

function toggleScales() {
  const kept = byId("plot-fix").getAttribute("aria-pressed") !== "true";
  for (const one of charts) for (const axis of [one.axis, one.across, one.up]) if (axis) axis.fixed = kept;
  press("plot-fix", kept, kept ? "Fixed" : "Fix");
  redraw();
}

function press(id, pressed, text) {
  byId(id).setAttribute("aria-pressed", String(pressed));
  setText(byId(id), text);
}

function newest() {
  return record.length > 0 ? record.data[record.last() + TIME] : 0;
}

function shownSpan() {
  return state.diagnostics?.state === "diverged" && pose.live ? Math.min(span, BLOW_UP_SECONDS) : span;
}

/** The right edge of the plots: now, where they were paused, or so that what is looked at of the recording is within. */
function edge() {
  const end = Number.isNaN(frozenAt) ? newest() : frozenAt;
  if (pose.live || pose.time > end - span) return end;
  return pose.time + span / 2;
}

export function redraw() {
  stale = true;
  wake();
}

/** Draws the lines as they are now, if anything has moved since. */
export function movePlots() {
  const moves = pose.playing || (pose.live && drawnVersion !== state.version && Number.isNaN(frozenAt));
  drawnVersion = state.version;
  if (moves) redraw();
}

/** A chip per joint switches its lines on and off, and shows its colour; values stand in the legends. */
function makeLegends(links) {
  byId("plot-joints").replaceChildren("joints", ...Array.from({ length: links }, (_, joint) => {
    const box = el("input", { type: "checkbox", "aria-label": `joint ${joint + 1}`, onchange: () => { shown[joint] = box.checked; redraw(); } });
    box.checked = shown[joint];
    return el("label", { class: `chip joint${joint + 1}` }, box, ` ${joint + 1}`);
  }));
  /** @type {[string, number, string, number][]} */
  const rows = [
    ["legend-position", POSITION, "rad", 3],
    ["legend-velocity", VELOCITY, "rad/s", 3],
    ["legend-effort", EFFORT, "N m", 2],
  ];
  legends = rows.map(([id, column, unit, digits]) => {
    const values = Array.from({ length: links }, (_, joint) => el("span", { class: `value joint${joint + 1}` }));
    byId(id).replaceChildren(...values, el("span", { class: "unit" }, unit));
    return { column, digits, values };
  });
}

/** Writes the values at the cursor, or the present ones. */
export function showValues() {
  if (record.length === 0) return;
  const at = cursor();
  const row = Number.isFinite(at) ? record.at(Math.min(firstAfter(at), record.length - 1)) : record.last();
  for (const { column, digits, values } of legends) {
    for (let joint = 0; joint < values.length; joint += 1) {
      setText(values[joint], short(record.data[row + column + joint], digits));
    }
  }
  setText(byId("legend-energy-value"), short(record.data[row + ENERGY], 3));
  setText(byId("legend-drift"), significant(record.data[row + ENERGY] - reference(), 3));
  setText(byId("legend-drift-name"), energyName(state));
}

/** Energy at the last reset, change of parameters or switching of PID [J]: the drift is measured from it. */
function reference() {
  const { diagnostics } = state;
  return diagnostics ? diagnostics.energy - diagnostics.energy_drift : NaN;
}

function drawPlots() {
  if (!stale) return false;
  stale = false;
  const now = edge();
  const seconds = shownSpan();
  charts[3].reference = reference();
  for (const chart of charts) chart.draw(now, seconds, state.links, shown, cursor());
  return false;
}

/** Draws every plot, one below the other, on a context of `width`; gives the height. For pictures that are saved. */
export function drawAll(context, width) {
  const [gap, title] = [8, 18];
  const names = ["Position [rad]", "Velocity [rad/s]", "Effort [N m]", "Energy [J]", "Velocity [rad/s] over position [rad]"];
  let top = 0;
  charts.forEach((chart, k) => {
    const { height } = chart.surface;
    context.save();
    context.translate(0, top);
    context.font = "600 12px system-ui, sans-serif";
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillStyle = colors.ink;
    context.fillText(names[k], 8, 13);
    context.translate(0, title);
    chart.drawOn(context, width, height || 120, edge(), shownSpan(), state.links, shown, NaN);
    context.restore();
    top += title + (height || 120) + gap;
  });
  redraw();
  return top;
}

/** How high `drawAll` draws. */
export function heightOfAll() {
  return charts.reduce((sum, { surface }) => sum + (surface.height || 120) + 26, 0);
}
