// @ts-check
// Arrows on the arm: how fast the end of each link moves.
// Invariant: a frame allocates nothing.

import { colors } from "./theme.js";

/** An arrow is as long as the way in this time [s]. */
export const SECONDS = 0.15;
/** No longer than this, however fast [px]. */
const LONGEST = 140;
const SHORTEST = 4;

export function drawVelocities(context, n, velocity, x, y, px, py) {
  let [vx, vy, omega] = [0, 0, 0];
  for (let i = 0; i < n; i += 1) {
    omega += velocity[i];
    vx -= omega * (y[i + 1] - y[i]);
    vy += omega * (x[i + 1] - x[i]);
    const [fromX, fromY] = [px(x[i + 1]), py(y[i + 1])];
    let dx = px(x[i + 1] + SECONDS * vx) - fromX;
    let dy = py(y[i + 1] + SECONDS * vy) - fromY;
    const size = Math.hypot(dx, dy);
    if (!(size > SHORTEST)) continue;
    const part = Math.min(1, LONGEST / size);
    dx *= part;
    dy *= part;
    context.strokeStyle = colors.good;
    context.fillStyle = colors.good;
    context.lineWidth = 2.5;
    context.beginPath();
    context.moveTo(fromX, fromY);
    context.lineTo(fromX + dx, fromY + dy);
    context.stroke();
    arrowHead(context, fromX + dx, fromY + dy, Math.atan2(dy, dx), 9);
  }
}

export function arrowHead(context, tipX, tipY, angle, size) {
  context.beginPath();
  context.moveTo(tipX + size * Math.cos(angle), tipY + size * Math.sin(angle));
  context.lineTo(tipX + 0.7 * size * Math.cos(angle + 2.1), tipY + 0.7 * size * Math.sin(angle + 2.1));
  context.lineTo(tipX + 0.7 * size * Math.cos(angle - 2.1), tipY + 0.7 * size * Math.sin(angle - 2.1));
  context.closePath();
  context.fill();
}
