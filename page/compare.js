// @ts-check
// Any number of integrators and timesteps against a reference: the same arm, from the same state, computed offline by the
// runtime, drawn over one another and played back together, with error, energy and a joint's angle over time.
// Invariant: the runs that are compared are the runtime's answers; the live arm is not touched. All are shown at the same instant; a
// run that ends early is drawn as far as it goes, its last pose as a ghost.

import { Chart, circle, links as drawLinks } from "./chart.js";
import { announce, byId, el, fillTable, setText } from "./dom.js";
import { busy, option, panel } from "./field.js";
import { duration, fixed, METHODS, shortName, significant } from "./format.js";
import { joints, reach } from "./mechanics.js";
import { commonSamples, describeRun, distances, divergedAt, partsAt, resample } from "./ladder.js";
import { rollout } from "./runtime.js";
import { Axis, LogScale, times } from "./scale.js";
import { MOST_LINKS, state, watch } from "./store.js";
import { onFrame, Surface, wake } from "./surface.js";
import { colors } from "./theme.js";

const MOST_RUNS = 6;
/** The reference is Runge-Kutta 4 at this part of the smallest timestep. */
const REFERENCE_PART = 1 / 8;
const PARTED = 0.1; // rad: from there on it is another motion

const SECONDS = 5; // where no duration is given

let view;
let said;
let rows = [];
const seconds = option({ label: "duration", unit: "s", value: SECONDS, placeholder: String(SECONDS) });
const from = option({ label: "start", choices: [["now", "as it is"], ["rest", "stretched out"]] });
const controller = option({ label: "controller", choices: [["off", "off"], ["on", "on"]] });

export function startCompare() {
  said = panel(byId("compare-form"), [seconds, from, controller], [
    ["Compare", () => busy(said.buttons[0], "Reckoning…", compare), { type: "submit", class: "primary" }],
    ["Add a run", () => addRow("rk4", 0.001), { id: "compare-add", class: "small" }],
  ]);
  addRow("euler", 0.01);
  addRow("rk4", 0.01);
  view = new CompareView();
  watch("links", () => { byId("compare-result").hidden = true; });
}

function addRow(method, timestep) {
  if (rows.length >= MOST_RUNS) return;
  const choice = el("select", { "aria-label": "integrator" }, ...METHODS.map(([value]) => el("option", { value }, shortName(value))));
  choice.value = method;
  const step = el("input", { type: "number", step: "any", inputmode: "decimal", "aria-label": "timestep", value: timestep });
  const remove = el("button", { type: "button", class: "small", "aria-label": "remove this run", onclick: () => drop(row) }, "✕");
  const element = el("div", { class: "side" }, choice, step, el("span", { class: "unit" }, "s"), remove);
  const row = { choice, step, element };
  rows.push(row);
  byId("compare-rows").append(element);
  number();
}

function drop(row) {
  if (rows.length === 1) return;
  rows = rows.filter((one) => one !== row);
  row.element.remove();
  number();
}

function number() {
  rows.forEach(({ element }, i) => { element.className = `side run${i + 1}`; });
  byId("compare-add").disabled = rows.length >= MOST_RUNS;
}

function request(method, timestep, samples) {
  const n = state.links;
  const still = from.input.value === "rest";
  const zero = new Array(n).fill(0);
  return {
    q0: still ? zero : Array.from(state.position.subarray(0, n)),
    qdot0: still ? zero : Array.from(state.velocity.subarray(0, n)),
    duration: lasting(),
    timestep,
    integrator: method,
    params: state.params,
    samples,
    ...(controller.input.value === "on" ? { gains: state.gains, setpoint: Array.from(state.setpoint.subarray(0, n)) } : {}),
  };
}

/** How long the runs last [s]. */
const lasting = () => seconds.number() ?? SECONDS;

