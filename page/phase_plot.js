// The phase plot: velocity over position of each shown joint, through the last seconds; the present state is a dot.
// Invariant: a frame allocates nothing.

import { Axis } from "./axis.js";
import { POSITION, VELOCITY, firstAfter, record } from "./recorder.js";
import { Surface } from "./surface.js";
import { colors } from "./theme.js";

const LEFT = 46;
const RIGHT = 10;
const TOP = 8;
const BOTTOM = 30;
/** The path fades towards the past in this many pieces. */
const PIECES = 5;

export class PhasePlot {
  constructor(canvas) {
    this.across = new Axis(4, 0.5);
    this.up = new Axis(4, 0.5);
    this.surface = new Surface(canvas, () => {});
  }

  draw(now, span, links, shown) {
    const { context, width, height } = this.surface;
    if (width < LEFT + RIGHT + 10) return;
    context.clearRect(0, 0, width, height);
    const first = firstAfter(now - span);
    this.fitAxes(first, links, shown);
    this.drawFrame();
    context.save();
    context.beginPath();
    context.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    context.clip();
    for (let joint = 0; joint < links; joint += 1) if (shown[joint]) this.drawPath(joint, first);
    context.restore();
  }

  fitAxes(first, links, shown) {
    const { across, up } = this;
    const { data } = record;
    across.begin();
    up.begin();
    for (let i = first; i < record.length; i += 1) {
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
    return LEFT + this.across.place(value) * (this.surface.width - LEFT - RIGHT);
  }

  y(value) {
    const { height } = this.surface;
    return height - BOTTOM - this.up.place(value) * (height - TOP - BOTTOM);
  }

  drawFrame() {
    const { context, width, height } = this.surface;
    const { across, up } = this;
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

  drawPath(joint, first) {
    const { context } = this.surface;
    const { data } = record;
    const rows = record.length - first;
    if (rows < 1) return;
    context.strokeStyle = colors.joints[joint];
    context.fillStyle = colors.joints[joint];
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    for (let piece = 0; piece < PIECES; piece += 1) {
      const from = first + Math.floor((piece * rows) / PIECES);
      const to = Math.min(record.length - 1, first + Math.floor(((piece + 1) * rows) / PIECES));
      context.globalAlpha = (piece + 1) / PIECES;
      context.beginPath();
      for (let i = from; i <= to; i += 1) {
        const row = record.at(i);
        const x = this.x(data[row + POSITION + joint]);
        const y = this.y(data[row + VELOCITY + joint]);
        if (i === from) context.moveTo(x, y);
        else context.lineTo(x, y);
      }
      context.stroke();
    }
    const row = record.last();
    context.beginPath();
    context.arc(this.x(data[row + POSITION + joint]), this.y(data[row + VELOCITY + joint]), 4, 0, 2 * Math.PI);
    context.fill();
  }
}
