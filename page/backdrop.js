// @ts-check
// The backdrop of the arm, which stands still: metric grid, axes with metres, the circles of reach, the direction of gravity.
// Invariant: drawn once per size, parameters and theme, and then copied.

import { fixed, significant } from "./format.js";
import { innerReach, reach } from "./mechanics.js";
import { colors } from "./theme.js";

/** The clock stands over the upper end of the vertical axis [px]. */
const CLOCK = 56;
const LABEL = "11px system-ui, sans-serif";

export function drawBackdrop(canvas, surface, scale, lengths, gravity) {
  canvas.width = surface.canvas.width;
  canvas.height = surface.canvas.height;
  const context = canvas.getContext("2d", { alpha: false });
  context.setTransform(surface.canvas.width / Math.max(1, surface.width), 0, 0, surface.canvas.height / Math.max(1, surface.height), 0, 0);
  const { width, height } = surface;
  context.fillStyle = colors.page;
  context.fillRect(0, 0, width, height);
  const cx = width / 2;
  const cy = height / 2;
  drawReach(context, cx, cy, scale, lengths);
  drawGrid(context, width, height, scale);
  drawGravity(context, width, gravity);
}

function drawReach(context, cx, cy, scale, lengths) {
  context.fillStyle = colors.panel;
  context.beginPath();
  context.arc(cx, cy, reach(lengths) * scale, 0, 2 * Math.PI);
  const inner = innerReach(lengths) * scale;
  if (inner > 0) context.arc(cx, cy, inner, 0, 2 * Math.PI, true);
  context.fill();
  context.strokeStyle = colors.muted;
  context.globalAlpha = 0.7;
  context.lineWidth = 1.25;
  context.setLineDash([2, 5]);
  for (const radius of [reach(lengths) * scale, inner]) {
    context.beginPath();
    context.arc(cx, cy, radius, 0, 2 * Math.PI);
    context.stroke();
  }
  context.setLineDash([]);
  context.globalAlpha = 1;
}

/** Lines at a round number of metres, at least 45 pixels apart. */
function drawGrid(context, width, height, scale) {
  const rough = 45 / scale;
  const power = 10 ** Math.floor(Math.log10(rough));
  const metres = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough);
  const digits = Math.max(0, -Math.floor(Math.log10(metres)));
  const every = metres * scale < 64 ? 2 : 1; // labels need more room than lines
  context.font = LABEL;
  context.fillStyle = colors.muted;
  context.lineWidth = 1;
  // All lines first, so that none crosses out a label.
  for (const [labels, size, vertical] of [[false, width, true], [false, height, false], [true, width, true], [true, height, false]]) {
    const most = Math.floor(size / 2 / scale / metres);
    for (let i = -most; i <= most; i += 1) {
      const at = Math.round(size / 2 + (vertical ? i : -i) * metres * scale) + 0.5;
      if (!labels) {
        context.strokeStyle = i === 0 ? colors.line : colors.grid;
        context.beginPath();
        context.moveTo(vertical ? at : 0, vertical ? 0 : at);
        context.lineTo(vertical ? at : width, vertical ? height : at);
        context.stroke();
        continue;
      }
      const label = fixed(i * metres, digits);
      const edge = at < (vertical ? 24 : CLOCK) || at > size - 24;
      if (i % every !== 0 || edge) continue;
      context.textAlign = vertical ? "center" : "left";
      context.textBaseline = vertical ? "alphabetic" : "middle";
      write(context, vertical && i === most - (most % every) ? `${label} m` : label, vertical ? at : 6, vertical ? height - 6 : at);
    }
  }
}

/** Text with a rim of the background, so that lines behind it do not cross it out. */
function write(context, text, x, y) {
  context.strokeStyle = colors.page;
  context.lineWidth = 4;
  context.strokeText(text, x, y);
  context.fillText(text, x, y);
  context.lineWidth = 1;
}

function drawGravity(context, width, gravity) {
  const x = width - 26;
  context.strokeStyle = colors.muted;
  context.fillStyle = colors.muted;
  context.lineWidth = 2;
  context.textAlign = "right";
  context.textBaseline = "middle";
  context.font = "12px system-ui, sans-serif";
  const text = gravity > 0 ? `g ${significant(gravity, 3)} m/s²` : "no gravity";
  context.fillText(text, x - (gravity > 0 ? 12 : -14), 28);
  if (!(gravity > 0)) return;
  context.beginPath();
  context.moveTo(x, 12);
  context.lineTo(x, 38);
  context.stroke();
  context.beginPath();
  context.moveTo(x, 45);
  context.lineTo(x - 5, 36);
  context.lineTo(x + 5, 36);
  context.closePath();
  context.fill();
}
