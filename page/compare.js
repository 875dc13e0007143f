// All methods at one timestep against a reference. The runtime computes the same arm from the same state offline. The runs are drawn together and played back
// together, with error, energy and a joint's angle over time. The panel Error has other timesteps.
// Invariant: the compared runs are the runtime's answers, and the live arm does not change. All are shown at the same time. A
// run that ends early is drawn up to its end, with its last pose as a ghost.

import { Chart, circle, links as drawLinks } from "./chart.js";
import { copyable } from "./copy.js";
import { announce, byId, fillTable, setText } from "./dom.js";
import { busy, option, panel, withoutFigure } from "./field.js";
import { duration, fixed, METHODS, significant } from "./format.js";
import { joints, reach } from "./mechanics.js";
import { fromRest, questionOf, rolloutArgs, withFixedPeriod } from "./question.js";
import { describeRun, distances, endOf } from "./ladder.js";
import { rollout } from "./runtime.js";
import { Axis, LogScale, powerOfTen, times } from "./scale.js";
import { known, MOST_LINKS, state, unknown, watch } from "./store.js";
import { onFrame, Surface, wake } from "./surface.js";
import { colors } from "./theme.js";

const REFERENCE_PART = 1 / 8; // the reference is Runge-Kutta 4 at this part of the timestep
const MOST_SAMPLES = 600; // enough samples for a smooth trail, few enough to draw at once
const SECONDS = 5; // default duration
const SMALLEST = 1e-13; // smaller errors are rounding [rad]
const ROOM = { left: 50 };
const COLUMNS = /** @type {const} */ ([["outcome", "outcome"], ["energy", "energy gained"], ["error", "largest error"], ["evaluations", "evaluations"],
  ["time", "run time"]]);

const x = new Float64Array(MOST_LINKS + 1);
const y = new Float64Array(MOST_LINKS + 1);

const timestep = option({ label: "timestep", unit: "ms", value: 10 });
const seconds = option({ label: "duration", unit: "s", value: SECONDS, placeholder: String(SECONDS) });
const from = option({ label: "start", choices: [["now", "as it is"], ["rest", "stretched out"]] });
const controller = option({ label: "controller", choices: [["off", "off"], ["on", "on"]] });
let said;
let surfaces = /** @type {Surface[]} */ ([]);
/**
 * The shown runs, with the reference last. @type {{color: string, away: (number | null)[] | null, times: number[], energy:
 * number[], poses: (number[] | null)[], trail: (number[] | null)[], last: number}[]}
 */
let runs = [];
let wanted = /** @type {import("./copy.js").Asked[]} */ ([]); // their requests
let instants = /** @type {number[]} */ ([]); // of the reference's samples [s]
let lengths = /** @type {number[]} */ ([]);
let at = 0; // the shown time
let playing = false;
let began = 0; // the clock at the first sample [ms]

export function startCompare() {
  said = panel(byId("compare-form"), [timestep, seconds, from, controller],
    [["Compare", () => busy(said.buttons[0], "Computing…", compare), { type: "submit", class: "primary" }]]);
  for (const picture of ["chart", "energy", "angle"]) copyable(byId(`compare-${picture}`).previousElementSibling, content);
  const pictures = /** @type {[string, (surface: Surface) => void][]} */ ([
    ["arm", drawArms],
    ["chart", (surface) => drawLines(surface, () => instants, ({ away }) => away ?? [], errorScale())],
    ["energy", (surface) => drawLines(surface, (run) => run.times, ({ energy }) => energy, new Axis(3, 0.1, 5000))],
    ["angle", (surface) => drawLines(surface, () => instants, ({ poses }) => poses.map((q) => (q ? q[state.joint] : null)), new Axis(3, 0.1, 300))],
  ]);
  surfaces = pictures.map(([id, paint]) => new Surface(byId(`compare-${id}`), (surface) => { if (instants.length > 0) paint(surface); }));
  watch("links", () => { byId("compare-result").hidden = true; });
  watch("joint", redraw);
  byId("compare-scrub").addEventListener("input", ({ target }) => {
    stop();
    at = Number(target.value);
    redraw();
  });
  byId("compare-play").addEventListener("click", () => (playing ? stop() : play()));
  onFrame(playOn);
}

