// The arm on its canvas: grid, reach, trail of the end effector, ghost of the setpoint, target, and the links themselves. World
// coordinates are metres, x to the right and y up, the base in the middle.
// Invariant: nothing is drawn without a visible change. Everything behind the arm is drawn at most ten times a second. Between two
// states the trail is a curve if the motion is known, otherwise a straight line. It never leaves the reach.

import { arrowHead, circle, DASHED, line, links, write as writeText } from "./chart.js";
import { fixed, significant } from "./format.js";
import { between, firstAfter, POSITION, record } from "./history.js";
import { gravityLoad, innerReach, joints, reach } from "./mechanics.js";
import { DEFAULT_EPSILON } from "./runtime.js";
import { MOST_LINKS, state, watch } from "./store.js";
import { onFrame, Surface, wake } from "./surface.js";
import { colors } from "./theme.js";

const SEEN = 0.1; // a joint that moves less on the screen counts as not moved [px]
const NO_DASH = [];
const BOTH_WAYS = [-1, 1];
const ROOM = 1.14; // of the reach, as space for circles and labels
const EFFORT_RADIUS = 19; // px
const MOST_DIGITS = 4; // after the point, in the labels of the grid

const q = new Float64Array(MOST_LINKS);
const x = new Float64Array(MOST_LINKS + 1);
const y = new Float64Array(MOST_LINKS + 1);
const load = new Float64Array(MOST_LINKS);
const drawn = { position: new Float64Array(MOST_LINKS), effort: new Float64Array(MOST_LINKS) };
const REST = new Float64Array(MOST_LINKS); // stretched along +x, where the gravity load is largest

let surface;
let context;
let behind; // everything behind the arm: grid, circles, trail and ghost
let behindTime = NaN;
let stale = true;
let behindStale = true;
let fullEffort = 1; // N m, the largest gravity load
let scale = 100; // pixels per metre
let aim = null; // the aimed position of the pointer, while it aims: { x, y, phi, mode, refused }; see `aim.js`

export function startArmView(canvas) {
  behind = document.createElement("canvas");
  surface = new Surface(canvas, () => {}, resized);
  context = surface.context;
  watch("params", resized);
  watch("links", resized);
  watch(["setpoint", "joint", "enabled", "diverged", "goal"], redraw);
  onFrame(drawArm);
}

export function redraw() {
  stale = true;
  behindStale = true;
  wake();
}

/** The trail is updated when time advances. In between only its latest piece is drawn. */
export function redrawTrail() {
  if (behindTime !== state.time) redraw();
}

/** Whether the arm looks different from its last drawing. */
export function hasMoved() {
  const pixels = scale * reach(lengths());
  for (let i = 0; i < state.links; i += 1) {
    const change = Math.abs(state.position[i] - drawn.position[i]) * pixels;
    const sweep = Math.abs(state.effort[i] - drawn.effort[i]) * (Math.PI / fullEffort) * EFFORT_RADIUS;
    if (!(change < SEEN && sweep < SEEN)) return true;
  }
  return false;
}

export function showAim(now) {
  aim = now;
  redraw();
}

function lengths() {
  return state.params?.lengths ?? [1, 1];
}

function resized() {
  if (!surface) return;
  scale = Math.max(1, Math.min(surface.width, surface.height) / (2 * ROOM * reach(lengths())));
  if (state.params?.masses.length === state.links) {
    gravityLoad(state.links, REST, state.params, load);
    fullEffort = Math.max(1, Math.abs(load[0]));
  }
  behind.width = surface.canvas.width;
  behind.height = surface.canvas.height;
  redraw();
}

/** Rounded to a tenth of a millimetre. */
export function rounded(metres) {
  return Math.round(metres * 1e4) / 1e4;
}

/** Metres from the base for a position in the window, as of a pointer. */
export function toWorld({ clientX, clientY }) {
  const { left, top } = surface.canvas.getBoundingClientRect();
  return { x: rounded((clientX - left - surface.width / 2) / scale), y: rounded((surface.height / 2 - clientY + top) / scale) };
}

