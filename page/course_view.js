// @ts-check
// Shows the course, a step at a time: sets its scene, draws its chart, ticks its task, checks its answer.
// Invariant: the arm changes only when somebody clicks; a link that names a step shows it, and waits for Start.

import { remember, setScene } from "./actions.js";
import { announce } from "./announce.js";
import { ofLimit, nothingSeen, shrinks, stepIn, STEPS } from "./course.js";
import { drawBars, drawErrors, drawMap, drawPicture, FACTORS } from "./course_charts.js";
import { byId, el, setAddress, setText } from "./dom.js";
import { numberField } from "./field.js";
import { METHODS, shortName } from "./format.js";
import { onFrame, wake } from "./frames.js";
import { ENERGY, KINETIC, POTENTIAL, TIME, VELOCITY, record } from "./history.js";
import { MOVE_TO, rungs } from "./ladder.js";
import { drawLadder } from "./ladder_chart.js";
import { climb, settingsKey } from "./ladder_panel.js";
import { latestOnly } from "./latest.js";
import { controlPeriodLimit, limitInForce, question as loopQuestion, verdict } from "./policy.js";
import { rollout, setGains, setIntegrator, setParams, setPeriod, setState, stability, step as stepArm } from "./runtime.js";
import { SCENES, settingsOf } from "./scenes.js";
import { DEFAULTS } from "./settings.js";
import { showForm } from "./sheet.js";
import { state, watch, watchAll } from "./store.js";
import { StripChart } from "./strip_chart.js";
import { Surface } from "./surface.js";
import { onTheme } from "./theme.js";

const SHAKES = 2; // rad/s: beyond the limit, and seen to
const LOOKS = 14; // bars
const PUSH = 1e-6; // rad
const LOOK_MS = 500;
const STEPS_SHOWN = 40; // looks of the arm in slow motion
const ROWS = 13; // of the map's border
const SPAN = 5; // s of the strip chart
const ALL_JOINTS = [true, true, true];
/** Series of the strip chart. @type {Record<string, {column: number, perJoint: boolean, color?: string}[]>} */
const SERIES = {
  velocity: [{ column: VELOCITY, perJoint: true }],
  energy: [{ column: KINETIC, perJoint: false, color: "kinetic" }, { column: POTENTIAL, perJoint: false, color: "potential" }, { column: ENERGY, perJoint: false }],
};
/** @type {Record<string, string>} */
const CAPTIONS = {
  velocity: "Speed of the joints [rad/s]", energy: "Energy [J]: kinetic, potential, total in black", bars: "A push of a millionth of a radian, look by look",
  errors: "Two errors of one move", map: "Which period is stable", ladder: "Error over run time", pictures: "Thirty-nine scenes", form: "My arm",
};

let at = 0; // the step that is shown
let began = false; // whether it was started
let ready = false; // whether its scene is set: what is seen before is of another one
let guessed = -1;
let answered = -1;
let ticked = false;
let seen = nothingSeen();
let surface;
let strip;
let dial; // { field, show } of the present step
let bars = /** @type {number[]} */ ([]);
let errors = /** @type {{error: number | null, sampling: number | null} | null} */ (null);
let firstError = NaN;
let border = /** @type {{factor: number, limit: number}[]} */ ([]);
let runs = /** @type {import("./ladder.js").Rung[]} */ ([]);
let asked = ""; // the settings that the chart is about
let turn = 0; // counts the scenes that were set: only the newest goes on
let stripTime = NaN;
let stale = true;

export function startCourse() {
  surface = new Surface(byId("course-chart"), redraw);
  strip = new StripChart(byId("course-strip"), SERIES.velocity, 0.2, 300);
  strip.surface.onResize = redraw;
  onTheme(redraw);
  onFrame(draw);
  byId("course-back").addEventListener("click", () => go(at - 1));
  byId("course-next").addEventListener("click", () => go(at + 1));
  byId("course-start").addEventListener("click", begin);
  byId("course-steps").append(...STEPS.map((one, i) => el("button", {
    type: "button", class: "small", "aria-label": `Step ${i + 1}: ${one.title}`, title: one.title, onclick: () => go(i),
  }, String(i + 1))));
  at = Math.max(0, stepIn(location.hash));
  addEventListener("hashchange", () => { if (stepIn(location.hash) >= 0) { at = stepIn(location.hash); rest(); show(); } });
  watch("links", () => { rest(); show(); });
  watch("connection", (now) => { if (now !== "open") { rest(); show(); } });
  watch("view", redraw);
  watchAll(look);
  show();
}

