// The plots' panel: four strip charts and the phase plot, with legends and a common cursor; and the recording as a CSV file.
// Invariant: a file is passed to the browser and released.

import { copyable } from "./copy.js";
import { byId, el, setText } from "./dom.js";
import { short, significant } from "./format.js";
import { csvText, EFFORT, ENERGY, firstAfter, LOAD, newest, POSITION, record, recorded, SETPOINT, VELOCITY } from "./history.js";
import { energyName } from "./policy.js";
import { presentSettings } from "./settings.js";
import { state, watch } from "./store.js";
import { ENERGIES, PhasePlot, StripChart } from "./strip_chart.js";
import { Surface } from "./surface.js";

const BLOW_UP_SECONDS = 2; // longest shown time of an arm that has diverged, because the divergence is at its end [s]
/** The name and the chart of each plot. If its legend has joint values: their column, unit and digits. @type {[string, any, number?, string?, number?][]} */
const CHARTS = [
  ["position", new StripChart([{ column: POSITION }, { column: SETPOINT, dashed: true }], 0.2, 300), POSITION, "rad", 3],
  ["velocity", new StripChart([{ column: VELOCITY }], 0.2, 300), VELOCITY, "rad/s", 3],
  ["effort", new StripChart([{ column: EFFORT }, { column: LOAD, dashed: true }], 1, 5000), EFFORT, "N m", 2],
  ["energy", new StripChart(ENERGIES, 0.1, 5000)],
  ["phase", new PhasePlot()],
];

const shown = [true, true, true];
/** @type {{chart: any, surface: Surface}[]} */
let plots = [];
let span = 10; // s
let drawnVersion = -1;
let cursor = NaN; // the time under the pointer [s, simulation time]; NaN without one
let legends = [];

export function startPlots() {
  copyable(byId("plot-save").parentElement, () => recorded("The plots", view("")));
  plots = CHARTS.map(([id, chart]) => ({ chart, surface: new Surface(byId(`plot-${id}`), (surface) => chart.draw(surface, view(id))) }));
  for (const { chart, surface: { canvas } } of plots.slice(0, 4)) {
    canvas.addEventListener("pointermove", (event) => hover(chart.timeAt(event.offsetX)));
    canvas.addEventListener("pointerleave", () => hover(NaN));
  }
  watch("links", makeLegends);
  watch("diverged", redraw);
  byId("plot-span").addEventListener("change", (event) => {
    span = Number(event.target.value);
    redraw();
  });
  byId("plot-fix").addEventListener("click", toggleScales);
  byId("plot-save").addEventListener("click", save);
}

/** Marks `time` [s] on all plots; NaN removes the mark. */
function hover(time) {
  if (Object.is(time, cursor)) return;
  cursor = time;
  redraw();
  showValues();
}

/** The present content of a plot. @param {string} id */
function view(id) {
  return { now: newest() || 0, span: shownSpan(), links: state.links, shown, cursor, level: id === "energy" ? reference() : NaN };
}

/** Shows less time for 1, more for -1. In the course the plots are hidden and stay as they are. */
export function zoomPlots(way) {
  const choice = byId("plot-span");
  if (!choice.checkVisibility()) return;
  choice.selectedIndex = Math.min(choice.length - 1, Math.max(0, choice.selectedIndex - way));
  choice.dispatchEvent(new Event("change"));
}

function toggleScales() {
  const kept = byId("plot-fix").getAttribute("aria-pressed") !== "true";
  for (const { chart } of plots) for (const axis of [chart.axis, chart.across]) if (axis) axis.fixed = kept;
  byId("plot-fix").setAttribute("aria-pressed", String(kept));
  setText(byId("plot-fix"), kept ? "Fixed" : "Fix");
  redraw();
}

function shownSpan() {
  return state.diverged ? Math.min(span, BLOW_UP_SECONDS) : span;
}

export function redraw() {
  for (const { surface } of plots) surface.redraw();
}

/** Draws the present lines, if anything has changed. */
export function movePlots() {
  if (drawnVersion !== state.version) redraw();
  drawnVersion = state.version;
}

/** A chip per joint switches its lines on and off, and shows its colour. Values are in the legends. */
function makeLegends(links) {
  byId("plot-joints").replaceChildren("joints", ...Array.from({ length: links }, (_, joint) => {
    const box = el("input", { type: "checkbox", "aria-label": `joint ${joint + 1}`, onchange: () => { shown[joint] = box.checked; redraw(); } });
    box.checked = shown[joint];
    return el("label", { class: `chip joint${joint + 1}` }, box, ` ${joint + 1}`);
  }));
  legends = CHARTS.filter(([, , column]) => column !== undefined).map(([id, , column, unit, digits]) => {
    const values = Array.from({ length: links }, (_, joint) => el("span", { class: `value joint${joint + 1}` }));
    byId(`legend-${id}`).replaceChildren(...values, el("span", { class: "unit" }, unit));
    return { column, digits, values };
  });
}

/** Writes the values at the cursor, or the present ones. */
export function showValues() {
  if (record.length === 0) return;
  const row = Number.isFinite(cursor) ? record.at(Math.min(firstAfter(cursor), record.length - 1)) : record.last();
  for (const { column, digits, values } of legends) {
    for (let joint = 0; joint < values.length; joint += 1) {
      setText(values[joint], short(record.data[row + column + joint], digits));
    }
  }
  setText(byId("legend-energy-value"), short(record.data[row + ENERGY], 3));
  setText(byId("legend-drift"), significant(record.data[row + ENERGY] - reference(), 3));
  setText(byId("legend-drift-name"), energyName(state));
}

/** Energy at the last reset, change of parameters or switch of the controller [J]. The drift is measured from it. */
function reference() {
  const { diagnostics } = state;
  return diagnostics ? diagnostics.energy - diagnostics.energy_drift : NaN;
}

const KEPT_MS = 10000;

function save() {
  const url = URL.createObjectURL(new Blob([csvText(state.links, presentSettings(state))], { type: "text/csv" }));
  el("a", { href: url, download: "pendularm.csv" }).click();
  setTimeout(() => URL.revokeObjectURL(url), KEPT_MS);
}