/** The position of the end effector [m]. */
export function endEffector() {
  const n = state.links;
  joints(n, state.position, lengths(), x, y);
  return { x: x[n], y: y[n] };
}

function px(metres) {
  return surface.width / 2 + metres * scale;
}

function py(metres) {
  return surface.height / 2 - metres * scale;
}

/** No further frame is needed after it. */
function drawArm() {
  if (!stale && !hasMoved()) return false;
  stale = false;
  drawn.position.set(state.position);
  drawn.effort.set(state.effort);
  const n = state.links;
  const known = n > 0 && state.params?.lengths.length === n;
  if (behindStale) paintBehind(known ? n : 0);
  context.globalAlpha = 1;
  context.setLineDash(NO_DASH);
  context.drawImage(behind, 0, 0, surface.width, surface.height);
  if (!known) return false;
  context.lineCap = "round";
  context.lineJoin = "round";
  drawTrail(context, behindTime, state.time, 1);
  drawTarget(n);
  drawLinks(n);
  return false;
}

/** Paints everything behind an arm of `n` links, 0 if unknown. Between two paintings each frame draws the trail's latest piece. */
function paintBehind(n) {
  behindStale = false;
  const paint = behind.getContext("2d", { alpha: false });
  paint.setTransform(context.getTransform());
  paint.globalAlpha = 1;
  paint.fillStyle = colors.page;
  paint.fillRect(0, 0, surface.width, surface.height);
  drawReach(paint);
  drawGrid(paint);
  drawGravity(paint, state.params?.gravity ?? 0);
  if (n > 0) drawTrail(paint, state.time - TRAIL_SECONDS, state.time, PIECES);
  if (n > 0 && state.setpointKnown) drawGhost(paint, n);
  behindTime = state.time;
}

function drawGhost(paint, n) {
  joints(n, state.setpoint, lengths(), x, y);
  paint.lineCap = "round";
  paint.lineJoin = "round";
  paint.globalAlpha = state.enabled ? 0.9 : 0.5;
  paint.setLineDash(DASHED);
  links(paint, n, x, y, px, py, colors.muted, 2);
  paint.setLineDash(NO_DASH);
  for (let i = 1; i <= n; i += 1) circle(paint, px(x[i]), py(y[i]), 4, "", colors.muted, 2);
  paint.globalAlpha = 1;
}

function drawTarget(n) {
  const { goal } = state;
  const target = aim?.mode === "goal" ? aim : goal?.target;
  if (target) {
    const done = !aim && goal?.outcome !== "active";
    const color = aim?.refused ? colors.bad : done && goal?.outcome === "reached" ? colors.good : colors.target;
    if (!aim && goal?.outcome === "active") drawWay(n, target, color);
    drawCross(target, goal?.epsilon ?? DEFAULT_EPSILON, color, done ? 0.75 : 1);
  }
  if (aim?.mode === "setpoint" || (aim?.mode === "arm" && aim.refused)) drawCross(aim, 0, aim.refused ? colors.bad : colors.ink, 1);
  context.globalAlpha = 1;
}

function drawWay(n, target, color) {
  joints(n, state.position, lengths(), x, y);
  context.globalAlpha = 0.6;
  line(context, px(x[n]), py(y[n]), px(target.x), py(target.y), color, 1.25);
}

/** Cross hairs around the disc of radius epsilon within which the target counts as reached. */
function drawCross(target, epsilon, color, alpha) {
  const cx = px(target.x);
  const cy = py(target.y);
  const radius = Math.max(3, epsilon * scale);
  if (epsilon > 0) {
    context.globalAlpha = 0.25 * alpha;
    circle(context, cx, cy, radius, color);
  }
  context.globalAlpha = alpha;
  if (epsilon > 0) circle(context, cx, cy, radius, "", color, 2);
  const inner = radius + 3;
  const outer = radius + 12;
  for (const way of BOTH_WAYS) {
    line(context, cx + way * inner, cy, cx + way * outer, cy, color, 2);
    line(context, cx, cy + way * inner, cx, cy + way * outer, color, 2);
  }
  if (Number.isFinite(target.phi)) line(context, cx, cy, cx + 36 * Math.cos(target.phi), cy - 36 * Math.sin(target.phi), color, 2);
}

