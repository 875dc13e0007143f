// @ts-check
// The course's own charts: bars of a deviation by control step, the two errors, the map of period and damping.
// Invariant: each draws what it is given; axes are fixed where a student compares one setting with the next.

import { duration, significant } from "./format.js";
import { LogScale } from "./scale.js";
import { colors } from "./theme.js";

/** @typedef {import("./surface.js").Surface} Surface */

const LEFT = 78;
const RIGHT = 16;
const TOP = 16;
const BOTTOM = 40;
const TEXT = "13px system-ui, sans-serif";
const STRONG = "600 14px system-ui, sans-serif";

/** The map's axes: control period [s], and damping gains as a multiple of the usual ones. */
export const PERIODS = new LogScale(1e-3, 2e-2);
export const FACTORS = new LogScale(0.25, 4);
const ERRORS = new LogScale(1e-10, 1);

/** A bar for each control step; negative ones are red. @param {Surface} surface @param {number[]} bars speed at each step [rad/s] */
export function drawBars(surface, bars, across = "look of the controller") {
  const { context, width, height } = surface;
  surface.clear();
  const largest = Math.max(...bars.map(Math.abs));
  if (!(largest > 0) || width === 0) return;
  const middle = TOP + (height - TOP - BOTTOM) / 2;
  const room = (width - LEFT - RIGHT) / bars.length;
  const tall = (height - TOP - BOTTOM) / 2 - 8;
  context.font = TEXT;
  context.textBaseline = "middle";
  context.textAlign = "right";
  context.fillStyle = colors.muted;
  for (const part of [1, 0, -1]) {
    line(context, LEFT, middle - part * tall, width - RIGHT, middle - part * tall, part === 0 ? colors.muted : colors.grid);
    context.fillText(significant(part * largest, 2), LEFT - 6, middle - part * tall);
  }
  bars.forEach((bar, k) => {
    context.fillStyle = bar >= 0 ? colors.accent : colors.bad;
    const size = (tall * bar) / largest;
    context.fillRect(LEFT + k * room + room * 0.15, size >= 0 ? middle - size : middle, room * 0.7, Math.max(1, Math.abs(size)));
    context.fillStyle = colors.muted;
    context.textAlign = "center";
    if (k % 2 === 0) context.fillText(String(k + 1), LEFT + (k + 0.5) * room, height - BOTTOM + 12);
  });
  axisTitles(context, width, height, across, "speed of the last joint [rad/s]");
}

/** The errors of the method and of waiting, as two bars on one fixed scale. @param {Surface} surface @param {{error: number | null, sampling: number | null} | null} errors */
export function drawErrors(surface, errors) {
  const { context, width, height } = surface;
  surface.clear();
  if (!errors || width === 0) return;
  const x = (/** @type {number} */ value) => LEFT + Math.min(1, Math.max(0, ERRORS.place(value))) * (width - LEFT - RIGHT);
  context.font = TEXT;
  context.textBaseline = "middle";
  context.textAlign = "center";
  for (const power of [-10, -8, -6, -4, -2, 0]) {
    line(context, x(10 ** power), TOP, x(10 ** power), height - BOTTOM, colors.grid);
    context.fillStyle = colors.muted;
    context.fillText(power === 0 ? "1" : `1e\u2212${-power}`, x(10 ** power), height - BOTTOM + 12);
  }
  const rows = /** @type {const} */ ([["the method", errors.error, colors.accent], ["the waiting", errors.sampling, colors.bad]]);
  const room = (height - TOP - BOTTOM) / rows.length;
  rows.forEach(([name, value, color], k) => {
    const y = TOP + k * room;
    context.textAlign = "left";
    context.font = STRONG;
    context.fillStyle = colors.ink;
    context.fillText(`Error of ${name}: ${value === null ? "not known" : `${significant(value, 2)} rad`}`, LEFT + 6, y + 14);
    context.fillStyle = color;
    if (value !== null && value > 0) context.fillRect(LEFT, y + 28, Math.max(2, x(value) - LEFT), Math.max(10, room - 48));
  });
  context.font = TEXT;
  axisTitles(context, width, height, "largest error of a joint on the move [rad]", "");
}

/**
 * The longest stable period over the damping, and the dot of the loop in force, which moves in it.
 * @param {Surface} surface @param {{factor: number, limit: number}[]} border @param {number} period @param {number} factor
 */
