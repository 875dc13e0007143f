// @ts-check
// The arm on its canvas: grid, reach, trail of the end effector, ghost of the setpoint, target, and the links themselves.
// World coordinates are metres, x to the right and y up, the base in the middle.
// Invariant: a frame allocates nothing, and nothing is drawn while nothing is seen to change.

import { SECONDS as ARROW_SECONDS, arrowHead, drawVelocities } from "./arrows.js";
import { drawBackdrop } from "./backdrop.js";
import { byId } from "./dom.js";
import { onFrame, wake } from "./frames.js";
import { gravityLoad, joints, reach } from "./mechanics.js";
import { follow, shown } from "./playback.js";
import { DEFAULT_EPSILON } from "./runtime.js";
import { MOST_LINKS, state, watch } from "./store.js";
import { Surface } from "./surface.js";
import { colors, onTheme } from "./theme.js";
import { drawLatest, drawTrail } from "./trail.js";

/** A joint that would be seen elsewhere by less has not moved [px]. */
const SEEN = 0.1;
const RIPPLE_MS = 700;
const NO_DASH = [];
const GHOST_DASH = [6, 5];
const ROOM = 1.14; // of the reach, so that circles and labels have space
const EFFORT_RADIUS = 19; // px

const x = new Float64Array(MOST_LINKS + 1);
const y = new Float64Array(MOST_LINKS + 1);
const load = new Float64Array(MOST_LINKS);
const drawn = { position: new Float64Array(MOST_LINKS), velocity: new Float64Array(MOST_LINKS), effort: new Float64Array(MOST_LINKS) };
const REST = new Float64Array(MOST_LINKS); // stretched along +x, where the gravity load is largest
const calm = matchMedia("(prefers-reduced-motion: reduce)");

let surface;
let context;
let backdrop; // grid and circles, drawn once per size
let behind; // the same with the trail
let behindTime = NaN;
let stale = true;
let behindStale = true;
let fullEffort = 1; // N m, all that gravity could ask for
let reachedAt = -Infinity;
let scale = 100; // pixels per metre
let arrows = false; // whether velocities are drawn
/** Where the pointer aims, while it does: { x, y, phi, mode, refused }; see `aim.js`. */
let aim = null;

export function startArmView(canvas) {
  backdrop = document.createElement("canvas");
  behind = document.createElement("canvas");
  surface = new Surface(canvas, resized);
  context = surface.context;
  onTheme(resized);
  watch("params", resized);
  watch("links", resized);
  watch("setpoint", () => { follow(); redraw(); });
  watch("playback", redraw);
  for (const key of ["joint", "enabled"]) watch(key, redraw);
  let diverged = false;
  watch("diagnostics", ({ state: now }) => {
    if ((now === "diverged") !== diverged) redraw();
    diverged = now === "diverged";
  });
  watch("goal", (goal) => {
    if (goal?.outcome === "reached") reachedAt = performance.now();
    redraw();
  });
  byId("arrows").addEventListener("change", (event) => {
    arrows = event.target.checked;
    redraw();
  });
  onFrame(drawArm);
}

export function redraw() {
  stale = true;
  behindStale = true;
  wake();
}

/** The trail moves on, if time does; between, only its latest piece is drawn. */
export function redrawTrail() {
  if (behindTime !== shown.time) redraw();
}