/** The step that is shown, from 1; for links. */
export function presentStep() {
  return at + 1;
}

/** Ten times a second at most, while something changes. */
export function moveCourse() {
  if (state.view === "course" && stripTime !== (record.length > 0 ? record.data[record.last() + TIME] : NaN)) redraw();
}

function redraw() {
  stale = true;
  wake();
}

function rest() {
  turn += 1;
  began = false;
  ready = false;
  guessed = -1;
  answered = -1;
  ticked = false;
  seen = nothingSeen();
  bars = [];
  errors = null;
  firstError = NaN;
  runs = [];
  asked = "";
}

function go(to) {
  if (to < 0 || to >= STEPS.length) return;
  at = to;
  setAddress(`#step=${at + 1}`);
  begin();
  byId("course-title").focus();
}

/** Sets the scene of the step; done again, it begins anew. */
async function begin() {
  rest();
  const mine = turn;
  began = state.links > 0;
  show();
  if (!began) return;
  remember();
  const { scene, offset, paused } = STEPS[at];
  const refusals = await setScene(scene(state.links), paused ? true : false);
  if (mine !== turn) return;
  if (offset) await setState(offset.slice(0, state.links));
  setText(byId("course-status"), refusals.join(" "));
  if (mine !== turn) return;
  ready = true;
  byId("course-dial").inert = false;
  look();
  announce(`Step ${at + 1}: ${STEPS[at].title}. ${STEPS[at].text}`);
  if (paused) slowMotion(mine);
}

/** The arm takes two control steps a second. */
async function slowMotion(mine) {
  for (let k = 0; k < STEPS_SHOWN && mine === turn && state.view === "course"; k += 1) {
    await new Promise((done) => setTimeout(done, LOOK_MS));
    if (mine !== turn || state.view !== "course" || !state.paused || document.hidden) continue;
    await stepArm(Math.max(1, Math.round(period() / (state.integrator?.timestep ?? 1))));
  }
}

/** The time between two looks of the controller [s]. */
function period() {
  const timestep = state.integrator?.timestep ?? NaN;
  return Math.max(1, Math.round((state.period?.period ?? 0) / timestep)) * timestep;
}

/** The damping gains as a multiple of the usual ones. */
function damping() {
  const usual = DEFAULTS[state.links]?.gains?.kd?.[0];
  return usual && state.gains ? state.gains.kd[0] / usual : NaN;
}

// The visible parts

function show() {
  const one = STEPS[at];
  setText(byId("course-number"), `Step ${at + 1} of ${STEPS.length}`);
  setText(byId("course-title"), one.title);
  setText(byId("course-text"), one.text);
  setText(byId("course-caption"), CAPTIONS[one.chart]);
  setText(byId("course-status"), "");
  setText(byId("course-start"), began ? "Restart step" : "Start");
  byId("course-start").disabled = state.links === 0;
  byId("course-back").disabled = at === 0;
  byId("course-next").disabled = at === STEPS.length - 1;
  [...byId("course-steps").children].forEach((button, i) => { if (i === at) button.setAttribute("aria-current", "step"); else button.removeAttribute("aria-current"); });
  const onStrip = one.chart in SERIES;
  const isPicture = ["bars", "errors", "map", "ladder"].includes(one.chart);
  byId("course-strip").hidden = !onStrip;
  byId("course-chart").hidden = !isPicture;
  byId("course-chart").setAttribute("aria-label", CAPTIONS[one.chart]);
  if (onStrip) strip.series = SERIES[one.chart];
  byId("course-extra").replaceChildren();
  if (state.links > 0) fillExtra(one);
  makeDial(one);
  showTask();
  redraw();
}

