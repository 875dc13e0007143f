// @ts-check
// A strip chart: quantities over the last seconds of simulation time, one colour per joint.
// Invariant: rows are read where they stand in the history. It draws on whatever context it is given, a canvas or an SVG file.

import { Axis, LOG_END } from "./axis.js";
import { Pencil } from "./pencil.js";
import { TIME, firstAfter, record } from "./history.js";
import { Surface } from "./surface.js";
import { colors } from "./theme.js";

const LEFT = 46;
const RIGHT = 8;
const TOP = 6;
const BOTTOM = 16;
const SOLID = [];
const DASHED = [5, 4];

export class StripChart {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {{column: number, dashed?: boolean, perJoint: boolean, color?: string}[]} series
   * @param {number} least smallest span of the vertical axis
   * @param {number} sane beyond it the scale is logarithmic
   */
  constructor(canvas, series, least, sane) {
    this.series = series;
    this.axis = new Axis(3, least, sane);
    this.reference = NaN; // a level worth comparing with
    this.surface = new Surface(canvas, () => {});
    this.now = 0;
    this.span = 1;
    this.leftAt = NaN; // when a value first left the scale
  }

  /** Draws `span` seconds up to `now`, for the joints that are `shown`, with a mark at `cursor`. */
  draw(now, span, links, shown, cursor) {
    const { context, width, height } = this.surface;
    if (width < LEFT + RIGHT + 10) return;
    this.surface.clear();
    this.drawOn(context, width, height, now, span, links, shown, cursor);
  }

  drawOn(context, width, height, now, span, links, shown, cursor) {
    this.now = now;
    this.span = span;
    this.width = width;
    this.height = height;
    const first = Math.max(0, firstAfter(now - span) - 1);
    const last = Math.min(record.length, firstAfter(now) + 1);
    this.fitAxis(first, last, links, shown);
    this.drawFrame(context);
    context.save();
    context.beginPath();
    context.rect(LEFT, 0, width - LEFT - RIGHT, height - BOTTOM);
    context.clip();
    if (Number.isFinite(this.reference)) this.level(context, this.reference);
    context.lineJoin = "round";
    for (const one of this.series) {
      context.setLineDash(one.dashed ? DASHED : SOLID);
      context.lineWidth = one.dashed ? 1.25 : 1.75;
      context.globalAlpha = one.dashed ? 0.85 : 1;
      const columns = one.perJoint ? links : 1;
      for (let joint = 0; joint < columns; joint += 1) {
        if (one.perJoint && !shown[joint]) continue;
        context.strokeStyle = one.perJoint ? colors.joints[joint] : colors[one.color ?? "ink"];
        this.drawLine(context, one.column + joint, first, last);
      }
    }
    context.setLineDash(SOLID);
    if (Number.isFinite(this.leftAt)) this.mark(context, this.leftAt, colors.bad);
    if (Number.isFinite(cursor)) this.mark(context, cursor, colors.accent);
    context.restore();
  }

  fitAxis(first, last, links, shown) {
    const { axis } = this;
    const { data } = record;
    axis.begin();
    this.leftAt = NaN;
    for (const one of this.series) {
      const columns = one.perJoint ? links : 1;
      for (let joint = 0; joint < columns; joint += 1) {
        if (one.perJoint && !shown[joint]) continue;
        for (let i = first; i < last; i += 1) {
          const value = data[record.at(i) + one.column + joint];
          axis.offer(value);
          if (!(Math.abs(value) < LOG_END) && !(this.leftAt <= data[record.at(i) + TIME]) && value === value) this.leftAt = data[record.at(i) + TIME];
        }
      }
    }
    if (Number.isFinite(this.reference)) axis.offer(this.reference);
    axis.end();
  }

  x(time) {
    return this.width - RIGHT - ((this.now - time) / this.span) * (this.width - LEFT - RIGHT);
  }

  y(value) {
    return this.height - BOTTOM - this.axis.place(value) * (this.height - TOP - BOTTOM);
  }

  /** The instant at `x` CSS pixels from the left; NaN beside the plot. */
  timeAt(x) {
    if (x < LEFT || x > this.surface.width - RIGHT) return NaN;
    return this.now - ((this.surface.width - RIGHT - x) / (this.surface.width - LEFT - RIGHT)) * this.span;
  }

  drawFrame(context) {
    const { axis, width, height, now, span } = this;
    context.setLineDash(SOLID);
    context.globalAlpha = 1;
    context.lineWidth = 1;
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = colors.muted;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (let i = 0; i < axis.count; i += 1) {
      const y = Math.round(this.y(axis.values[i])) + 0.5;
      context.strokeStyle = Math.abs(axis.values[i]) < (axis.log ? 0.5 : axis.step / 2) ? colors.line : colors.grid;
      context.beginPath();
      context.moveTo(LEFT, y);
      context.lineTo(width - RIGHT, y);
      context.stroke();
      context.fillText(axis.labels[i], LEFT - 6, y);
    }
    // Seconds of simulation time along the bottom.
    const every = span > 60 ? 20 : span > 15 ? 5 : span > 6 ? 2 : span > 2 ? 1 : 0.2;
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    context.strokeStyle = colors.grid;
    for (let k = Math.max(0, Math.ceil((now - span) / every)); k * every <= now; k += 1) {
      const x = this.x(k * every);
      context.beginPath();
      context.moveTo(x, TOP);
      context.lineTo(x, height - BOTTOM);
      context.stroke();
      if (x > LEFT + 8 && x < width - RIGHT - 8) context.fillText(second(k, every), x, height - 3);
    }
    if (!axis.log) return;
    context.fillStyle = colors.bad;
    context.textAlign = "left";
    const end = Number.isFinite(this.leftAt) ? `, beyond 1e12 from ${this.leftAt.toFixed(2)} s` : "";
    context.fillText(`logarithmic${end}`, LEFT + 4, TOP + 9);
  }

  level(context, value) {
    context.setLineDash(DASHED);
    context.strokeStyle = colors.muted;
    context.beginPath();
    context.moveTo(LEFT, this.y(value));
    context.lineTo(this.width - RIGHT, this.y(value));
    context.stroke();
  }

  mark(context, time, color) {
    context.strokeStyle = color;
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(this.x(time), 0);
    context.lineTo(this.x(time), this.height - BOTTOM);
    context.stroke();
  }

  drawLine(context, column, first, last) {
    const { data } = record;
    const pencil = new Pencil(context);
    context.beginPath();
    for (let i = first; i < last; i += 1) {
      const row = record.at(i);
      const value = data[row + column];
      if (Number.isFinite(value)) pencil.to(this.x(data[row + TIME]), this.y(value));
      else pencil.lift();
    }
    pencil.lift();
    context.stroke();
  }
}

// Labels of the first minutes, made once each.
const seconds = new Map();
function second(k, every) {
  if (every < 1) return (k * every).toFixed(1);
  const t = k * every;
  if (t >= 3600) return String(t);
  if (!seconds.has(t)) seconds.set(t, String(t));
  return seconds.get(t);
}