async function compare() {
  if (state.links === 0 || !state.params) {
    said.show("There is no arm to compare with: not connected.");
    return;
  }
  const wanted = rows.map(({ choice, step }) => [choice.value, step.value === "" ? state.integrator?.timestep : Number(step.value)]);
  const finest = Math.min(...wanted.map(([, timestep]) => timestep)) * REFERENCE_PART;
  wanted.push(["rk4", finest]);
  const samples = commonSamples(lasting(), wanted.map(([, timestep]) => timestep));
  const requests = wanted.map(([method, timestep]) => request(method, timestep, samples));
  const answers = await Promise.all(requests.map((args) => rollout(args)));
  const failed = answers.findIndex((answer) => !answer.result);
  if (failed >= 0) {
    const answer = answers[failed];
    const name = failed < rows.length ? `run ${failed + 1}` : "the reference";
    said.show(`${name}: ${answer.status}`);
    return;
  }
  said.show("");
  const runs = answers.map(({ values }, i) => ({ ...values, method: requests[i].integrator, timestep: requests[i].timestep }));
  const reference = runs.pop();
  const away = runs.map((run) => distances(run, reference));
  byId("compare-result").hidden = false;
  view.show(runs, away, reference, state.params.lengths, state.links, lasting());
  showTable(runs, away, reference);
}

function showTable(runs, away, reference) {
  const lasted = lasting();
  const columns = [["outcome", "outcome"], ["energy", "energy gained"], ["error", "largest error"], ["evaluations", "evaluations"], ["time", "run time"]];
  const lines = runs.map((run, i) => describeRun(run, away[i], lasted));
  fillTable(byId("compare-table"), ["run", ...columns.map(([, name]) => name)], lines.map((line, i) => [[line.name, `run${i + 1}`], ...columns.map(([key]) => line[key])]));
  const words = runs.map((run, i) => {
    const ended = divergedAt(run, lasted);
    const parts = partsAt(reference.times, away[i], PARTED);
    if (ended !== null) return `${lines[i].name} diverged at t = ${fixed(ended, 2)} s`;
    return parts === null ? `${lines[i].name} stays within ${PARTED} rad` : `${lines[i].name} is ${PARTED} rad off after ${fixed(parts, 2)} s`;
  });
  const text = `Against Runge–Kutta 4 at ${duration(reference.timestep)}: ${words.join("; ")}.`;
  setText(byId("compare-text"), text);
  announce(text);
}

const x = new Float64Array(MOST_LINKS + 1);
const y = new Float64Array(MOST_LINKS + 1);
/** Errors smaller than this are rounding [rad]. */
const SMALLEST = 1e-13;
const ROOM = { left: 50 };

class CompareView {
  constructor() {
    this.runs = [];
    this.times = [];
    this.lengths = [];
    this.links = 0;
    this.seconds = 0;
    this.at = 0;
    this.playing = false;
    this.began = 0;
    this.scrub = byId("compare-scrub");
    this.play = byId("compare-play");
    const angle = (run) => run.poses.map((q) => (q ? q[state.joint] : null));
    const pictures = /** @type {[string, (surface: Surface) => void][]} */ ([
      ["arm", (surface) => this.drawArms(surface)],
      ["chart", (surface) => this.drawLines(surface, () => this.times, (run) => run.away ?? [], this.errors())],
      ["energy", (surface) => this.drawLines(surface, (run) => run.energy.times, (run) => run.energy.values, new Axis(3, 0.1, 5000))],
      ["angle", (surface) => this.drawLines(surface, () => this.times, angle, new Axis(3, 0.1, 300))],
    ]);
    this.surfaces = pictures.map(([id, paint]) => {
      const surface = new Surface(byId(`compare-${id}`), () => { if (this.times.length > 0) paint(surface); });
      return surface;
    });
    watch("joint", () => this.redraw());
    this.scrub.addEventListener("input", () => {
      this.stop();
      this.at = Number(this.scrub.value);
      this.redraw();
    });
    this.play.addEventListener("click", () => (this.playing ? this.stop() : this.start()));
    onFrame((now) => this.playOn(now));
  }

  redraw() {
    for (const surface of this.surfaces) surface.redraw();
    if (this.times.length === 0) return;
    setText(byId("compare-joint"), String(state.joint + 1));
    const words = this.runs.filter(({ isReference }) => !isReference).map(({ away }) => (away[this.at] === null ? "ended" : `${significant(away[this.at], 3)} rad`));
    this.scrub.setAttribute("aria-valuetext", `${significant(this.times[this.at], 3)} s, errors ${words.join(", ")}`);
  }