function fillExtra(one) {
  const place = byId("course-extra");
  if (one.methods) {
    place.append(el("div", { class: "buttons course-methods", role: "group", "aria-label": "method" }, ...METHODS.map(([method]) => el("button", {
      type: "button", "data-method": method, "aria-pressed": String(method === state.integrator?.method), onclick: () => setIntegrator({ method }),
    }, shortName(method)))));
  }
  if (one.chart === "map") {
    place.append(el("div", { class: "buttons", role: "group", "aria-label": "mass of the last link" }, ...[0.5, 1, 4].map((mass) => el("button", {
      type: "button", class: "small", onclick: () => setLastMass(mass),
    }, `last link ${mass} kg`))));
  }
  if (one.chart === "ladder") place.append(el("button", { type: "button", class: "primary", id: "course-measure", onclick: measure }, "Measure"));
  if (one.chart === "pictures") showPictures(place);
  if (one.chart === "form") showForm(place, () => { seen.sheet = true; look(); });
}

function setLastMass(mass) {
  setParams({ masses: [...state.params.masses.slice(0, -1), mass] });
}

function showPictures(place) {
  const list = el("div", { class: "pictures" });
  place.append(list);
  for (const scene of SCENES) {
    const canvas = el("canvas", { "aria-hidden": "true" });
    const fits = scene.links === state.links;
    const why = fits ? scene.expected : scene.links === 0 ? scene.expected : `Needs ${scene.links} links.`;
    list.append(el("button", { type: "button", class: "picture", id: `scene-${scene.id}`, disabled: !fits, onclick: () => runScene(scene) },
      canvas, el("span", {}, scene.name), el("small", {}, why)));
    /** @type {Surface | null} */
    let picture = null; // its first size comes while it is made
    picture = new Surface(canvas, () => { if (picture) drawPicture(picture, scene); });
    drawPicture(picture, scene);
  }
}

async function runScene(scene) {
  const mine = turn;
  remember();
  const refusals = await setScene(settingsOf(scene), false);
  if (mine !== turn) return;
  await setState(scene.start, scene.velocity);
  setText(byId("course-status"), refusals.length > 0 ? `Refused: ${refusals.join(" ")}` : `${scene.name}: ${scene.expected}`);
  seen.scenes += 1;
  look();
}

/** The one slider of a step, with its mark. */
function makeDial(one) {
  const place = byId("course-dial");
  dial = null;
  place.replaceChildren();
  const waits = one.guess && guessed < 0;
  place.hidden = !one.dial || waits;
  // While the scene is being set its values would replace the student's.
  place.inert = began && !ready;
  if (!one.dial || state.links === 0) return;
  const ms = { unit: "ms", low: 0.1, high: 20, log: true };
  const make = /** @type {Record<string, () => [any, () => number, () => number]>} */ ({
    period: () => [numberField({ label: "control period", ...ms, low: 0.5, commit: (value) => setPeriod({ period: rounded(value) }) }), () => 1e3 * period(), () => 1e3 * controlPeriodLimit(state)],
    timestep: () => [numberField({ label: "timestep", ...ms, high: one.chart === "errors" ? 4 : 100, commit: (value) => setIntegrator({ timestep: one.chart === "errors" ? partOfPeriod(value) : rounded(value) }) }),
      () => 1e3 * (state.integrator?.timestep ?? NaN), () => 1e3 * limitInForce(state).limit],
    damping: () => [numberField({ label: "damping gains", unit: "times", low: FACTORS.low, high: FACTORS.high, log: true, commit: setDamping }), damping, () => NaN],
  });
  const [field, value, limit] = make[one.dial]();
  dial = { field, show: () => { field.accept(Number(value().toPrecision(6))); field.mark(one.guess && !ticked ? NaN : limit()); } };
  place.append(field.element);
  dial.show();
}

/** Milliseconds as seconds, without the digits that a division leaves behind. */
function rounded(ms) {
  return Number((ms / 1e3).toPrecision(6));
}

