// The plots' panel: four strip charts and the phase plot, what they show, their legends, pause and CSV.
// Invariant: pausing the plots stops only the drawing; recording goes on.

import { announce } from "./announce.js";
import { downloadCsv } from "./csv.js";
import { byId, el, setText } from "./dom.js";
import { fixed, significant } from "./format.js";
import { EFFORT, ENERGY, LOAD, POSITION, SETPOINT, TIME, VELOCITY, record } from "./recorder.js";
import { PhasePlot } from "./phase_plot.js";
import { state, watch } from "./store.js";
import { StripChart } from "./strip_chart.js";
import { onTheme } from "./theme.js";

const shown = [true, true, true];
let charts = [];
let phase;
let span = 10; // s
let frozenAt = NaN; // simulation time at which the plots were paused
let drawnVersion = -1;
let stale = true;
let legends = [];

export function startPlots() {
  charts = [
    new StripChart(byId("plot-position"), [{ column: POSITION, perJoint: true }, { column: SETPOINT, perJoint: true, dashed: true }], 0.2),
    new StripChart(byId("plot-velocity"), [{ column: VELOCITY, perJoint: true }], 0.2),
    new StripChart(byId("plot-effort"), [{ column: EFFORT, perJoint: true }, { column: LOAD, perJoint: true, dashed: true }], 1),
    new StripChart(byId("plot-energy"), [{ column: ENERGY, perJoint: false }], 0.1),
  ];
  phase = new PhasePlot(byId("plot-phase"));
  for (const one of [...charts, phase]) one.surface.onResize = redraw;
  onTheme(redraw);
  byId("plot-span").addEventListener("change", (event) => {
    span = Number(event.target.value);
    redraw();
  });
  byId("plot-pause").addEventListener("click", togglePlots);
  byId("plot-csv").addEventListener("click", () => downloadCsv(state.links));
  watch("links", makeLegends);
}

export function togglePlots() {
  const paused = Number.isNaN(frozenAt);
  frozenAt = paused ? newest() : NaN;
  const button = byId("plot-pause");
  button.setAttribute("aria-pressed", String(paused));
  setText(button, paused ? "Resume" : "Pause");
  announce(paused ? "Plots paused." : "Plots running.");
  redraw();
}

function newest() {
  return record.length > 0 ? record.data[record.last() + TIME] : 0;
}

export function redraw() {
  stale = true;
}

/** A chip per joint switches its lines on and off, and shows its colour; values stand in the legends. */
function makeLegends(links) {
  byId("plot-joints").replaceChildren(...Array.from({ length: links }, (_, joint) => {
    const box = el("input", { type: "checkbox", onchange: () => { shown[joint] = box.checked; redraw(); } });
    box.checked = shown[joint];
    return el("label", { class: `chip joint${joint + 1}` }, box, ` joint ${joint + 1}`);
  }));
  legends = [
    ["legend-position", POSITION, "rad", 3],
    ["legend-velocity", VELOCITY, "rad/s", 3],
    ["legend-effort", EFFORT, "N m", 2],
  ].map(([id, column, unit, digits]) => {
    const values = Array.from({ length: links }, (_, joint) => el("span", { class: `value joint${joint + 1}` }));
    byId(id).replaceChildren(...values, el("span", { class: "unit" }, unit));
    return { column, digits, values };
  });
}

/** Writes the present values; a few times a second is as fast as anybody reads. */
export function showValues() {
  if (record.length === 0) return;
  const row = record.last();
  for (const { column, digits, values } of legends) {
    for (let joint = 0; joint < values.length; joint += 1) {
      setText(values[joint], fixed(record.data[row + column + joint], digits));
    }
  }
  setText(byId("legend-energy-value"), fixed(record.data[row + ENERGY], 3));
  setText(byId("legend-drift"), significant(record.data[row + ENERGY] - reference(), 3));
}

/** Energy at the last reset, change of parameters or switching of PID [J]: what the drift is measured from. */
function reference() {
  const { diagnostics } = state;
  return diagnostics ? diagnostics.energy - diagnostics.energy_drift : NaN;
}

/** At every frame; half of the charts each time, which is smooth enough and half the work. */
export function drawPlots(frame) {
  if (!stale && drawnVersion === state.version) return;
  const now = Number.isNaN(frozenAt) ? newest() : frozenAt;
  if (stale || Number.isNaN(frozenAt)) {
    charts[3].reference = reference();
    for (let i = 0; i < charts.length; i += 1) {
      if (stale || (i + frame) % 2 === 0) charts[i].draw(now, span, state.links, shown);
    }
    if (stale || frame % 2 === 0) phase.draw(now, span, state.links, shown);
  }
  if (frame % 2 === 1 || stale) drawnVersion = state.version;
  stale = false;
}