function drawLinks(n) {
  const l = lengths();
  joints(n, state.position, l, x, y);
  const room = Math.min(1, Math.min(surface.width, surface.height) / 420); // smaller on a telephone
  for (let i = 0; i < n; i += 1) {
    // Heavier rods of the same length are drawn thicker, up to a limit.
    const thickness = room * Math.min(26, Math.max(7, 14 * Math.sqrt(state.params.masses[i] / l[i])));
    line(context, px(x[i]), py(y[i]), px(x[i + 1]), py(y[i + 1]), colors.panel, thickness + 4);
    line(context, px(x[i]), py(y[i]), px(x[i + 1]), py(y[i + 1]), state.diverged ? colors.bad : colors.joints[i], thickness);
  }
  base(room);
  for (let i = 0; i < n; i += 1) {
    const chosen = i === state.joint;
    circle(context, px(x[i]), py(y[i]), 8 * room, colors.panel, chosen ? colors.accent : colors.ink, chosen ? 4 : 2.5);
  }
  drawEfforts(n, room);
  circle(context, px(x[n]), py(y[n]), 6 * room, colors.ink, colors.panel, 2);
}

/** The mount under the first joint. */
function base(room) {
  const half = 20 * room;
  context.fillStyle = colors.muted;
  context.beginPath();
  context.moveTo(px(0) - 8 * room, py(0));
  context.lineTo(px(0) + 8 * room, py(0));
  context.lineTo(px(0) + half, py(0) + half * 1.3);
  context.lineTo(px(0) - half, py(0) + half * 1.3);
  context.closePath();
  context.globalAlpha = 0.55;
  context.fill();
  context.globalAlpha = 1;
}

/** Effort as an arc around its joint: counter-clockwise is positive, and a half turn is the largest gravity load. */
function drawEfforts(n, room) {
  context.lineWidth = 3;
  for (let i = 0; i < n; i += 1) {
    const effort = state.effort[i];
    const sweep = Math.PI * Math.max(-1.6, Math.min(1.6, effort / fullEffort));
    if (Math.abs(sweep) < 0.03) continue;
    const radius = EFFORT_RADIUS * room;
    const end = -Math.PI / 2 - sweep;
    context.strokeStyle = colors.joints[i];
    context.fillStyle = colors.joints[i];
    context.beginPath();
    context.arc(px(x[i]), py(y[i]), radius, -Math.PI / 2, end, sweep > 0);
    context.stroke();
    arrowHead(context, px(x[i]) + radius * Math.cos(end), py(y[i]) + radius * Math.sin(end), end - Math.sign(sweep) * (Math.PI / 2), 8 * room);
  }
}

const CLOCK = 56; // the clock covers the upper end of the vertical axis [px]
const LABEL = "11px system-ui, sans-serif";

function drawReach(paint) {
  const inner = innerReach(lengths()) * scale;
  const outer = reach(lengths()) * scale;
  paint.fillStyle = colors.panel;
  paint.beginPath();
  paint.arc(px(0), py(0), outer, 0, 2 * Math.PI);
  if (inner > 0) paint.arc(px(0), py(0), inner, 0, 2 * Math.PI, true);
  paint.fill();
  paint.globalAlpha = 0.7;
  paint.setLineDash([2, 5]);
  for (const radius of [outer, inner]) circle(paint, px(0), py(0), radius, "", colors.muted, 1.25);
  paint.setLineDash(NO_DASH);
  paint.globalAlpha = 1;
}

