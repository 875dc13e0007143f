// Charts of the recording: quantities over the last seconds of simulation time, and velocity over position with a dot for the
// present state. Each joint has a colour.
// Invariant: rows are read in place from the history. The charts draw on any context.

import { Chart, circle, DASHED } from "./chart.js";
import { ENERGY, firstAfter, KINETIC, POSITION, POTENTIAL, record, TIME, VELOCITY } from "./history.js";
import { Axis, LOG_END, times } from "./scale.js";
import { colors } from "./theme.js";

/** @typedef {import("./surface.js").Surface} Surface */
/** @typedef {{column: number, dashed?: boolean, color?: string, name?: string}} Series of each joint, or one with its own colour and name */

/** @type {Series[]} */
export const ENERGIES = [
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

export class PhasePlot {
  constructor() {
    this.across = new Axis(4, 0.5, SANE);
    this.axis = new Axis(4, 0.5, SANE);
  }

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
