// The way of the end effector through the last seconds, fading towards the past.
// Invariant: between two states it is a curve while the arm can be followed, else a straight line; it never leaves the reach.

import { POSITION, between, firstAfter, record } from "./history.js";
import { joints } from "./mechanics.js";
import { MOST_LINKS } from "./store.js";
import { colors } from "./theme.js";

export const SECONDS = 5;
/** It fades in this many pieces. */
const PIECES = 6;
const BRIGHTEST = 0.7;
/** How far joints turn, all together, from one point to the next [rad]. */
const TURN = 0.15;
/** Where they turn further between two records the way is not known: it goes straight [rad]. */
const FAR = Math.PI;

const q = new Float64Array(MOST_LINKS);
const x = new Float64Array(MOST_LINKS + 1);
const y = new Float64Array(MOST_LINKS + 1);

/** The trail from `since` to `time`, both times of the recording; `px` and `py` turn metres into pixels. */
export function drawTrail(context, n, lengths, px, py, since, time, pieces = PIECES) {
  const first = firstAfter(since);
  const rows = Math.min(firstAfter(time), record.length - 1) - first;
  context.strokeStyle = colors.accent;
  context.lineWidth = 2;
  context.lineCap = "butt"; // round ends would show where two pieces meet
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
