// @ts-check
// Error against run time, live: all methods over a ladder of timesteps, on a fixed move of this arm.
// Invariant: every point is a run of the runtime's own, with the settings that are named beside it; a diverged run is a cross.

import { announce } from "./announce.js";
import { byId, el, setText } from "./dom.js";
import { option, refusal } from "./field.js";
import { METHODS, duration, methodName, significant } from "./format.js";
import { wake } from "./frames.js";
import { TIMESTEPS, cheapest, errorText, read, rungs, uncertaintyOf } from "./ladder.js";
import { rollout } from "./runtime.js";
import { LogScale } from "./scale.js";
import { state, watch } from "./store.js";
import { Surface } from "./surface.js";
import { colors, onTheme } from "./theme.js";

const LEFT = 58;
const RIGHT = 12;
const TOP = 8;
const BOTTOM = 32;
const SAMPLES = 101;
const WANTED = 1e-3; // rad: the accuracy that the sentence speaks of
const INVITATION = "Runs one move of this arm with every method at eight timesteps, and compares each with the true motion: what does accuracy cost?";
/** The move with the controller on, from rest at zero [rad]. */
const REACH = [0.9, -1.3, 0.8];

let surface;
let said;
let go;
let seconds;
let servo;
let found = [];
let measured = ""; // the settings that the runs have
let running = 0; // counts the measurements that were begun; only the newest goes on

export function startLadder() {
  surface = new Surface(byId("ladder"), draw);
  onTheme(draw);
  seconds = option({ label: "duration", unit: "s", value: 2 });
  servo = el("select", {}, el("option", { value: "off" }, "off"), el("option", { value: "on" }, "on"));
  go = el("button", { type: "submit", class: "primary" }, "Measure");
  said = refusal(go);
  byId("ladder-form").append(el("div", { class: "compare-row" }, seconds.element, el("label", { class: "option" }, el("span", {}, "servo"), servo), go), said.element);
  byId("ladder-form").addEventListener("submit", (event) => { event.preventDefault(); measure(); });
  setText(byId("ladder-text"), INVITATION);
  for (const cause of ["links", "params", "gains"]) { // what was measured is of another arm
    watch(cause, () => { if (cause === "links" || measured !== "" && measured !== settings()) forget(INVITATION); });
  }
}

/** No figure is shown, and none that is on its way will be. @param {string} text what stands there instead */
function forget(text) {
  running += 1;
  found = [];
  measured = "";
  setText(go, "Measure");
  setText(byId("ladder-text"), text);
  byId("ladder-table").replaceChildren();
  draw();
}

/** The settings that a run depends on, as a text. */
function settings() {
  return JSON.stringify([state.links, state.params, servo.value === "on" ? state.gains : null]);
}

/** The move in words. */
function moveText() {
  const zero = `(${new Array(state.links).fill(0).join(", ")})`;
  return servo.value === "on" ? `From rest at ${zero} to (${REACH.slice(0, state.links).join(", ")}) rad with the present gains, the law once a step`
    : `A free swing from rest at ${zero}`;
}

async function measure() {
  if (state.links === 0 || !state.params) {
    said.show("There is no arm to measure: not connected.");
    return;
  }
  said.show("");
  forget("");
  const mine = running;
  measured = settings();
  setText(go, "Measuring…");
  const n = state.links;
  const common = {
    q0: new Array(n).fill(0), qdot0: new Array(n).fill(0),
    duration: seconds.number() ?? 2, params: state.params, samples: SAMPLES, reference: true,
    ...(servo.value === "on" ? { gains: state.gains, setpoint: REACH.slice(0, n), control_period: 0 } : {}),
  };
  for (const rung of rungs()) {
    const args = { ...common, integrator: rung.method, timestep: rung.timestep };
    const answer = await rollout(args);
    if (mine !== running) return;
    if (!answer.result) {
      said.show(answer.status);
      break;
    }
    // The shorter of two times: whatever else the machine did in between has no part in it.
    const again = await rollout({ ...args, reference: false });
    const wall = Math.min(answer.values.wall_time, again.values.wall_time ?? Infinity);
    found.push(read(rung, { ...answer.values, wall_time: wall }, common.duration));
    draw();
  }
  setText(go, "Measure");
  describe();
}

function describe() {
  const text = found.length > 0 ? `${inWords(cheapest(found, WANTED))}${samplingText()} ${moveText()}.` : INVITATION;
  setText(byId("ladder-text"), text);
  if (found.length === 0) return;
  announce(text);
  byId("ladder-table").replaceChildren(
    el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "timestep"), ...METHODS.map(([, name], i) => el("th", { scope: "col", class: `run${i + 1}` }, name)))),
    el("tbody", {}, ...TIMESTEPS.map((timestep) => el("tr", {}, el("th", { scope: "row" }, duration(timestep)),
      ...METHODS.map(([method]) => el("td", {}, cellOf(method, timestep)))))),
  );
}

