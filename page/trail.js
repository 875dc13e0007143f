// @ts-check
// The way of the end effector through the last seconds: a smooth curve through the recorded states, fading towards the past.
// Invariant: between two states the curve has the end effector's places and velocities at both, so it is no polygon however fast it goes.

import { reach } from "./mechanics.js";
import { POSITION, TIME, VELOCITY, firstAfter, record } from "./history.js";
import { colors } from "./theme.js";

const SECONDS = 5;
/** The curve fades in this many pieces. */
const PIECES = 6;
const BRIGHTEST = 0.7;
/** How far joints turn, all together, in one piece of curve: a cubic is as good, and fewer are less work [rad]. */
const TURN = 0.15;
/** Places further apart are joined by straight lines: the velocity says nothing about so long a way [of the reach]. */
const FAR = 0.75;
/** Control points further out than this are of no motion within the reach: a true circle has them nearer [of the reach]. */
const ROOM = 1.02;

/** The trail that ends at `time`; `px` and `py` turn metres into pixels. */
export function drawTrail(context, n, lengths, px, py, time) {
  const first = firstAfter(time - SECONDS);
  const rows = Math.min(firstAfter(time), record.length - 1) - first;
  for (let piece = 0; piece < PIECES && rows > 0; piece += 1) {
    const from = first + Math.floor((piece * rows) / PIECES);
    const to = first + Math.floor(((piece + 1) * rows) / PIECES);
    drawPiece(context, n, lengths, px, py, from, to, (BRIGHTEST * (piece + 1)) / PIECES);
  }
}

/** The piece from `since` to `time`, both times of the recording. */
export function drawLatest(context, n, lengths, px, py, since, time) {
  const from = firstAfter(since);
  const to = Math.min(firstAfter(time), record.length - 1);
  if (to > from) drawPiece(context, n, lengths, px, py, from, to, BRIGHTEST);
}

function drawPiece(context, n, lengths, px, py, from, to, alpha) {
  context.strokeStyle = colors.accent;
  context.lineWidth = 2;
  context.lineCap = "butt"; // round ends would show where two pieces meet
  context.lineJoin = "round";
  context.globalAlpha = alpha;
  context.beginPath();
  extend(context, n, lengths, px, py, from, true);
  for (let i = from + 1, last = from; i < to; i += 1) {
    if (turned(n, last, i + 1) < TURN) continue;
    extend(context, n, lengths, px, py, i, false);
    last = i;
  }
  if (to > from) extend(context, n, lengths, px, py, to, false);
  context.stroke();
  context.lineCap = "round";
  context.globalAlpha = 1;
}

/** How far the joints are apart in two rows, together [rad]. */
function turned(n, a, b) {
  const { data } = record;
  const [from, to] = [record.at(a) + POSITION, record.at(b) + POSITION];
  let sum = 0;
  for (let k = 0; k < n; k += 1) sum += Math.abs(data[to + k] - data[from + k]);
  return sum;
}

// Position and velocity of the end effector at the sample before.
const before = { x: 0, y: 0, vx: 0, vy: 0, time: 0 };

/** On to where recorded row `i` has the end effector, along the cubic with its places and velocities. */
function extend(context, n, lengths, px, py, i, begins) {
  const { data } = record;
  const row = record.at(i);
  let phi = 0;
  let omega = 0;
  let x = 0;
  let y = 0;
  let vx = 0;
  let vy = 0;
  for (let k = 0; k < n; k += 1) {
    phi += data[row + POSITION + k];
    omega += data[row + VELOCITY + k];
    const c = lengths[k] * Math.cos(phi);
    const s = lengths[k] * Math.sin(phi);
    x += c;
    y += s;
    vx -= s * omega;
    vy += c * omega;
  }
  const third = (data[row + TIME] - before.time) / 3;
  const way = Math.abs(x - before.x) + Math.abs(y - before.y) + Math.abs(third * vx) + Math.abs(third * vy);
  if (begins) context.moveTo(px(x), py(y));
  else if (!(way < FAR * reach(lengths))) context.lineTo(px(x), py(y));
  else {
    const [x1, y1, x2, y2] = [before.x + third * before.vx, before.y + third * before.vy, x - third * vx, y - third * vy];
    // Where the arm shakes between two records the cubic would leave the reach, where no end effector has been.
    const beyond = Math.max(Math.hypot(x1, y1), Math.hypot(x2, y2)) > reach(lengths) * ROOM;
    if (beyond) context.lineTo(px(x), py(y));
    else context.bezierCurveTo(px(x1), py(y1), px(x2), py(y2), px(x), py(y));
  }
  before.x = x;
  before.y = y;
  before.vx = vx;
  before.vy = vy;
  before.time = data[row + TIME];
}