/** The timestep nearest to `ms` that is a whole part of the control period, so that the period stays [s]. */
function partOfPeriod(ms) {
  const whole = state.period?.period ?? 0;
  return Number((whole / Math.max(1, Math.round(whole / (ms / 1e3)))).toPrecision(9));
}

function setDamping(factor) {
  return setGains({ kd: /** @type {any} */ (DEFAULTS[state.links].gains).kd.map((kd) => Number((factor * kd).toPrecision(6))) });
}

function showBig() {
  const one = STEPS[at];
  const byTimestep = one.dial === "timestep";
  const time = byTimestep ? state.integrator?.timestep ?? NaN : period();
  const limit = one.guess && !ticked ? NaN : byTimestep ? limitInForce(state).limit : controlPeriodLimit(state);
  const { kind } = verdict(state);
  const big = byId("course-big");
  const hidden = !one.dial || !began || (one.guess && guessed < 0);
  big.hidden = hidden;
  setText(byId("course-figure"), hidden ? "" : ofLimit(time, limit));
  setText(byId("course-what"), byTimestep ? "timestep" : "control period");
  big.classList.toggle("bad", !(one.guess && !ticked) && (kind === "beyond" || kind === "never" || kind === "diverged"));
  if (kind === "diverged") setText(byId("course-status"), "The arm flew apart. Press “Restart step”.");
}

function showTask() {
  const { task, guess, question } = STEPS[at];
  byId("course-task").hidden = !began;
  byId("course-task").classList.toggle("done", ticked);
  setText(byId("course-tick"), ticked ? "✓" : "○");
  setText(byId("course-task-text"), task.text);
  setText(byId("course-task-state"), ticked ? "Done." : "");
  const place = byId("course-question");
  const open = began && guess && guessed < 0 ? "guess" : began && ticked ? "question" : "";
  if (place.dataset.shown === `${at} ${open} ${guessed} ${answered} ${turn}`) return;
  place.dataset.shown = `${at} ${open} ${guessed} ${answered} ${turn}`;
  place.replaceChildren();
  if (began && guess && guessed >= 0 && ticked) place.append(el("p", { class: "note" }, `${guessed === guess.right ? "Your guess was right." : `You guessed ${guess.answers[guessed]}.`} ${guess.because}`));
  if (open === "guess" && guess) ask(place, guess, -1, (k) => { guessed = k; show(); });
  if (open === "question") ask(place, question, answered, (k) => { answered = k; showTask(); announce(k === question.right ? `Right. ${question.because}` : "Not that one. Try again."); });
}

/** @param {HTMLElement} place @param {import("./course.js").Question} asks @param {number} chosen @param {(k: number) => void} choose */
function ask(place, { text, answers, right, because }, chosen, choose) {
  place.append(el("p", { class: "course-asks" }, text), el("div", { class: "buttons" }, ...answers.map((answer, k) => el("button", {
    type: "button", "aria-pressed": String(k === chosen), class: k === chosen ? (k === right ? "right" : "wrong") : "", onclick: () => choose(k),
  }, answer))));
  if (chosen >= 0) place.append(el("p", { class: "note" }, chosen === right ? `Right. ${because}` : "Not that one. Try again."));
}

// The events

/** At every news of the runtime. */
function look() {
  if (state.view !== "course" || state.links === 0 || !state.integrator || !state.gains) return;
  const one = STEPS[at];
  if (dial) dial.show();
  for (const button of byId("course-extra").querySelectorAll("[data-method]")) button.setAttribute("aria-pressed", String(button.dataset.method === state.integrator.method));
  showBig();
  if (!ready) return;
  const { kind } = verdict(state);
  seen.methods.add(state.integrator.method);
  seen.reached ||= state.goal?.outcome === "reached";
  const fastest = Math.max(...state.velocity.subarray(0, state.links).map(Math.abs));
  seen.shook ||= state.enabled && period() > controlPeriodLimit(state) && (fastest > SHAKES || kind === "diverged");
  seen.stable = state.enabled === true && period() < controlPeriodLimit(state) && kind !== "diverged" && sceneIsSet(one);
  if (one.methods && one.chart === "velocity" && !sceneIsSet(one)) seen.methods.clear();
  if (one.chart === "energy" && (state.enabled !== false || state.integrator.timestep < 0.004)) seen.methods.clear();
  refresh(one);
  if (!ticked && one.task.done(seen)) {
    ticked = true;
    announce("Done.");
    if (dial) dial.show();
    showBig();
    showTask();
  } else if (!ticked) showTask();
}

