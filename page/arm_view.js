// The arm on its canvas: grid, reach, trail of the tip, ghost of the setpoint, target, and the links themselves.
// World coordinates are metres, x to the right and y up, the base in the middle.
// Invariant: a frame allocates nothing, and nothing is drawn while nothing changes.

import { drawBackdrop } from "./backdrop.js";
import { gravityLoad, joints, reach } from "./mechanics.js";
import { Ring } from "./ring.js";
import { MOST_LINKS, state, watch } from "./store.js";
import { Surface } from "./surface.js";
import { colors, onTheme } from "./theme.js";

/** Five seconds of trail. */
const TRAIL_ROWS = 300;
const TRAIL_PIECES = 8;
const RIPPLE_MS = 700;
const NO_DASH = [];
const GHOST_DASH = [6, 5];
const ROOM = 1.14; // of the reach, so that circles and labels have space

const x = new Float64Array(MOST_LINKS + 1);
const y = new Float64Array(MOST_LINKS + 1);
const load = new Float64Array(MOST_LINKS);
const REST = new Float64Array(MOST_LINKS); // stretched along +x, where the gravity load is largest
const trail = new Ring(TRAIL_ROWS, 2);
const calm = matchMedia("(prefers-reduced-motion: reduce)");

let surface;
let context;
let backdrop; // grid and circles, drawn once per size
let stale = true;
let drawnVersion = -1;
let reachedAt = -Infinity;
let scale = 100; // pixels per metre
/** Where the pointer aims, while it does: { x, y, phi, direct, refused }. */
let aim = null;

export function startArmView(canvas) {
  backdrop = document.createElement("canvas");
  surface = new Surface(canvas, resized);
  context = surface.context;
  onTheme(resized);
  watch("params", resized);
  watch("links", () => { trail.clear(); resized(); });
  watch("setpoint", redraw);
  watch("joint", redraw);
  watch("diagnostics", redraw);
  watch("goal", (goal) => {
    if (goal?.outcome === "reached") reachedAt = performance.now();
    redraw();
  });
}

export function redraw() {
  stale = true;
}

export function clearTrail() {
  trail.clear();
  redraw();
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
  drawBackdrop(backdrop, surface, scale, lengths(), state.params?.gravity ?? 0);
  redraw();
}

/** Metres from the base, for a place on the canvas in CSS pixels; rounded to a tenth of a millimetre. */
export function toWorld(px, py) {
  const round = (value) => Math.round(value * 1e4) / 1e4;
  return { x: round((px - surface.width / 2) / scale), y: round((surface.height / 2 - py) / scale) };
}

