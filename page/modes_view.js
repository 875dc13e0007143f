// @ts-check
// The loop's modes, twice: by what one step multiplies them (inside the unit circle they die away), and as timestep times
// eigenvalue in the method's region of stability, as if control acted in every stage.
// Invariant: both are of the loop in force, and follow the timestep's slider while it is dragged.

import { byId, setText } from "./dom.js";
import { duration, methodName, significant } from "./format.js";
import { onFrame, wake } from "./frames.js";
import { loopInForce } from "./growth.js";
import { eigenvalues } from "./eigen.js";
import { amplification, flow, multipliers } from "./loop.js";
import { state, watch } from "./store.js";
import { Surface } from "./surface.js";
import { colors, onTheme } from "./theme.js";

/** The part of the complex plane that is seen: middle and half of the width. */
const CIRCLE = { re: -0.4, half: 1.5 };
const REGION = { re: -1.2, half: 3.2 };
const MARGIN = 4;

let circle;
let region;
let stale = true;
let regionKey = "";
const regionPicture = document.createElement("canvas");

export function startModes() {
  circle = new Surface(byId("circle"), redraw);
  region = new Surface(byId("region"), () => { regionKey = ""; redraw(); });
  onTheme(() => { regionKey = ""; redraw(); });
  for (const key of ["integrator", "gains", "params", "setpoint", "stability", "enabled", "tab", "links"]) watch(key, redraw);
  onFrame(draw);
}

function redraw() {
  stale = true;
  wake();
}

function draw() {
  if (!stale || state.tab !== "stability" || circle.width === 0) return false;
  stale = false;
  const found = loopInForce(state);
  const { integrator } = state;
  if (!found || !integrator) return false;
  drawCircle(multipliers(found.loop, integrator.method, integrator.timestep) ?? []);
  drawRegion(eigenvalues(flow(found.loop)) ?? [], integrator);
  return false;
}

/** Where a complex number is on a surface: CSS pixels. What lies outside is put at the edge. */
function place(surface, view, { re, im }) {
  const scale = Math.min(surface.width, surface.height) / 2 / view.half;
  const inside = (value, size) => Math.min(size - MARGIN, Math.max(MARGIN, value));
  const x = surface.width / 2 + (re - view.re) * scale;
  const y = surface.height / 2 - im * scale;
  const seen = x >= MARGIN && x <= surface.width - MARGIN && y >= MARGIN && y <= surface.height - MARGIN;
  return { x: inside(x, surface.width), y: inside(y, surface.height), seen, scale };
}

function axes(surface, view) {
  const { context, width, height } = surface;
  const zero = place(surface, view, { re: 0, im: 0 });
  context.strokeStyle = colors.line;
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(0, zero.y);
  context.lineTo(width, zero.y);
  context.moveTo(zero.x, 0);
  context.lineTo(zero.x, height);
  context.stroke();
  return zero;
}

function dots(surface, view, values, isStable) {
  const { context } = surface;
  for (const one of values) {
    const { x, y, seen } = place(surface, view, one);
    context.fillStyle = isStable(one) ? colors.accent : colors.bad;
    context.strokeStyle = context.fillStyle;
    context.lineWidth = 2;
    context.beginPath();
    context.arc(x, y, 4.5, 0, 2 * Math.PI);
    if (seen) context.fill();
    else context.stroke(); // hollow: it lies beyond the edge
  }
}

function drawCircle(values) {
  const { context } = circle;
  circle.clear();
  const zero = place(circle, CIRCLE, { re: 0, im: 0 });
  context.fillStyle = colors.stable;
  context.beginPath();
  context.arc(zero.x, zero.y, zero.scale, 0, 2 * Math.PI);
  context.fill();
  axes(circle, CIRCLE);
  context.strokeStyle = colors.ink;
  context.lineWidth = 1.5;
  context.beginPath();
  context.arc(zero.x, zero.y, zero.scale, 0, 2 * Math.PI);
  context.stroke();
  dots(circle, CIRCLE, values, ({ re, im }) => Math.hypot(re, im) <= 1 + 1e-12);
  label(context, "1", zero.x + zero.scale + 4, zero.y - 4);
  label(context, "−1", zero.x - zero.scale + 4, zero.y - 4);
  const largest = Math.max(...values.map(({ re, im }) => Math.hypot(re, im)));
  const flips = values.some(({ re, im }) => Math.abs(im) < 1e-9 && re < -0.5 && Math.abs(-re - largest) < 1e-9);
  const { timestep } = state.integrator;
  setText(byId("circle-text"), `${state.enabled ? "The servo’s loop" : "The arm left to itself"}: each dot is a mode, multiplied by that number at every step of ${duration(timestep)}. `
    + (largest > 1 + 1e-12
      ? `The largest is ${significant(largest, 5)}: that deviation grows${flips ? ", flipping its sign at every step" : ""}.`
      : `All lie within the circle (largest ${significant(largest, 4)}): every small deviation dies away${largest > 1 - 1e-9 ? ", or just stays" : ""}.`));
}

function drawRegion(values, { method, timestep }) {
  const { context, width, height } = region;
  region.clear();
  paintRegion(method);
  context.drawImage(regionPicture, 0, 0, width, height);
  const zero = axes(region, REGION);
  label(context, "−2", place(region, REGION, { re: -2, im: 0 }).x - 8, zero.y - 4);
  label(context, "2i", zero.x + 4, place(region, REGION, { re: 0, im: 2 }).y + 4);
  const scaled = values.map(({ re, im }) => ({ re: timestep * re, im: timestep * im }));
  dots(region, REGION, scaled, ({ re, im }) => amplification(method, re, im) <= 1 + 1e-9);
  setText(byId("region-text"), `Control in every stage: ${methodName(method)} is stable while timestep × eigenvalue stays in the shaded region`
    + `${method === "verlet" ? " (for a swing; Verlet has no region for a single rate)" : ""}; the dots move away from 0 as the timestep grows.`);
}

/** The region is painted once per method, size and theme. */
function paintRegion(method) {
  const { width, height } = region;
  const key = `${method} ${width} ${height} ${colors.stable}`;
  if (key === regionKey) return;
  regionKey = key;
  regionPicture.width = width;
  regionPicture.height = height;
  const context = regionPicture.getContext("2d");
  context.fillStyle = colors.stable;
  const { x, y, scale } = place(region, REGION, { re: 0, im: 0 });
  for (let px = 0; px < width; px += 1) {
    for (let py = 0; py < height; py += 1) {
      if (amplification(method, (px + 0.5 - x) / scale, (y - py - 0.5) / scale) <= 1 + 1e-9) context.fillRect(px, py, 1, 1);
    }
  }
}

function label(context, text, x, y) {
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "left";
  context.textBaseline = "alphabetic";
  context.fillStyle = colors.muted;
  context.fillText(text, x, y);
}
