// A strip chart: quantities over the last seconds of simulation time, one colour per joint.
// Invariant: a frame allocates nothing; rows are read where the recorder wrote them.

import { Axis } from "./axis.js";
import { TIME, firstAfter, record } from "./recorder.js";
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
   * @param {{column: number, dashed?: boolean, perJoint: boolean}[]} series
   * @param {number} least smallest span of the vertical axis
   */
  constructor(canvas, series, least) {
    this.series = series;
    this.axis = new Axis(3, least);
    this.reference = NaN; // a level worth comparing with
    this.surface = new Surface(canvas, () => {});
  }

  /** Draws `span` seconds up to `now`, for the joints that are `shown`. */
  draw(now, span, links, shown) {
    const { context, width, height } = this.surface;
    if (width < LEFT + RIGHT + 10) return;
    context.clearRect(0, 0, width, height);
    const first = Math.max(0, firstAfter(now - span) - 1);
    this.fitAxis(first, links, shown);
    this.drawFrame(now, span);
    context.save();
    context.beginPath();
    context.rect(LEFT, 0, width - LEFT - RIGHT, height - BOTTOM);
    context.clip();
    this.drawReference();
    context.lineJoin = "round";
    for (const one of this.series) {
      context.setLineDash(one.dashed ? DASHED : SOLID);
      context.lineWidth = one.dashed ? 1.25 : 1.75;
      context.globalAlpha = one.dashed ? 0.85 : 1;
      if (!one.perJoint) {
        context.strokeStyle = colors.ink;
        this.drawLine(one.column, first, now, span);
        continue;
      }
      for (let joint = 0; joint < links; joint += 1) {
        if (!shown[joint]) continue;
        context.strokeStyle = colors.joints[joint];
        this.drawLine(one.column + joint, first, now, span);
      }
    }
    context.restore();
  }

  fitAxis(first, links, shown) {
    const { axis } = this;
    const { data } = record;
    axis.begin();
    for (const one of this.series) {
      const columns = one.perJoint ? links : 1;
      for (let joint = 0; joint < columns; joint += 1) {
        if (one.perJoint && !shown[joint]) continue;
        for (let i = first; i < record.length; i += 1) axis.offer(data[record.at(i) + one.column + joint]);
      }
    }
    if (Number.isFinite(this.reference)) axis.offer(this.reference);
    axis.end();
  }

  y(value) {
    const { height } = this.surface;
    return height - BOTTOM - this.axis.place(value) * (height - TOP - BOTTOM);
  }

  drawFrame(now, span) {
    const { context, width, height } = this.surface;
    const { axis } = this;
    context.setLineDash(SOLID);
    context.globalAlpha = 1;
    context.lineWidth = 1;
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = colors.muted;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (let i = 0; i < axis.count; i += 1) {
      const y = Math.round(this.y(axis.values[i])) + 0.5;
      context.strokeStyle = Math.abs(axis.values[i]) < axis.step / 2 ? colors.line : colors.grid;
      context.beginPath();
      context.moveTo(LEFT, y);
      context.lineTo(width - RIGHT, y);
      context.stroke();
      context.fillText(axis.labels[i], LEFT - 6, y);
    }
    // Seconds of simulation time along the bottom.
    const every = span > 15 ? 5 : span > 6 ? 2 : 1;
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    context.strokeStyle = colors.grid;
    for (let t = Math.max(0, Math.ceil((now - span) / every) * every); t <= now; t += every) {
      const x = LEFT + (1 - (now - t) / span) * (width - LEFT - RIGHT);
      context.beginPath();
      context.moveTo(x, TOP);
      context.lineTo(x, height - BOTTOM);
      context.stroke();
      if (x > LEFT + 8 && x < width - RIGHT - 8) context.fillText(second(t), x, height - 3);
    }
  }

  drawReference() {
    if (!Number.isFinite(this.reference)) return;
    const { context, width } = this.surface;
    context.setLineDash(DASHED);
    context.strokeStyle = colors.muted;
    context.beginPath();
    context.moveTo(LEFT, this.y(this.reference));
    context.lineTo(width - RIGHT, this.y(this.reference));
    context.stroke();
  }

  drawLine(column, first, now, span) {
    const { context, width } = this.surface;
    const { data } = record;
    const scale = (width - LEFT - RIGHT) / span;
    const right = width - RIGHT;
    let down = false;
    context.beginPath();
    for (let i = first; i < record.length; i += 1) {
      const row = record.at(i);
      const value = data[row + column];
      if (!Number.isFinite(value)) {
        down = false;
        continue;
      }
      const x = right - (now - data[row + TIME]) * scale;
      if (down) context.lineTo(x, this.y(value));
      else context.moveTo(x, this.y(value));
      down = true;
    }
    context.stroke();
  }
}

// Labels of whole seconds, made once each for the first minutes.
const seconds = [];
function second(t) {
  if (t >= 3600) return String(t);
  return (seconds[t] ??= String(t));
}
