// @ts-check
// Error against run time, both logarithmic, a line per method. Solid: the error of the method. Dashed: the error of waiting
// between control updates. A run that diverged is a cross on the upper edge.
// Invariant: a run without an error never stretches the axes.

import { METHODS, duration, methodName } from "./format.js";
import { LogScale } from "./scale.js";
import { colors } from "./theme.js";

/** @typedef {import("./ladder.js").Rung} Rung */
/** @typedef {{of: (rung: Rung) => number | null, dash: number[]}} Truth */

const LEFT = 62;
const RIGHT = 14;
const TOP = 30;
const BOTTOM = 36;
const CROSS = 4;

/** @type {Truth[]} */
const TRUTHS = [{ of: ({ error }) => error, dash: [] }, { of: ({ sampling }) => sampling, dash: [5, 4] }];

/** @param {import("./surface.js").Surface} surface @param {Rung[]} found */
export function drawLadder(surface, found) {
  const { context, width, height } = surface;
  surface.clear();
  const runs = found.filter(({ wall }) => wall > 0);
  const errors = runs.flatMap((one) => TRUTHS.map(({ of }) => of(one) ?? 0)).filter((error) => error > 0);
  if (errors.length === 0) return;
  const bounds = (/** @type {number[]} */ values) => new LogScale(10 ** Math.floor(Math.log10(Math.min(...values))), 10 ** Math.ceil(Math.log10(Math.max(...values) * 1.01)));
  const across = bounds(runs.map(({ wall }) => wall));
  const up = bounds(errors);
  const x = (/** @type {number} */ wall) => LEFT + across.place(wall) * (width - LEFT - RIGHT);
  const y = (/** @type {number} */ error) => height - BOTTOM - up.place(error) * (height - TOP - BOTTOM);
  drawFrame(context, width, height, across, up, x, y);
  METHODS.forEach(([method], i) => {
    const own = runs.filter((one) => one.method === method);
    context.strokeStyle = context.fillStyle = colors.methods[i];
    context.lineWidth = 1.75;
    for (const { of, dash } of TRUTHS) drawLine(context, own.flatMap((one) => { const error = of(one); return error !== null && error > 0 ? [[x(one.wall), y(error)]] : []; }), dash);
    for (const { wall, divergedAt } of own) if (divergedAt !== null) cross(context, x(wall), TOP);
  });
  drawKey(context, width);
}

/** @param {CanvasRenderingContext2D} context @param {number[][]} points @param {number[]} dash */
function drawLine(context, points, dash) {
  context.setLineDash(dash);
  context.beginPath();
  for (const [px, py] of points) context.lineTo(px, py);
  context.stroke();
  context.setLineDash([]);
  for (const [px, py] of points) {
    context.beginPath();
    context.arc(px, py, 3, 0, 2 * Math.PI);
    if (dash.length === 0) context.fill();
    else context.stroke();
  }
}

/** @param {CanvasRenderingContext2D} context @param {number} x @param {number} y */
function cross(context, x, y) {
  context.beginPath();
  context.moveTo(x - CROSS, y - CROSS);
  context.lineTo(x + CROSS, y + CROSS);
  context.moveTo(x - CROSS, y + CROSS);
  context.lineTo(x + CROSS, y - CROSS);
  context.stroke();
}

/** The methods by their colours, side by side, so that no two names overprint. @param {CanvasRenderingContext2D} context @param {number} width */
function drawKey(context, width) {
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "left";
  context.textBaseline = "alphabetic";
  const room = (width - LEFT - RIGHT) / METHODS.length;
  METHODS.forEach(([method], i) => {
    context.fillStyle = colors.methods[i];
    context.fillText(methodName(method).replace("Runge–Kutta 4", "RK 4"), LEFT + i * room, 14);
  });
}

/**
 * @param {CanvasRenderingContext2D} context @param {number} width @param {number} height @param {LogScale} across @param {LogScale} up
 * @param {(wall: number) => number} x @param {(error: number) => number} y
 */
function drawFrame(context, width, height, across, up, x, y) {
  context.font = "12px system-ui, sans-serif";
  context.fillStyle = colors.muted;
  context.strokeStyle = colors.grid;
  context.lineWidth = 1;
  context.textAlign = "center";
  for (const tick of across.ticks(6)) {
    context.beginPath();
    context.moveTo(x(tick), TOP);
    context.lineTo(x(tick), height - BOTTOM);
    context.stroke();
    context.fillText(duration(tick), Math.min(x(tick), width - 22), height - 20);
  }
  context.fillText("run time", LEFT + (width - LEFT - RIGHT) / 2, height - 5);
  context.textBaseline = "middle";
  context.save();
  context.translate(10, (height - BOTTOM + TOP) / 2);
  context.rotate(-Math.PI / 2);
  context.fillText("error [rad]", 0, 0);
  context.restore();
  context.textAlign = "right";
  for (const tick of up.ticks(8)) {
    context.beginPath();
    context.moveTo(LEFT, y(tick));
    context.lineTo(width - RIGHT, y(tick));
    context.stroke();
    context.fillText(powerOfTen(tick), LEFT - 6, y(tick));
  }
  context.textBaseline = "alphabetic";
}

/** All ticks of one axis in one form. @param {number} tick */
function powerOfTen(tick) {
  return `1e${Math.round(Math.log10(tick))}`.replace("-", "\u2212");
}