export function drawMap(surface, border, period, factor) {
  const { context, width, height } = surface;
  surface.clear();
  if (width === 0) return;
  const inside = (/** @type {number} */ part) => Math.min(1, Math.max(0, part));
  const x = (/** @type {number} */ value) => LEFT + inside(PERIODS.place(value)) * (width - LEFT - RIGHT);
  const y = (/** @type {number} */ value) => height - BOTTOM - inside(FACTORS.place(value)) * (height - TOP - BOTTOM);
  if (border.length > 1) {
    context.fillStyle = colors.unstable;
    context.fillRect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    context.fillStyle = colors.stable;
    context.strokeStyle = colors.ink;
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(LEFT, y(border[0].factor));
    for (const { factor: at, limit } of border) context.lineTo(x(limit), y(at));
    context.lineTo(LEFT, y(border[border.length - 1].factor));
    context.fill();
    context.beginPath();
    for (const { factor: at, limit } of border) context.lineTo(x(limit), y(at));
    context.stroke();
    context.font = STRONG;
    context.fillStyle = colors.ink;
    context.textAlign = "left";
    context.fillText("stable", LEFT + 10, height - BOTTOM - 14);
    context.textAlign = "right";
    context.fillText("shakes", width - RIGHT - 10, TOP + 18);
  }
  context.font = TEXT;
  context.textBaseline = "middle";
  context.fillStyle = colors.muted;
  context.textAlign = "center";
  for (const tick of [0.001, 0.002, 0.005, 0.01, 0.02]) context.fillText(duration(tick), Math.min(x(tick), width - 24), height - BOTTOM + 12);
  context.textAlign = "right";
  for (const tick of [0.25, 0.5, 1, 2, 4]) context.fillText(`${tick < 1 ? `1/${1 / tick}` : tick}×`, LEFT - 6, y(tick));
  axisTitles(context, width, height, "control period", "damping gains");
  context.fillStyle = colors.accent;
  context.strokeStyle = colors.panel;
  context.lineWidth = 3;
  context.beginPath();
  context.arc(x(period), y(factor), 8, 0, 2 * Math.PI);
  context.fill();
  context.stroke();
}

/** An arm in its pose as a small picture: heavier links are thicker. @param {Surface} surface @param {import("./scenes.js").Scene} scene */
export function drawPicture(surface, { start, settings }) {
  const { context, width, height } = surface;
  surface.clear();
  const lengths = settings.params?.lengths ?? start.map(() => 1);
  const masses = settings.params?.masses ?? start.map(() => 1);
  const total = lengths.reduce((sum, one) => sum + one, 0);
  let [x, y, phi] = [width / 2, height / 2, 0];
  const scale = (Math.min(width, height) / 2 - 5) / total;
  context.lineCap = "round";
  start.forEach((angle, i) => {
    phi += angle;
    const [endX, endY] = [x + scale * lengths[i] * Math.cos(phi), y - scale * lengths[i] * Math.sin(phi)];
    context.lineWidth = Math.min(9, Math.max(1.5, 4 + 0.8 * Math.log10(Math.max(1e-9, masses[i]))));
    line(context, x, y, endX, endY, colors.joints[i], context.lineWidth);
    [x, y] = [endX, endY];
  });
  context.fillStyle = colors.muted;
  context.beginPath();
  context.arc(width / 2, height / 2, 3, 0, 2 * Math.PI);
  context.fill();
}

/** @param {CanvasRenderingContext2D} context @param {number} x @param {number} y @param {number} x2 @param {number} y2 @param {string} color */
function line(context, x, y, x2, y2, color, wide = 1) {
  context.strokeStyle = color;
  context.lineWidth = wide;
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x2, y2);
  context.stroke();
}

/** @param {CanvasRenderingContext2D} context @param {number} width @param {number} height @param {string} across @param {string} up */
function axisTitles(context, width, height, across, up) {
  context.fillStyle = colors.muted;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(across, LEFT + (width - LEFT - RIGHT) / 2, height - 9);
  context.save();
  context.translate(10, TOP + (height - TOP - BOTTOM) / 2);
  context.rotate(-Math.PI / 2);
  context.fillText(up, 0, 0);
  context.restore();
}