/** @param {import("./ladder.js").Rung[]} best of each method the cheapest run that is good enough */
function inWords(best) {
  if (best.length === 0) return `No run came within ${WANTED} rad of the reference: shorten the duration.`;
  const cheap = best.reduce((a, b) => (b.wall < a.wall ? b : a));
  const uncertainty = uncertaintyOf(found);
  return `For ${WANTED} rad ${methodName(cheap.method)} costs least here: ${duration(cheap.wall)} of run time, at a timestep of ${duration(cheap.timestep)}. A steeper line gains more from a smaller step: `
    + "halving it halves Euler’s error, quarters midpoint’s and Verlet’s, and cuts Runge–Kutta’s to a sixteenth, until rounding ends it."
    + (uncertainty === null ? "" : ` The reference itself is known to ${significant(uncertainty, 1)} rad.`);
}

/** What holding the effort costs, at the shortest timestep that was run; empty for a free arm. */
function samplingText() {
  const known = found.filter(({ sampling }) => sampling > 0);
  const last = known.at(-1);
  return last ? ` No method helps against the other error (dashed): a law that runs every ${duration(last.timestep)} moves the arm ${significant(last.sampling, 2)} rad from one that acts at every instant.` : "";
}

function cellOf(method, timestep) {
  const one = found.find((rung) => rung.method === method && rung.timestep === timestep);
  return one ? errorText(one) : "–";
}

function draw() {
  wake(); // other pictures may be waiting; this one is cheap and rare
  if (!surface || surface.width === 0) return;
  const { context, width, height } = surface;
  surface.clear();
  const points = found.filter(({ error, wall }) => error !== null && error > 0 && wall > 0);
  if (points.length === 0) return;
  const bounds = (values) => new LogScale(10 ** Math.floor(Math.log10(Math.min(...values))), 10 ** Math.ceil(Math.log10(Math.max(...values) * 1.01)));
  const across = bounds(points.map(({ wall }) => wall));
  const sampled = found.filter(({ sampling, wall }) => sampling > 0 && wall > 0);
  const up = bounds([...points.map(({ error }) => error), ...sampled.map(({ sampling }) => sampling)]);
  const x = (wall) => LEFT + across.place(wall) * (width - LEFT - RIGHT);
  const y = (error) => height - BOTTOM - up.place(error) * (height - TOP - BOTTOM);
  drawFrame(context, width, height, across, up, x, y);
  METHODS.forEach(([method], i) => {
    const own = points.filter((one) => one.method === method);
    context.strokeStyle = colors.runs[i];
    context.fillStyle = colors.runs[i];
    context.lineWidth = 1.75;
    context.beginPath();
    for (const { wall, error } of own) context.lineTo(x(wall), y(error));
    context.stroke();
    for (const { wall, error } of own) {
      context.beginPath();
      context.arc(x(wall), y(error), 3.5, 0, 2 * Math.PI);
      context.fill();
    }
    context.setLineDash([4, 4]);
    context.beginPath();
    for (const { wall, sampling } of sampled.filter((one) => one.method === method)) context.lineTo(x(wall), y(sampling));
    context.stroke();
    context.setLineDash([]);
    // A diverged run has no error: a cross at the upper edge.
    for (const { wall } of found.filter((one) => one.method === method && one.divergedAt !== null && one.wall > 0)) {
      const at = Math.min(Math.max(x(wall), LEFT), width - RIGHT);
      context.beginPath();
      context.moveTo(at - 4, TOP);
      context.lineTo(at + 4, TOP + 8);
      context.moveTo(at + 4, TOP);
      context.lineTo(at - 4, TOP + 8);
      context.stroke();
    }
    const last = own.at(-1);
    if (!last) return;
    context.font = "700 12px system-ui, sans-serif";
    context.textAlign = "left";
    context.fillText(methodName(method)[0], Math.min(width - 14, x(last.wall) + 7), y(last.error) + 4);
  });
}

function drawFrame(context, width, height, across, up, x, y) {
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = colors.muted;
  context.strokeStyle = colors.grid;
  context.lineWidth = 1;
  context.textAlign = "center";
  for (const tick of across.ticks(6)) {
    context.beginPath();
    context.moveTo(x(tick), TOP);
    context.lineTo(x(tick), height - BOTTOM);
    context.stroke();
    context.fillText(duration(tick), Math.min(x(tick), width - 22), height - 18);
  }
  context.fillText("run time of the computation (upwards: error [rad])", LEFT + (width - LEFT - RIGHT) / 2, height - 4);
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const tick of up.ticks(8)) {
    context.beginPath();
    context.moveTo(LEFT, y(tick));
    context.lineTo(width - RIGHT, y(tick));
    context.stroke();
    context.fillText(significant(tick, 2), LEFT - 5, y(tick));
  }
  context.textBaseline = "alphabetic";
}