/** Lines at a round number of metres, at least 45 pixels apart. */
function drawGrid(context) {
  const { width, height } = surface;
  const rough = 45 / scale;
  const power = 10 ** Math.floor(Math.log10(rough));
  const metres = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough);
  const digits = Math.max(0, -Math.floor(Math.log10(metres)));
  const every = metres * scale < 64 ? 2 : 1; // labels need more room than lines
  context.font = LABEL;
  context.fillStyle = colors.muted;
  context.lineWidth = 1;
  // All lines first, so that no line crosses a label.
  for (const [labels, size, vertical] of [[false, width, true], [false, height, false], [true, width, true], [true, height, false]]) {
    const most = Math.floor(size / 2 / scale / metres);
    for (let i = -most; i <= most; i += 1) {
      const at = Math.round(size / 2 + (vertical ? i : -i) * metres * scale) + 0.5;
      if (!labels) {
        line(context, vertical ? at : 0, vertical ? 0 : at, vertical ? at : width, vertical ? height : at, i === 0 ? colors.line : colors.grid);
        continue;
      }
      const label = digits > MOST_DIGITS ? significant(i * metres, 3) : fixed(i * metres, digits);
      const edge = at < (vertical ? 24 : CLOCK) || at > size - 24;
      if (i % every !== 0 || edge) continue;
      context.textAlign = vertical ? "center" : "left";
      context.textBaseline = vertical ? "alphabetic" : "middle";
      write(context, vertical && i === most - (most % every) ? `${label} m` : label, vertical ? at : 6, vertical ? height - 6 : at);
    }
  }
}

/** Text with an outline in the background's colour, so that it is readable over lines. */
function write(context, text, x, y) {
  context.strokeStyle = colors.page;
  context.lineWidth = 4;
  context.strokeText(text, x, y);
  context.fillText(text, x, y);
  context.lineWidth = 1;
}

function drawGravity(context, gravity) {
  const x = surface.width - 26;
  const text = gravity > 0 ? `g ${significant(gravity, 3)} m/s²` : "no gravity";
  writeText(context, text, x - (gravity > 0 ? 12 : -14), 28, "right", colors.muted, "12px system-ui, sans-serif");
  if (!(gravity > 0)) return;
  line(context, x, 12, x, 38, colors.muted, 2);
  arrowHead(context, x, 38, Math.PI / 2, 8);
}

const TRAIL_SECONDS = 5;
const PIECES = 6; // the number of its pieces, which fade towards the past
const BRIGHTEST = 0.7;
const TURN = 0.15; // the sum of the joints' rotations from one point to the next [rad]
/** With a larger rotation between two records the path is unknown, and a straight line is drawn [rad]. */
const FAR = Math.PI;

/** The trail from `since` to `time`, both times of the recording. */
function drawTrail(paint, since, time, pieces) {
  const first = firstAfter(since);
  const rows = Math.min(firstAfter(time), record.length - 1) - first;
  paint.strokeStyle = colors.accent;
  paint.lineWidth = 2;
  paint.lineCap = "butt"; // round ends would be visible where two pieces meet
  paint.lineJoin = "round";
  for (let piece = 0; piece < pieces && rows > 0; piece += 1) {
    paint.globalAlpha = (BRIGHTEST * (piece + 1)) / pieces;
    paint.beginPath();
    const to = first + Math.floor(((piece + 1) * rows) / pieces);
    for (let i = first + Math.floor((piece * rows) / pieces); i < to; i += 1) extend(paint, i);
    paint.stroke();
  }
  paint.lineCap = "round";
  paint.globalAlpha = 1;
}

function extend(paint, i) {
  const { data } = record;
  const n = state.links;
  const [a, b] = [record.at(i), record.at(i + 1)];
  let turned = 0;
  for (let k = 0; k < n; k += 1) turned += Math.abs(data[b + POSITION + k] - data[a + POSITION + k]);
  const points = turned < FAR ? Math.ceil(turned / TURN) || 1 : 1;
  for (let point = 0; point <= points; point += 1) {
    between(a, b, point / points, q);
    joints(n, q, lengths(), x, y);
    paint.lineTo(px(x[n]), py(y[n]));
  }
}