/** Whether the period of the step's scene is in force. */
function sceneIsSet(one) {
  return Math.abs((state.period?.period ?? 0) - one.scene(state.links).period.period) < 1e-9 || one.dial === "period";
}

/** Asks anew what the chart shows, once the settings that it is about have changed. */
function refresh(one) {
  const key = JSON.stringify([one.chart, turn, loopQuestion(state), state.integrator, period()]);
  if (key === asked || !["bars", "errors", "map", "ladder"].includes(one.chart)) return;
  asked = key;
  if (one.chart === "ladder") {
    if (runs.length > 0 && ladderKey !== settingsKey()) { runs = []; redraw(); }
    return;
  }
  inquire({ one, mine: turn });
}

const inquire = latestOnly(async ({ one, mine }) => {
  const n = state.links;
  const common = { params: state.params, gains: state.gains, integrator: state.integrator.method, timestep: state.integrator.timestep, control_period: state.period?.period ?? 0 };
  if (one.chart === "bars") {
    const pushed = new Array(n).fill(0);
    pushed[n - 1] = PUSH;
    // Without gravity, so that nothing but the push is seen.
    const { result, values } = await rollout({ ...common, params: { ...state.params, gravity: 0 }, q0: pushed, setpoint: new Array(n).fill(0), duration: LOOKS * period(), samples: LOOKS + 1 });
    if (mine !== turn || !result) return;
    bars = values.velocities.slice(1).map((row) => row[n - 1]);
    seen.shrinks = shrinks(bars);
  } else if (one.chart === "errors") {
    const { result, values } = await rollout({ ...common, q0: new Array(n).fill(0), setpoint: MOVE_TO[n], duration: 2, samples: 101, reference: true });
    if (mine !== turn || !result) return;
    errors = { error: values.error, sampling: values.sampling_error };
    if (Number.isNaN(firstError) && values.error > 0) firstError = values.error;
    seen.gain = firstError / (values.error ?? NaN);
  } else if (one.chart === "map") {
    /** @type {{factor: number, limit: number}[]} */
    const found = [];
    for (let row = 0; row < ROWS; row += 1) {
      const factor = FACTORS.value(row / (ROWS - 1));
      const kd = /** @type {any} */ (DEFAULTS[n].gains).kd.map((one) => factor * one);
      const { result, values } = await stability({ params: state.params, gains: { ...state.gains, kd }, setpoint: new Array(n).fill(0), integrator: "rk4", control_period: 0 });
      if (mine !== turn) return;
      if (result) found.push({ factor, limit: values.control_period_limit ?? Infinity });
    }
    border = found;
  }
  redraw();
  look();
}, 60);

let ladderKey = "";

async function measure() {
  const mine = turn;
  const button = byId("course-measure");
  runs = [];
  ladderKey = settingsKey();
  const key = ladderKey;
  button.disabled = true;
  const refused = await climb(1, () => mine === turn && key === settingsKey(), (rung) => { runs.push(rung); redraw(); });
  button.disabled = false;
  setText(byId("course-status"), refused);
  seen.measured = mine === turn && runs.length === rungs().length;
  look();
}

function draw() {
  if (!stale || state.view !== "course") return false;
  stale = false;
  const { chart } = STEPS[at];
  if (chart in SERIES) {
    stripTime = record.length > 0 ? record.data[record.last() + TIME] : NaN;
    strip.draw(Number.isNaN(stripTime) ? 0 : stripTime, SPAN, state.links, ALL_JOINTS, NaN);
  } else if (surface.width > 0) {
    if (chart === "bars") drawBars(surface, bars);
    if (chart === "errors") drawErrors(surface, errors);
    if (chart === "map") drawMap(surface, border, period(), damping());
    if (chart === "ladder") drawLadder(surface, runs);
  }
  return false;
}
