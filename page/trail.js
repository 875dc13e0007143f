// The path of the end effector over the last seconds, fading towards the past.
// Invariant: between two states it is a curve if the motion is known, otherwise a straight line. It never leaves the reach.

import { POSITION, between, firstAfter, record } from "./history.js";
import { joints } from "./mechanics.js";
import { MOST_LINKS } from "./store.js";
import { colors } from "./theme.js";

export const SECONDS = 5;
/** The number of its fading pieces. */
const PIECES = 6;
const BRIGHTEST = 0.7;
/** The sum of the joints' rotations from one point to the next [rad]. */
const TURN = 0.15;
/** With a larger rotation between two records the path is unknown, and a straight line is drawn [rad]. */
const FAR = Math.PI;

const q = new Float64Array(MOST_LINKS);
const x = new Float64Array(MOST_LINKS + 1);
const y = new Float64Array(MOST_LINKS + 1);

/** The trail from `since` to `time`, both times of the recording. `px` and `py` convert metres to pixels. */
export function drawTrail(context, n, lengths, px, py, since, time, pieces = PIECES) {
  const first = firstAfter(since);
  const rows = Math.min(firstAfter(time), record.length - 1) - first;
  context.strokeStyle = colors.accent;
  context.lineWidth = 2;
  context.lineCap = "butt"; // round ends would be visible where two pieces meet
  context.lineJoin = "round";
  for (let piece = 0; piece < pieces && rows > 0; piece += 1) {
    context.globalAlpha = (BRIGHTEST * (piece + 1)) / pieces;
    context.beginPath();
    const to = first + Math.floor(((piece + 1) * rows) / pieces);
    for (let i = first + Math.floor((piece * rows) / pieces); i < to; i += 1) extend(context, n, lengths, px, py, i);
    context.stroke();
  }
  context.lineCap = "round";
  context.globalAlpha = 1;
}

/** From row `i` to the next. */
function extend(context, n, lengths, px, py, i) {
  const { data } = record;
  const [a, b] = [record.at(i), record.at(i + 1)];
  let turned = 0;
  for (let k = 0; k < n; k += 1) turned += Math.abs(data[b + POSITION + k] - data[a + POSITION + k]);
  const points = turned < FAR ? Math.ceil(turned / TURN) || 1 : 1;
  for (let point = 0; point <= points; point += 1) {
    between(a, b, point / points, q);
    joints(n, q, lengths, x, y);
    context.lineTo(px(x[n]), py(y[n]));
  }
}
