// One chart: a frame with two scales, marks and titles, and lines, areas and dots in it. Also the strokes of other pictures,
// and four charts: a map of limits, bars of a deviation, two errors, the arm of a scene.
// Invariant: it draws on any context, of the screen or of a saved picture. Axes are fixed where a student compares settings.

import { significant } from "./format.js";
import { joints, reach } from "./mechanics.js";
import { Axis, LogScale, powerOfTen, times } from "./scale.js";
import { colors } from "./theme.js";

/** @typedef {import("./scale.js").Scale} Scale */
/** @typedef {{width?: number, dash?: number[], alpha?: number}} Style */
/** @typedef {import("./surface.js").Surface} Surface */

const SOLID = /** @type {number[]} */ ([]);
export const DASHED = [5, 4];
const SMALL = "11px system-ui, sans-serif";
export const TEXT = "13px system-ui, sans-serif";
export const STRONG = "600 13px system-ui, sans-serif";

/** @param {any} context @param {number} x @param {number} y @param {number} x2 @param {number} y2 @param {string} color */
export function line(context, x, y, x2, y2, color, width = 1) {
  context.strokeStyle = color;
  context.lineWidth = width;
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x2, y2);
  context.stroke();
}

/** A line through the joints of an arm, base first. @param {any} context @param {number} n @param {ArrayLike<number>} x @param {ArrayLike<number>} y [px] */
export function links(context, n, x, y, px, py, color, width) {
  context.strokeStyle = color;
  context.lineWidth = width;
  context.beginPath();
  context.moveTo(px(x[0]), py(y[0]));
  for (let i = 1; i <= n; i += 1) context.lineTo(px(x[i]), py(y[i]));
  context.stroke();
}

/** A circle, filled with `fill`. @param {any} context @param {number} x @param {number} y @param {number} radius @param {string} fill */
export function circle(context, x, y, radius, fill, edge = "", width = 1) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill) {
    context.fillStyle = fill;
    context.fill();
  }
  if (!edge) return;
  context.strokeStyle = edge;
  context.lineWidth = width;
  context.stroke();
}

/** Filled with the context's fill style. @param {any} context @param {number} tipX @param {number} tipY @param {number} angle @param {number} size */
export function arrowHead(context, tipX, tipY, angle, size) {
  context.beginPath();
  context.moveTo(tipX + size * Math.cos(angle), tipY + size * Math.sin(angle));
  context.lineTo(tipX + 0.7 * size * Math.cos(angle + 2.1), tipY + 0.7 * size * Math.sin(angle + 2.1));
  context.lineTo(tipX + 0.7 * size * Math.cos(angle - 2.1), tipY + 0.7 * size * Math.sin(angle - 2.1));
  context.closePath();
  context.fill();
}

/** Text around the height `y`. @param {any} context @param {string} text @param {number} x @param {number} y @param {"left" | "center" | "right"} align */
export function write(context, text, x, y, align, color = colors.muted, font = TEXT) {
  context.font = font;
  context.fillStyle = color;
  context.textAlign = align;
  context.textBaseline = "middle";
  context.fillText(text, x, y);
}

/** Space for large labels and titles on both axes. */
export const ROOMY = { left: 78, right: 16, top: 16, bottom: 40, font: TEXT };

const NEAR = 1; // below this distance a point is not seen [px]

export class Chart {
  /** @param {Surface} surface @param {Scale} across @param {Scale} up */
  constructor({ context, width, height }, across, up, { left = 46, right = 8, top = 6, bottom = 16, font = SMALL } = {}) {
    this.context = context;
    this.width = width;
    this.height = height;
    this.across = across;
    this.up = up;
    this.font = font;
    this.left = left;
    this.top = top;
    this.right = width - right;
    this.bottom = height - bottom;
  }

  x(value) {
    return this.left + this.across.place(value) * (this.right - this.left);
  }

  y(value) {
    return this.bottom - this.up.place(value) * (this.bottom - this.top);
  }

  /** Marks of both scales, with lines through the chart, for the rows only or without, and the axes' titles. */
  frame({ across = "", up = "", grid = /** @type {boolean | "rows"} */ (true) } = {}) {
    const { context, left, right, top, bottom, font } = this;
    context.setLineDash(SOLID);
    context.globalAlpha = 1;
    for (const [value, label] of this.up.marks) {
      const y = Math.round(this.y(value)) + 0.5;
      if (grid) line(context, left, y, right, y, value === 0 ? colors.line : colors.grid);
      write(context, label, left - 6, y, "right", colors.muted, font);
    }
    const below = bottom + (this.height - bottom > 24 ? 13 : 9);
    context.font = font;
    let end = -Infinity; // of the last label; the next one must not touch it
    for (const [value, label] of this.across.marks) {
      const x = Math.round(this.x(value)) + 0.5;
      if (grid === true) line(context, x, top, x, bottom, value === 0 ? colors.line : colors.grid);
      const half = context.measureText(label).width / 2;
      const middle = Math.min(this.width - half, Math.max(half, x));
      if (middle - half < end + 4) continue;
      write(context, label, middle, below, "center", colors.muted, font);
      end = middle + half;
    }
    if (across) write(context, across, (left + right) / 2, this.height - 8, "center", colors.muted, font);
    if (!up) return;
    context.save();
    context.translate(10, (top + bottom) / 2);
    context.rotate(-Math.PI / 2);
    write(context, up, 0, 0, "center", colors.muted, font);
    context.restore();
  }

