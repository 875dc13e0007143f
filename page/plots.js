// The plots: strip charts of the recording over the last seconds of simulation time, and velocity over position with a dot for the present state.
// Also their panel, with legends and a common cursor, and the recording as a CSV file.
// Invariant: rows are read in place from the history, and the charts draw on any context. A file is passed to the browser and released.

import { Chart, circle, DASHED } from "./chart.js";
import { copyable } from "./copy.js";
import { byId, el, setText } from "./dom.js";
import { short, significant } from "./format.js";
import { csvText, EFFORT, ENERGY, firstAfter, KINETIC, LOAD, newest, POSITION, POTENTIAL, record, recorded, SETPOINT, TIME, VELOCITY } from "./history.js";
import { energyName } from "./policy.js";
import { Axis, LOG_END, times } from "./scale.js";
import { presentSettings } from "./settings.js";
import { state, watch } from "./store.js";
import { Surface } from "./surface.js";
import { colors } from "./theme.js";

/** @typedef {{column: number, dashed?: boolean, color?: string, name?: string}} Series of each joint, or one with its own colour and name */

/** @type {Series[]} */
const ENERGIES = [
  { column: KINETIC, color: "kinetic", name: "kinetic" }, { column: POTENTIAL, color: "potential", name: "potential" },
    { column: ENERGY, color: "ink", name: "total" },
];

/** The smallest and the largest number in columns of the rows from `first` to before `last`. @param {number[]} columns @returns {[number, number]} */
function extent(columns, first, last) {
  let [min, max] = [Infinity, -Infinity];
  for (let i = first; i < last; i += 1) {
    const row = record.at(i);
    for (const column of columns) {
      const value = record.data[row + column];
      if (value < min) min = value;
      if (value > max) max = value;
    }
  }
  return [min, max];
}

const NAME = 64; // space for the name of a line [px]

export class StripChart {
  /** @param {Series[]} series @param {number} least smallest span of the vertical axis @param {number} sane beyond it the scale is logarithmic */
  constructor(series, least, sane) {
    this.series = series;
    this.axis = new Axis(3, least, sane);
    this.chart = /** @type {Chart | null} */ (null); // the last drawn one
    this.from = NaN; // the time at its left edge
    this.span = NaN;
  }

  /**
   * Draws `span` seconds up to `now`, for the joints that are `shown`, with a mark at `cursor`, a reference level, and
   * a name of the time axis.
   * @param {Surface} surface @param {{now: number, span: number, links: number, shown: boolean[], cursor?: number,
   * level?: number, across?: string}} what
   */
  draw(surface, { now, span, links, shown, cursor = NaN, level = NaN, across = "" }) {
    this.from = now - span;
    this.span = span;
    const first = Math.max(0, firstAfter(this.from) - 1);
    const last = Math.min(record.length, firstAfter(now) + 1);
    const lines = this.series.flatMap((one) => (one.color ? [{ ...one, color: colors[one.color] }]
      : colors.joints.slice(0, links).map((color, joint) => ({ ...one, color, column: one.column + joint })).filter((_, joint) => shown[joint])));
    const [min, max] = extent(lines.map(({ column }) => column), first, last);
    this.axis.fit(level < min ? level : min, level > max ? level : max);
    const leftAt = this.leftAt(lines, first, last);
    const named = lines.filter(({ name }) => name);
    const chart = new Chart(surface, times(this.from, now), this.axis, { ...(named.length > 0 && { top: 18 }), ...(across && { bottom: 36 }) });
    this.chart = chart;
    chart.frame({ across });
    const { data } = record;
    chart.inside(() => {
      if (Number.isFinite(level)) chart.path([[this.from, level], [now, level]], colors.muted, { width: 1, dash: DASHED });
      for (const { column, color, dashed } of lines) {
        chart.line(last - first, (i) => data[record.at(first + i) + TIME], (i) => data[record.at(first + i) + column], color, dashed
          ? { width: 1.25, dash: DASHED, alpha: 0.85 } : {});
      }
      chart.upright(leftAt, colors.bad);
      chart.upright(cursor, colors.accent);
    });
    named.forEach(({ name, color }, i) => chart.words(name, chart.left + NAME * i, 8, "left", color, chart.font));
    if (!this.axis.log) return;
    const end = Number.isFinite(leftAt) ? `, beyond 1e12 from ${leftAt.toFixed(2)} s` : "";
    chart.words(`logarithmic${end}`, chart.left + 4, chart.top + 6, "left", colors.bad, chart.font);
  }

  /** The first time at which a value left the logarithmic scale [s]; NaN if none did. */
  leftAt(lines, first, last) {
    if (!this.axis.log) return NaN;
    for (let i = first; i < last; i += 1) {
      const row = record.at(i);
      if (lines.some(({ column }) => Math.abs(record.data[row + column]) >= LOG_END)) return record.data[row + TIME];
    }
    return NaN;
  }

  /** The time at `x` CSS pixels from the left; NaN outside the plot. @param {number} x */
  timeAt(x) {
    const { chart } = this;
    if (!chart || x < chart.left || x > chart.right) return NaN;
    return this.from + ((x - chart.left) / (chart.right - chart.left)) * this.span;
  }
}

const PIECES = 5; // the number of pieces of the path, which fades towards the past
const SANE = 300; // beyond it the scales are logarithmic [rad, rad/s]

class PhasePlot {
  across = new Axis(4, 0.5, SANE);
  axis = new Axis(4, 0.5, SANE);

  /** @param {Surface} surface @param {{now: number, span: number, links: number, shown: boolean[], cursor?: number}} what */
  draw(surface, { now, span, links, shown, cursor = NaN }) {
    const first = firstAfter(now - span);
    const last = Math.min(record.length, firstAfter(now) + 1);
    const joints = Array.from({ length: links }, (_, joint) => joint).filter((joint) => shown[joint]);
    this.across.fit(...extent(joints.map((joint) => POSITION + joint), first, last));
    this.axis.fit(...extent(joints.map((joint) => VELOCITY + joint), first, last));
    const chart = new Chart(surface, this.across, this.axis, { right: 10, top: 8, bottom: 36 });
    chart.frame({ across: "position [rad]" });
    const at = Number.isFinite(cursor) ? Math.min(firstAfter(cursor), record.length - 1) : last - 1;
    if (last - 1 > first) chart.inside(() => { for (const joint of joints) drawPath(chart, joint, first, last - 1, record.at(at)); });
  }
}

/** A path through the rows from `first` to `last` that fades towards the past, and a dot at the row that begins at `dot`. */
function drawPath(chart, joint, first, last, dot) {
  const x = (row) => chart.x(record.data[row + POSITION + joint]);
  const y = (row) => chart.y(record.data[row + VELOCITY + joint]);
  const color = colors.joints[joint];
  let from = first;
  for (let piece = 1; piece <= PIECES; piece += 1) {
    const to = first + Math.floor((piece * (last - first)) / PIECES);
    chart.begin(color, { width: 1.5, alpha: piece / PIECES });
    for (let i = from; i <= to; i += 1) chart.context.lineTo(x(record.at(i)), y(record.at(i)));
    chart.end();
    from = to;
  }
  circle(chart.context, x(dot), y(dot), 4, color);
}

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
