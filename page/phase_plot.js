// @ts-check
// The phase plot: velocity over position of each shown joint, through the last seconds; the present state is a dot.
// Invariant: a frame allocates nothing. It draws on whatever context it is given.

import { Axis } from "./axis.js";
import { POSITION, TIME, VELOCITY, firstAfter, record } from "./history.js";
import { Surface } from "./surface.js";
import { colors } from "./theme.js";

const LEFT = 46;
const RIGHT = 10;
const TOP = 8;
const BOTTOM = 30;
/** The path fades towards the past in this many pieces. */
const PIECES = 5;
/** Beyond it the scales are logarithmic [rad, rad/s]. */
const SANE = 300;
/** Samples nearer to each other are drawn as one piece of curve [px]. */
const NEAR = 4;
/** Samples further apart than this are joined by straight lines: there is no telling what was between [rad]. */
const FAR = 1;

export class PhasePlot {
  constructor(canvas) {
    this.across = new Axis(4, 0.5, SANE);
    this.up = new Axis(4, 0.5, SANE);
    this.surface = new Surface(canvas, () => {});
  }

  draw(now, span, links, shown, cursor) {
    const { context, width, height } = this.surface;
    if (width < LEFT + RIGHT + 10) return;
    this.surface.clear();
    this.drawOn(context, width, height, now, span, links, shown, cursor);
  }

  drawOn(context, width, height, now, span, links, shown, cursor) {
    this.width = width;
    this.height = height;
    const first = firstAfter(now - span);
    const last = Math.min(record.length, firstAfter(now) + 1);
    this.fitAxes(first, last, links, shown);
    this.drawFrame(context);
    context.save();
    context.beginPath();
    context.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    context.clip();
    const at = Number.isFinite(cursor) ? Math.min(firstAfter(cursor), record.length - 1) : last - 1;
    for (let joint = 0; joint < links; joint += 1) if (shown[joint]) this.drawPath(context, joint, first, last, at);
    context.restore();
  }

  fitAxes(first, last, links, shown) {
    const { across, up } = this;
    const { data } = record;
    across.begin();
    up.begin();
    for (let i = first; i < last; i += 1) {
      const row = record.at(i);
      for (let joint = 0; joint < links; joint += 1) {
        if (!shown[joint]) continue;
        across.offer(data[row + POSITION + joint]);
        up.offer(data[row + VELOCITY + joint]);
      }
    }
    across.end();
    up.end();
  }

  x(value) {
    return LEFT + this.across.place(value) * (this.width - LEFT - RIGHT);
  }

  y(value) {
    const { height } = this;
    return height - BOTTOM - this.up.place(value) * (height - TOP - BOTTOM);
  }

  drawFrame(context) {
    const { across, up, width, height } = this;
    context.lineWidth = 1;
    context.globalAlpha = 1;
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = colors.muted;
    context.textBaseline = "middle";
    context.textAlign = "right";
    for (let i = 0; i < up.count; i += 1) {
      const y = Math.round(this.y(up.values[i])) + 0.5;
      context.strokeStyle = Math.abs(up.values[i]) < up.step / 2 ? colors.line : colors.grid;
      context.beginPath();
      context.moveTo(LEFT, y);
      context.lineTo(width - RIGHT, y);
      context.stroke();
      context.fillText(up.labels[i], LEFT - 6, y);
    }
    context.textBaseline = "alphabetic";
    context.textAlign = "center";
    for (let i = 0; i < across.count; i += 1) {
      const x = Math.round(this.x(across.values[i])) + 0.5;
      context.strokeStyle = Math.abs(across.values[i]) < across.step / 2 ? colors.line : colors.grid;
      context.beginPath();
      context.moveTo(x, TOP);
      context.lineTo(x, height - BOTTOM);
      context.stroke();
      if (i > 0 && i < across.count - 1) context.fillText(across.labels[i], x, height - BOTTOM + 13);
    }
    context.fillText("position [rad]", LEFT + (width - LEFT - RIGHT) / 2, height - 4);
  }

  drawPath(context, joint, first, last, at) {
    const { data } = record;
    const rows = last - first;
    if (rows < 1) return;
    context.strokeStyle = colors.joints[joint];
    context.fillStyle = colors.joints[joint];
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    for (let piece = 0; piece < PIECES; piece += 1) {
      const from = first + Math.floor((piece * rows) / PIECES);
      const to = Math.min(last - 1, first + Math.floor(((piece + 1) * rows) / PIECES));
      context.globalAlpha = (piece + 1) / PIECES;
      context.beginPath();
      let before = from;
      this.extend(context, joint, from, from, from);
      for (let i = from + 1; i <= to; i += 1) {
        if (i < to && this.distance(joint, before, i) < NEAR) continue;
        this.extend(context, joint, i, before, from);
        before = i;
      }
      context.stroke();
    }
    const row = record.at(at);
    context.beginPath();
    context.arc(this.x(data[row + POSITION + joint]), this.y(data[row + VELOCITY + joint]), 4, 0, 2 * Math.PI);
    context.fill();
  }

  /** Distance of two samples on the screen [px]. */
  distance(joint, a, b) {
    const { data } = record;
    const [from, to] = [record.at(a) + joint, record.at(b) + joint];
    return Math.abs(this.x(data[to + POSITION]) - this.x(data[from + POSITION]))
      + Math.abs(this.y(data[to + VELOCITY]) - this.y(data[from + VELOCITY]));
  }

  /** From sample `last` to sample `i`: a cubic with the true slope in position, and one through the samples in velocity. */
  extend(context, joint, i, last, from) {
    const { data } = record;
    const row = record.at(i);
    const [q, v] = [data[row + POSITION + joint], data[row + VELOCITY + joint]];
    if (i === from) {
      context.moveTo(this.x(q), this.y(v));
      return;
    }
    const before = record.at(last);
    const [q0, v0] = [data[before + POSITION + joint], data[before + VELOCITY + joint]];
    if (this.across.log || this.up.log || Math.abs(q - q0) > FAR || !Number.isFinite(v)) {
      context.lineTo(this.x(q), this.y(v));
      return;
    }
    const third = (data[row + TIME] - data[before + TIME]) / 3;
    context.bezierCurveTo(
      this.x(q0 + third * v0), this.y(v0 + third * slope(joint, last, from)),
      this.x(q - third * v), this.y(v - third * slope(joint, i, from)), this.x(q), this.y(v),
    );
  }
}

/** Acceleration of a joint at sample `k`, from the samples beside it [rad/s²]. */
function slope(joint, k, from) {
  const { data } = record;
  const a = record.at(Math.max(from, k - 1));
  const b = record.at(Math.min(record.length - 1, k + 1));
  const h = data[b + TIME] - data[a + TIME];
  return h > 0 ? (data[b + VELOCITY + joint] - data[a + VELOCITY + joint]) / h : 0;
}
