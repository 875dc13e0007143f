// The plots' panel: four strip charts and the phase plot, what they show, their legends and their common cursor; and files to keep,
// the recording as CSV, the plots as PNG.
// Invariant: a file is handed to the browser and released.

import { STRONG, write } from "./chart.js";
import { byId, el, setText } from "./dom.js";
import { short, significant } from "./format.js";
import { csvText, cursor, EFFORT, ENERGY, firstAfter, hover, KINETIC, LOAD, newest, POSITION, POTENTIAL, record, SETPOINT, shown as pose, VELOCITY } from "./history.js";
import { energyName } from "./policy.js";
import { presentSettings } from "./settings.js";
import { state, watch } from "./store.js";
import { PhasePlot, StripChart } from "./strip_chart.js";
import { Surface } from "./surface.js";
import { colors } from "./theme.js";

/** No more than this is shown of an arm that has diverged: the blow-up is the end of it [s]. */
const BLOW_UP_SECONDS = 2;
/** Of a plot in a picture that is saved: its height where it is not shown, its title's, and the gap below [px]. */
const [HEIGHT, TITLE, GAP] = [120, 18, 8];
const ENERGIES = [{ column: KINETIC, color: "kinetic" }, { column: POTENTIAL, color: "potential" }, { column: ENERGY, color: "ink" }];

const shown = [true, true, true];
/** @type {{id: string, chart: any, name: string, surface: Surface}[]} */
let plots = [];
let span = 10; // s
let drawnVersion = -1;
let legends = [];

export function startPlots() {
  /** @type {[string, string, any][]} */
  const charts = [
    ["position", "Position [rad]", new StripChart([{ column: POSITION }, { column: SETPOINT, dashed: true }], 0.2, 300)],
    ["velocity", "Velocity [rad/s]", new StripChart([{ column: VELOCITY }], 0.2, 300)],
    ["effort", "Effort [N m]", new StripChart([{ column: EFFORT }, { column: LOAD, dashed: true }], 1, 5000)],
    ["energy", "Energy [J]", new StripChart(ENERGIES, 0.1, 5000)],
    ["phase", "Velocity [rad/s] over position [rad]", new PhasePlot()],
  ];
  plots = charts.map(([id, name, chart]) => {
    const surface = new Surface(byId(`plot-${id}`), () => chart.draw(surface.context, surface.width, surface.height, { ...view(id), cursor: cursor() }));
    return { id, chart, name, surface };
  });
  for (const { chart, surface: { canvas } } of plots.slice(0, 4)) {
    canvas.addEventListener("pointermove", (event) => hover(chart.timeAt(event.offsetX)));
    canvas.addEventListener("pointerleave", () => hover(NaN));
  }
  watch("cursor", () => { redraw(); showValues(); });
  watch("playback", () => { if (pose.playing) return; redraw(); showValues(); });
  watch("links", makeLegends);
  watch("diverged", redraw);
  byId("plot-span").addEventListener("change", (event) => {
    span = Number(event.target.value);
    redraw();
  });
  byId("plot-fix").addEventListener("click", toggleScales);
}

/** What a plot shows now. @param {string} id */
function view(id) {
  return { now: edge(), span: shownSpan(), links: state.links, shown, level: id === "energy" ? reference() : NaN };
}

/** Shows less time for 1, more for -1. */
export function zoomPlots(way) {
  const choice = byId("plot-span");
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
  return state.diverged && pose.live ? Math.min(span, BLOW_UP_SECONDS) : span;
}

/** The right edge of the plots: now, or so that what is looked at of the recording is within. */
function edge() {
  const end = newest() || 0;
  if (pose.live || pose.time > end - span) return end;
  return pose.time + span / 2;
}

export function redraw() {
  for (const { surface } of plots) surface.redraw();
}

/** Draws the lines as they are now, if anything has moved since. */
export function movePlots() {
  const moves = pose.playing || (pose.live && drawnVersion !== state.version);
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

const WIDTH = 640; // CSS pixels
const DENSITY = 2; // of a PNG
const KEPT_MS = 10000;

export function startSave() {
  const choice = byId("plot-save");
  choice.addEventListener("change", async () => {
    const kind = choice.value;
    choice.value = "";
    if (kind === "csv") hand(new Blob([csvText(state.links, presentSettings(state))], { type: "text/csv" }), "pendularm.csv");
    if (kind === "png") hand(await png(), "pendularm.png");
  });
}

/** All plots as one picture, one below the other. */
function png() {
  const heights = plots.map(({ surface }) => surface.height || HEIGHT);
  const total = heights.reduce((sum, height) => sum + TITLE + height + GAP, 0);
  const canvas = el("canvas", { width: WIDTH * DENSITY, height: total * DENSITY });
  const context = canvas.getContext("2d");
  context.scale(DENSITY, DENSITY);
  context.fillStyle = colors.panel;
  context.fillRect(0, 0, WIDTH, total);
  plots.forEach(({ id, chart, name }, i) => {
    write(context, name, 8, 9, "left", colors.ink, STRONG);
    context.translate(0, TITLE);
    chart.draw(context, WIDTH, heights[i], view(id));
    context.translate(0, heights[i] + GAP);
  });
  redraw();
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}

function hand(blob, name) {
  const url = URL.createObjectURL(blob);
  el("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), KEPT_MS);
}