async function compare() {
  const present = await known(() => questionOf({ ...state, enabled: controller.input.value === "on" }));
  if (!present) return said.show(unknown().status);
  const step = (timestep.number() ?? 1e3 * present.timestep) / 1e3;
  const asked = seconds.number() ?? SECONDS;
  // A whole number of steps between samples, so all runs are sampled at the same times. The runtime refuses wrong times.
  const steps = step > 0 && asked >= step ? asked / step : NaN;
  const every = Math.ceil(steps / MOST_SAMPLES);
  const intervals = Math.round(steps / every) || 1;
  const lasts = intervals * every * step || asked;
  // All runs have one controller, which acts at the same times, also in the reference.
  const common = withFixedPeriod({ ...(from.input.value === "rest" ? fromRest(present) : present), timestep: step });
  const run = { duration: lasts, samples: intervals + 1 };
  const questions = [...METHODS.map(([method]) => ({ integrator: method, timestep: step })), { integrator: "rk4", timestep: step * REFERENCE_PART }]
    .map((one) => ({ ...common, ...one }));
  const answers = await Promise.all(questions.map((one) => rollout(one, run)));
  const refused = answers.find((answer) => !answer.result);
  said.show(withoutFigure(refused?.status ?? ""));
  if (refused) return;
  const found = answers.map(({ values }, i) => ({ ...values, method: questions[i].integrator, timestep: questions[i].timestep }));
  wanted = questions.map((one) => rolloutArgs(one, run));
  const reference = found.pop();
  const away = found.map((run) => distances(run, reference));
  lengths = present.params.lengths;
  instants = reference.times;
  runs = [...found, reference].map((run, i) => ({ ...tracked(run), away: away[i] ?? null, color: i < found.length ? `method${i + 1}` : "muted" }));
  byId("compare-result").hidden = false;
  byId("compare-scrub").max = String(instants.length - 1);
  at = 0;
  play();
  showTable(found, away, reference, lasts);
}

/** The runs, to be copied: the errors, energies and angles over time. */
function content() {
  const columns = /** @type {[string, (run: any) => (number | null)[], string][]} */ ([
    ["error [rad]", ({ away }) => away ?? instants.map(() => 0), "max(abs(run.positions[k] - runs[-1].positions[k]))"],
    ["energy [J]", ({ energy }) => energy, "run.energy[k]"],
    [`joint ${state.joint + 1} [rad]`, ({ poses }) => poses.map((q) => q && q[state.joint]), `run.positions[k, ${state.joint}]`]]);
  return {
    name: "Comparison", columns: ["time [s]", ...columns.flatMap(([name]) => [...METHODS.map(([, run]) => run), "reference"].map((run) => `${run}, ${name}`))],
    asked: wanted,
    rows: instants.map((time, k) => [time, ...columns.flatMap(([, valuesOf]) => runs.map((run) => valuesOf(run)[k]))]),
    python: `((t, ${columns.map(([, , one]) => `*(${one} if k < len(run.times) else None for run in runs)`).join(", ")}) for k, t in enumerate(runs[4].times))`,
  };
}

/** A run with its poses, null where they are not finite, and the trail of its end effector [m]. */
function tracked({ times: own, positions, energy }) {
  const n = lengths.length;
  const poses = positions.map((q) => (q?.every(Number.isFinite) ? q : null));
  const trail = poses.map((q) => {
    if (!q) return null;
    joints(n, q, lengths, x, y);
    return [x[n], y[n]];
  });
  return { times: own, energy, poses, trail, last: poses.findLastIndex((q) => q !== null) };
}