  /** Takes the runs, how far each is from the reference at the reference's instants, and the reference. */
  show(runs, away, reference, lengths, links, seconds) {
    Object.assign(this, { lengths, links, seconds, times: reference.times });
    this.runs = [...runs, reference].map((run, i) => {
      const poses = resample(run, this.times);
      const trail = poses.map((q) => {
        if (!q) return null;
        joints(links, q, lengths, x, y);
        return [x[links], y[links]];
      });
      const isReference = i === runs.length;
      return { energy: { times: run.times, values: run.energy }, away: away[i], poses, trail, isReference, last: poses.findLastIndex((q) => q !== null), color: isReference ? "muted" : `run${i + 1}` };
    });
    this.scrub.max = String(this.times.length - 1);
    this.at = 0;
    this.start();
  }

  start() {
    if (this.times.length < 2) return;
    if (this.at >= this.times.length - 1) this.at = 0;
    this.playing = true;
    this.began = performance.now() - 1000 * this.times[this.at];
    setText(this.play, "Pause");
    wake();
  }

  stop() {
    this.playing = false;
    setText(this.play, "Play");
  }

  /** Gives whether it plays on. */
  playOn(now) {
    if (!this.playing || state.tab !== "compare") return false;
    const time = (now - this.began) / 1000;
    while (this.at < this.times.length - 1 && this.times[this.at] < time) this.at += 1;
    this.scrub.value = String(this.at);
    if (this.at >= this.times.length - 1) this.stop();
    this.redraw();
    return this.playing;
  }

  drawArms({ context, width, height }) {
    const scale = Math.min(width, height) / (2.2 * reach(this.lengths));
    const px = (metres) => width / 2 + metres * scale;
    const py = (metres) => height / 2 - metres * scale;
    context.lineCap = "round";
    context.lineJoin = "round";
    circle(context, px(0), py(0), reach(this.lengths) * scale, "", colors.line);
    context.globalAlpha = 0.4;
    context.lineWidth = 1.25;
    for (const { trail, color } of this.runs) {
      context.strokeStyle = colors[color];
      context.beginPath();
      for (let i = 0, down = false; i <= this.at; i += 1) {
        const place = trail[i];
        if (place && down) context.lineTo(px(place[0]), py(place[1]));
        else if (place) context.moveTo(px(place[0]), py(place[1]));
        down = place !== null;
      }
      context.stroke();
    }
    this.runs.forEach(({ poses, last, color }, k) => {
      const ended = this.at > last;
      const q = poses[ended ? last : this.at];
      if (!q) return;
      joints(this.links, q, this.lengths, x, y);
      context.globalAlpha = ended ? 0.25 : 0.85;
      drawLinks(context, this.links, x, y, px, py, colors[color], 3 + 2 * (this.runs.length - k)); // where they agree, all are seen
    });
    context.globalAlpha = 1;
  }

  /** From the smallest error that is no rounding to the largest. */
  errors() {
    const values = this.runs.flatMap(({ away }) => away ?? []).filter((one) => one !== null && one > SMALLEST);
    const high = 10 ** Math.ceil(Math.log10(Math.max(1e-9, ...values)));
    const scale = new LogScale(Math.max(SMALLEST, Math.min(high / 100, 10 ** Math.floor(Math.log10(Math.min(1, ...values))))), high, []);
    scale.marks = scale.powers(6, (value) => significant(value, 1));
    return { ...scale, place: (value) => scale.place(Math.max(value, scale.low)) };
  }

  /** @param {Surface} surface @param {(run: any) => number[]} timesOf @param {(run: any) => (number | null)[]} valuesOf @param {any} scale */
  drawLines({ context, width, height }, timesOf, valuesOf, scale) {
    if (scale instanceof Axis) {
      const values = this.runs.flatMap(valuesOf).filter((one) => one !== null && !Number.isNaN(one));
      scale.fit(Math.min(...values), Math.max(...values));
    }
    const chart = new Chart(context, width, height, times(0, this.seconds), scale, ROOM);
    chart.frame();
    chart.inside(() => {
      for (const run of this.runs) {
        const values = valuesOf(run);
        chart.line(values.length, (i) => timesOf(run)[i], (i) => values[i], colors[run.color], { width: 1.5 });
      }
      chart.upright(this.times[this.at], colors.accent);
    });
  }
}