/** Where the tip is [m]. */
export function tip() {
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

/** The latest tip joins the trail; called once per joint state. */
export function extendTrail() {
  const n = state.links;
  if (!state.params || n !== state.params.lengths.length) return;
  joints(n, state.position, state.params.lengths, x, y);
  const { data } = trail;
  if (trail.length > 0) {
    const last = trail.last();
    if (data[last] === x[n] && data[last + 1] === y[n]) return;
  }
  const row = trail.push();
  data[row] = x[n];
  data[row + 1] = y[n];
}

export function drawArm(now) {
  const ripple = !calm.matches && now - reachedAt < RIPPLE_MS;
  if (!stale && !ripple && drawnVersion === state.version) return;
  stale = ripple; // one frame more after the last of it
  drawnVersion = state.version;
  const { width, height } = surface;
  context.globalAlpha = 1;
  context.setLineDash(NO_DASH);
  context.clearRect(0, 0, width, height);
  context.drawImage(backdrop, 0, 0, width, height);
  const n = state.links;
  if (n === 0 || state.params?.lengths.length !== n) return;
  context.lineCap = "round";
  context.lineJoin = "round";
  drawTrail();
  if (state.setpointKnown) drawGhost(n);
  drawTarget(n, ripple ? (now - reachedAt) / RIPPLE_MS : 1);
  drawLinks(n);
}

function drawTrail() {
  const { data, length } = trail;
  context.strokeStyle = colors.accent;
  context.lineWidth = 2;
  context.lineCap = "butt"; // round ends would show where two pieces meet
  for (let piece = 0; piece < TRAIL_PIECES; piece += 1) {
    const from = Math.floor((piece * length) / TRAIL_PIECES);
    const to = Math.min(length - 1, Math.floor(((piece + 1) * length) / TRAIL_PIECES));
    context.globalAlpha = (0.7 * (piece + 1)) / TRAIL_PIECES;
    context.beginPath();
    for (let i = from; i <= to; i += 1) {
      const row = trail.at(i);
      if (i === from) context.moveTo(px(data[row]), py(data[row + 1]));
      else context.lineTo(px(data[row]), py(data[row + 1]));
    }
    context.stroke();
  }
  context.lineCap = "round";
  context.globalAlpha = 1;
}

function drawGhost(n) {
  joints(n, state.setpoint, lengths(), x, y);
  context.strokeStyle = colors.muted;
  context.lineWidth = 2;
  context.globalAlpha = state.enabled ? 0.9 : 0.5;
  context.setLineDash(GHOST_DASH);
  context.beginPath();
  context.moveTo(px(0), py(0));
  for (let i = 1; i <= n; i += 1) context.lineTo(px(x[i]), py(y[i]));
  context.stroke();
  context.setLineDash(NO_DASH);
  for (let i = 1; i <= n; i += 1) {
    context.beginPath();
    context.arc(px(x[i]), py(y[i]), 4, 0, 2 * Math.PI);
    context.stroke();
  }
  context.globalAlpha = 1;
}

function drawTarget(n, ripple) {
  const { goal } = state;
  const shown = aim && !aim.direct ? aim : goal?.target;
  if (shown) {
    const done = !aim && goal?.outcome !== "active";
    const color = aim?.refused ? colors.bad : done && goal?.outcome === "reached" ? colors.good : colors.target;
    if (!aim && goal?.outcome === "active") drawWay(n, shown, color);
    drawCross(shown, goal?.epsilon ?? 0.02, color, done ? 0.75 : 1);
    if (ripple < 1) {
      context.globalAlpha = 1 - ripple;
      circle(shown.x, shown.y, 8 + 34 * ripple);
    }
  }
  if (aim?.direct) drawCross(aim, 0, aim.refused ? colors.bad : colors.ink, 1);
  context.globalAlpha = 1;
}

/** A thin line of what is left to go. */
function drawWay(n, target, color) {
  joints(n, state.position, lengths(), x, y);
  context.strokeStyle = color;
  context.lineWidth = 1.25;
  context.globalAlpha = 0.6;
  context.beginPath();
  context.moveTo(px(x[n]), py(y[n]));
  context.lineTo(px(target.x), py(target.y));
  context.stroke();
}

/** Cross hairs around the disc of radius epsilon within which the target counts as reached. */
function drawCross(target, epsilon, color, alpha) {
  const cx = px(target.x);
  const cy = py(target.y);
  const radius = Math.max(3, epsilon * scale);
  context.globalAlpha = alpha;
  context.strokeStyle = color;
  context.fillStyle = color;
  context.lineWidth = 2;
  if (epsilon > 0) {
    context.globalAlpha = 0.25 * alpha;
    context.beginPath();
    context.arc(cx, cy, radius, 0, 2 * Math.PI);
    context.fill();
    context.globalAlpha = alpha;
    circle(target.x, target.y, radius);
  }
  const inner = radius + 3;
  const outer = radius + 12;
  context.beginPath();
  for (let i = 0; i < 4; i += 1) {
    const dx = i === 0 ? 1 : i === 1 ? -1 : 0;
    const dy = i === 2 ? 1 : i === 3 ? -1 : 0;
    context.moveTo(cx + dx * inner, cy + dy * inner);
    context.lineTo(cx + dx * outer, cy + dy * outer);
  }
  if (Number.isFinite(target.phi)) {
    context.moveTo(cx, cy);
    context.lineTo(cx + 36 * Math.cos(target.phi), cy - 36 * Math.sin(target.phi));
  }
  context.stroke();
}

function circle(wx, wy, radius) {
  context.beginPath();
  context.arc(px(wx), py(wy), radius, 0, 2 * Math.PI);
  context.stroke();
}

function drawLinks(n) {
  const l = lengths();
  const diverged = state.diagnostics?.state === "diverged";
  joints(n, state.position, l, x, y);
  const room = Math.min(1, Math.min(surface.width, surface.height) / 420); // smaller on a telephone
  for (let i = 0; i < n; i += 1) {
    // Heavier rods of the same length are drawn thicker, within reason.
    const thickness = room * Math.min(26, Math.max(7, 14 * Math.sqrt(state.params.masses[i] / l[i])));
    bar(i, thickness + 4, colors.panel);
    bar(i, thickness, diverged ? colors.bad : colors.joints[i]);
  }
  base(room);
  for (let i = 0; i < n; i += 1) pivot(i, room);
  drawEfforts(n, l, room);
  context.fillStyle = colors.ink;
  context.strokeStyle = colors.panel;
  context.lineWidth = 2;
  context.beginPath();
  context.arc(px(x[n]), py(y[n]), 6 * room, 0, 2 * Math.PI);
  context.fill();
  context.stroke();
}

function bar(i, thickness, color) {
  context.strokeStyle = color;
  context.lineWidth = thickness;
  context.beginPath();
  context.moveTo(px(x[i]), py(y[i]));
  context.lineTo(px(x[i + 1]), py(y[i + 1]));
  context.stroke();
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

function pivot(i, room) {
  context.beginPath();
  context.arc(px(x[i]), py(y[i]), 8 * room, 0, 2 * Math.PI);
  context.fillStyle = colors.panel;
  context.fill();
  context.lineWidth = i === state.joint ? 4 : 2.5;
  context.strokeStyle = i === state.joint ? colors.accent : colors.ink;
  context.stroke();
}

/** Effort as an arc around its joint: counter-clockwise is positive, a half turn is all that gravity could ask for. */
function drawEfforts(n, l, room) {

  gravityLoad(n, REST, state.params, load);
  const full = Math.max(1, Math.abs(load[0]));
  context.lineWidth = 3;
  for (let i = 0; i < n; i += 1) {
    const effort = state.effort[i];
    const sweep = Math.PI * Math.max(-1.6, Math.min(1.6, effort / full));
    if (Math.abs(sweep) < 0.03) continue;
    const radius = 19 * room;
    const end = -Math.PI / 2 - sweep;
    context.strokeStyle = colors.joints[i];
    context.fillStyle = colors.joints[i];
    context.beginPath();
    context.arc(px(x[i]), py(y[i]), radius, -Math.PI / 2, end, sweep > 0);
    context.stroke();
    arrowHead(px(x[i]) + radius * Math.cos(end), py(y[i]) + radius * Math.sin(end), end - Math.sign(sweep) * (Math.PI / 2), 8 * room);
  }
}

function arrowHead(tipX, tipY, angle, size) {
  context.beginPath();
  context.moveTo(tipX + size * Math.cos(angle), tipY + size * Math.sin(angle));
  context.lineTo(tipX + 0.7 * size * Math.cos(angle + 2.1), tipY + 0.7 * size * Math.sin(angle + 2.1));
  context.lineTo(tipX + 0.7 * size * Math.cos(angle - 2.1), tipY + 0.7 * size * Math.sin(angle - 2.1));
  context.closePath();
  context.fill();
}