function showTable(found, away, reference, lasted) {
  const lines = found.map((run, i) => describeRun(run, away[i]));
  fillTable(byId("compare-table"), ["method", ...COLUMNS.map(([, name]) => name)],
    lines.map((line, i) => [[line.name, `method${i + 1}`], ...COLUMNS.map(([key]) => line[key])]));
  const ended = endOf(reference);
  const text = `At ${duration(found[0].timestep)}, against Runge–Kutta 4 at ${duration(reference.timestep)}, for `
    + `${duration(lasted)}.${ended === null ? "" : ` The reference diverged after t = ${fixed(ended, 2)} s, so no error is known.`}`;
  setText(byId("compare-text"), text);
  announce(text);
}

// Playing them back

function redraw() {
  for (const surface of surfaces) surface.redraw();
  if (instants.length === 0) return;
  setText(byId("compare-joint"), String(state.joint + 1));
  const words = runs.flatMap(({ away }) => (away ? [away[at] == null ? "ended" : `${significant(away[at], 3)} rad`] : []));
  byId("compare-scrub").setAttribute("aria-valuetext", `${significant(instants[at], 3)} s, errors ${words.join(", ")}`);
}

function play() {
  if (instants.length < 2) return;
  if (at >= instants.length - 1) at = 0;
  playing = true;
  began = performance.now() - 1000 * instants[at];
  setText(byId("compare-play"), "Pause");
  wake();
}

function stop() {
  playing = false;
  setText(byId("compare-play"), "Play");
}

/** Returns whether it continues to play. */
function playOn(now) {
  if (!playing || state.tab !== "compare") return false;
  while (at < instants.length - 1 && instants[at] < (now - began) / 1000) at += 1;
  byId("compare-scrub").value = String(at);
  if (at >= instants.length - 1) stop();
  redraw();
  return playing;
}

// The pictures

function drawArms({ context, width, height }) {
  const scale = Math.min(width, height) / (2.2 * reach(lengths));
  const px = (metres) => width / 2 + metres * scale;
  const py = (metres) => height / 2 - metres * scale;
  context.lineCap = "round";
  context.lineJoin = "round";
  circle(context, px(0), py(0), reach(lengths) * scale, "", colors.line);
  context.globalAlpha = 0.4;
  context.lineWidth = 1.25;
  for (const { trail, color } of runs) {
    context.strokeStyle = colors[color];
    context.beginPath();
    for (const place of trail.slice(0, at + 1)) if (place) context.lineTo(px(place[0]), py(place[1]));
    context.stroke();
  }
  runs.forEach(({ poses, last, color }, k) => {
    const ended = at > last;
    const q = poses[ended ? last : at];
    if (!q) return;
    joints(lengths.length, q, lengths, x, y);
    context.globalAlpha = ended ? 0.25 : 0.85;
    drawLinks(context, lengths.length, x, y, px, py, colors[color], 3 + 2 * (runs.length - k)); // so equal runs are all visible
  });
  context.globalAlpha = 1;
}

function errorScale() {
  const values = runs.flatMap(({ away }) => away ?? []).filter((one) => one !== null && one > SMALLEST);
  return LogScale.around(values.length > 0 ? values : [SMALLEST], 6, powerOfTen);
}

/** @param {Surface} surface @param {(run: any) => number[]} timesOf @param {(run: any) => (number | null)[]} valuesOf @param {any} scale */
function drawLines(surface, timesOf, valuesOf, scale) {
  if (scale instanceof Axis) {
    const values = runs.flatMap(valuesOf).filter((one) => one !== null && !Number.isNaN(one));
    scale.fit(Math.min(...values), Math.max(...values));
  }
  const chart = new Chart(surface, times(0, instants.at(-1) ?? SECONDS), scale, ROOM);
  chart.frame();
  chart.inside(() => {
    for (const run of runs) {
      const values = valuesOf(run);
      chart.line(values.length, (i) => timesOf(run)[i], (i) => values[i], colors[run.color], { width: 1.5 });
    }
    chart.upright(instants[at], colors.accent);
  });
}