  /** Clips the drawing to the chart. @param {() => void} draw */
  inside(draw) {
    const { context, left, right, top, bottom } = this;
    context.save();
    context.beginPath();
    context.rect(left, top - 1, right - left, bottom - top + 2);
    context.clip();
    draw();
    context.restore();
  }

  /** @param {string} color @param {Style} style */
  begin(color, { width = 1.75, dash = SOLID, alpha = 1 }) {
    const { context } = this;
    context.strokeStyle = context.fillStyle = color;
    context.lineWidth = width;
    context.lineJoin = "round";
    context.globalAlpha = alpha;
    context.setLineDash(dash);
    context.beginPath();
  }

  end() {
    this.context.stroke();
    this.context.setLineDash(SOLID);
    this.context.globalAlpha = 1;
  }

  /**
   * A line through many points, with a gap where there is no number. A point within `NEAR` of the last drawn one is left out.
   * @param {number} count @param {(i: number) => number} across @param {(i: number) => number | null} up @param {string} color @param {Style} style
   */
  line(count, across, up, color, style = {}) {
    this.begin(color, style);
    let [lastX, lastY] = [NaN, NaN];
    for (let i = 0; i < count; i += 1) {
      const value = up(i);
      const [x, y] = [this.x(across(i)), Number.isFinite(value) ? this.y(/** @type {number} */ (value)) : NaN];
      if (Math.abs(x - lastX) < NEAR && Math.abs(y - lastY) < NEAR && i < count - 1) continue;
      if (Number.isNaN(lastY)) this.context.moveTo(x, y);
      else if (Number.isFinite(y)) this.context.lineTo(x, y);
      [lastX, lastY] = [x, Number.isFinite(y) ? y : NaN]; // an error of 0 has no place on a logarithmic scale
    }
    this.end();
  }

  /** A line through a few points, in any order. @param {number[][]} points @param {string} color @param {Style} style */
  path(points, color, style = {}) {
    this.begin(color, style);
    for (const [x, y] of points) this.context.lineTo(this.x(x), this.y(y));
    this.end();
  }

  /** @param {number[][]} points @param {string} color */
  area(points, color) {
    this.begin(color, {});
    for (const [x, y] of points) this.context.lineTo(this.x(x), this.y(y));
    this.context.fill();
  }

  /** A mark from top to bottom. @param {number} value @param {string} color */
  upright(value, color) {
    if (Number.isFinite(value)) line(this.context, this.x(value), this.top, this.x(value), this.bottom, color);
  }

  /** @param {number} x @param {number} y @param {string} color */
  dot(x, y, color, radius = 4) {
    circle(this.context, this.x(x), this.y(y), radius, color);
  }

  /** @param {string} text @param {number} x @param {number} y [px] @param {"left" | "center" | "right"} align */
  words(text, x, y, align, color = colors.ink, font = STRONG) {
    write(this.context, text, x, y, align, color, font);
  }
}

/** @typedef {{factor: number, limit: number, [other: string]: number}} Row the limit at a multiple of the gains [s] */

/**
 * A map of stability: limits over gains, and the dot of the active loop. Points beyond the known rows are not coloured.
 * @param {Chart} chart @param {Row[]} rows @param {number} at place of the dot @param {number} factor
 */
export function drawMap(chart, rows, at, factor) {
  const { context, left, right, top, bottom } = chart;
  const across = /** @type {import("./scale.js").LogScale} */ (chart.across);
  const up = /** @type {import("./scale.js").LogScale} */ (chart.up);
  if (rows.length > 1) {
    const edge = (/** @type {string} */ name) => rows.filter((row) => name in row).map((row) => [across.within(row[name]), row.factor]);
    const [lowest, highest] = [rows[0].factor, rows[rows.length - 1].factor];
    context.fillStyle = colors.unstable;
    context.fillRect(left, chart.y(highest), right - left, bottom - chart.y(highest));
    chart.area([[across.low, lowest], ...edge("limit"), [across.low, highest]], colors.stable);
    chart.path(edge("continuous"), colors.ink, { width: 1.25, dash: DASHED });
    chart.path(edge("limit"), colors.ink, { width: 2 });
    context.strokeStyle = colors.muted;
    context.lineWidth = 1;
    context.strokeRect(left, top, right - left, bottom - top);
    const held = rows.filter((row) => row.limit > across.low);
    if (held.length > 0) chart.words("stable", left + 10, chart.y(held[held.length >> 1].factor) - 14, "left");
    if (rows.some((row) => row.limit < across.high)) chart.words("shakes", right - 10, top + 16, "right");
  }
  circle(context, chart.x(across.within(at)), chart.y(up.within(factor)), 7, colors.accent, colors.panel, 2);
}