/** Whether the arm would be seen otherwise than it was drawn last. */
export function hasMoved() {
  const pixels = scale * reach(lengths());
  for (let i = 0; i < state.links; i += 1) {
    const change = Math.abs(shown.position[i] - drawn.position[i]) * pixels;
    const arrow = arrows ? Math.abs(shown.velocity[i] - drawn.velocity[i]) * ARROW_SECONDS * pixels : 0;
    const sweep = Math.abs(shown.effort[i] - drawn.effort[i]) * (Math.PI / fullEffort) * EFFORT_RADIUS;
    if (!(change < SEEN && arrow < SEEN && sweep < SEEN)) return true;
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
  drawBackdrop(backdrop, surface, scale, lengths(), state.params?.gravity ?? 0);
  redraw();
}

/** Metres from the base, for a place on the canvas in CSS pixels; rounded to a tenth of a millimetre. */
export function toWorld(px, py) {
  const round = (value) => Math.round(value * 1e4) / 1e4;
  return { x: round((px - surface.width / 2) / scale), y: round((surface.height / 2 - py) / scale) };
}

/** Where the end effector is [m]. */
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

/** Gives whether something moves on by itself. */
function drawArm(now) {
  const ripple = !calm.matches && now - reachedAt < RIPPLE_MS;
  if (!stale && !ripple && !hasMoved()) return false;
  stale = ripple; // one frame more after the last of it
  for (const name of /** @type {const} */ (["position", "velocity", "effort"])) drawn[name].set(shown[name]);
  const { width, height } = surface;
  context.globalAlpha = 1;
  context.setLineDash(NO_DASH);
  const n = state.links;
  const known = n > 0 && state.params?.lengths.length === n;
  if (known && behindStale) paintBehind(n);
  context.drawImage(known ? behind : backdrop, 0, 0, width, height);
  if (!known) return false;
  context.lineCap = "round";
  context.lineJoin = "round";
  drawLatest(context, n, lengths(), px, py, behindTime, shown.time);
  drawTarget(n, ripple ? (now - reachedAt) / RIPPLE_MS : 1);
  drawLinks(n);
  return ripple;
}

/** Paints all that lies behind the arm: the backdrop, the trail up to now and the setpoint's ghost. Between two paintings the trail's
 * latest piece is drawn on each frame. */
function paintBehind(n) {
  behindStale = false;
  const paint = behind.getContext("2d", { alpha: false });
  paint.resetTransform();
  paint.globalAlpha = 1;
  paint.drawImage(backdrop, 0, 0);
  paint.setTransform(context.getTransform());
  drawTrail(paint, n, lengths(), px, py, shown.time);
  if (shown.setpointKnown) drawGhost(paint, n);
  behindTime = shown.time;
}

function drawGhost(paint, n) {
  joints(n, shown.setpoint, lengths(), x, y);
  paint.lineCap = "round";
  paint.lineJoin = "round";
  paint.strokeStyle = colors.muted;
  paint.lineWidth = 2;
  paint.globalAlpha = state.enabled ? 0.9 : 0.5;
  paint.setLineDash(GHOST_DASH);
  paint.beginPath();
  paint.moveTo(px(0), py(0));
  for (let i = 1; i <= n; i += 1) paint.lineTo(px(x[i]), py(y[i]));
  paint.stroke();
  paint.setLineDash(NO_DASH);
  for (let i = 1; i <= n; i += 1) {
    paint.beginPath();
    paint.arc(px(x[i]), py(y[i]), 4, 0, 2 * Math.PI);
    paint.stroke();
  }
  paint.globalAlpha = 1;
}

function drawTarget(n, ripple) {
  const { goal } = state;
  const shown = aim?.mode === "goal" ? aim : goal?.target;
  if (shown) {
    const done = !aim && goal?.outcome !== "active";
    const color = aim?.refused ? colors.bad : done && goal?.outcome === "reached" ? colors.good : colors.target;
    if (!aim && goal?.outcome === "active") drawWay(n, shown, color);
    drawCross(shown, goal?.epsilon ?? DEFAULT_EPSILON, color, done ? 0.75 : 1);
    if (ripple < 1) {
      context.globalAlpha = 1 - ripple;
      circle(shown.x, shown.y, 8 + 34 * ripple);
    }
  }
  if (aim?.mode === "setpoint" || (aim?.mode === "arm" && aim.refused)) drawCross(aim, 0, aim.refused ? colors.bad : colors.ink, 1);
  context.globalAlpha = 1;
}

/** A thin line of what is left to go. */
function drawWay(n, target, color) {
  joints(n, shown.position, lengths(), x, y);
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
  joints(n, shown.position, l, x, y);
  const room = Math.min(1, Math.min(surface.width, surface.height) / 420); // smaller on a telephone
  for (let i = 0; i < n; i += 1) {
    // Heavier rods of the same length are drawn thicker, within reason.
    const thickness = room * Math.min(26, Math.max(7, 14 * Math.sqrt(state.params.masses[i] / l[i])));
    bar(i, thickness + 4, colors.panel);
    bar(i, thickness, diverged ? colors.bad : colors.joints[i]);
  }
  base(room);
  for (let i = 0; i < n; i += 1) pivot(i, room);
  drawEfforts(n, room);
  if (arrows) drawVelocities(context, n, shown.velocity, x, y, px, py);
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
function drawEfforts(n, room) {
  context.lineWidth = 3;
  for (let i = 0; i < n; i += 1) {
    const effort = shown.effort[i];
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