const THICK = 40; // largest thickness of a long bar [px]
const NONE = { place: () => 0, marks: [] };
const ERRORS = new LogScale(1e-10, 1, []);
ERRORS.marks = ERRORS.powers(6, (value) => (value === 1 ? "1" : powerOfTen(value)));

/** A bar for each control step; negative ones are red. @param {Surface} surface @param {number[]} bars speed at each step [rad/s] */
export function drawBars(surface, bars, name = "measurement of the controller") {
  const largest = Math.max(...bars.map(Math.abs));
  if (!(largest > 0)) return;
  const up = { place: (/** @type {number} */ value) => 0.5 + (0.46 * value) / largest,
    marks: /** @type {[number, string][]} */ ([1, 0, -1].map((part) => [part * largest, significant(part * largest, 2)])) };
  const across = { place: (/** @type {number} */ k) => (k + 0.5) / bars.length,
    marks: /** @type {[number, string][]} */ (bars.flatMap((_, k) => (k % 2 === 0 ? [[k, String(k + 1)]] : []))) };
  const chart = new Chart(surface, across, up, ROOMY);
  chart.frame({ across: name, up: "speed [rad/s]", grid: "rows" });
  const wide = (0.7 * (chart.right - chart.left)) / bars.length;
  bars.forEach((bar, k) => {
    chart.context.fillStyle = bar >= 0 ? colors.accent : colors.bad;
    const [y, zero] = [chart.y(bar), chart.y(0)];
    chart.context.fillRect(chart.x(k) - wide / 2, Math.min(y, zero), wide, Math.max(1, Math.abs(y - zero)));
  });
}

/**
 * The errors of the method and of the hold, as two bars on one fixed scale. @param {Surface} surface @param {{error: number |
 * null, sampling: number | null} | null} errors
 */
export function drawErrors(surface, errors) {
  if (!errors) return;
  const chart = new Chart(surface, ERRORS, NONE, { ...ROOMY, left: 12 });
  chart.frame({ across: "largest error of a joint [rad]" });
  const rows = /** @type {const} */ ([["the method", errors.error, colors.accent], ["the hold", errors.sampling, colors.bad]]);
  const room = (chart.bottom - chart.top) / rows.length;
  rows.forEach(([name, value, color], k) => {
    const y = chart.top + k * room;
    chart.words(`Error of ${name}: ${value === null ? "not known" : `${significant(value, 2)} rad`}`, chart.left + 6, y + 14, "left");
    chart.context.fillStyle = color;
    if (value !== null && value > 0) chart.context.fillRect(chart.left, y
      + 28, Math.max(2, chart.x(ERRORS.within(value)) - chart.left), Math.min(THICK, Math.max(10, room - 48)));
  });
}

/** An arm in its pose as a small picture: heavier links are thicker. @param {Surface} surface @param {import("./scenes.js").Scene} scene */
export function drawPicture({ context, width, height }, { start, settings }) {
  const lengths = settings.params?.lengths ?? start.map(() => 1);
  const masses = settings.params?.masses ?? start.map(() => 1);
  const scale = (Math.min(width, height) / 2 - 5) / reach(lengths);
  const [x, y] = [/** @type {number[]} */ ([]), /** @type {number[]} */ ([])];
  joints(start.length, start, lengths, x, y);
  const [px, py] = [(/** @type {number} */ metres) => width / 2 + scale * metres, (/** @type {number} */ metres) => height / 2 - scale * metres];
  context.lineCap = "round";
  masses.forEach((mass, i) => line(context, px(x[i]), py(y[i]), px(x[i + 1]), py(y[i + 1]), colors.joints[i],
    Math.min(9, Math.max(1.5, 4 + 0.8 * Math.log10(Math.max(1e-9, mass))))));
  circle(context, width / 2, height / 2, 3, colors.muted);
}

const RESPONSE = new Axis(4, 0.5, 20);

/**
 * Responses over each other, each with its name, and the present one.
 * @param {Surface} surface @param {{name: string, points: number[][]}[]} responses @param {number[][]} points @param {number} setpoint
 * @param {number} lasts [s]
 */
export function drawResponses(surface, responses, points, setpoint, lasts) {
  const all = [...responses.map((one) => one.points), points].flat().map(([, q]) => q);
  RESPONSE.fit(Math.min(setpoint, ...all), Math.max(setpoint + 0.1, ...all));
  const chart = new Chart(surface, times(0, lasts), RESPONSE, ROOMY);
  chart.frame({ across: "time since the start [s]", up: "joint 1 [rad]" });
  chart.inside(() => {
    chart.path([[0, setpoint], [lasts, setpoint]], colors.muted, { width: 1, dash: DASHED });
    responses.forEach(({ points: old }, k) => chart.path(old, colors.methods[k], { width: 1.5 }));
    chart.path(points, colors.ink, { width: 2.5 });
  });
  responses.forEach(({ name }, k) => chart.words(name, chart.right - 6, chart.bottom - 12 - 17 * (responses.length - 1 - k), "right", colors.methods[k]));
}
