// Shows the course, one step at a time: sets its scene, draws its chart, ticks its task, checks its answer.
// Invariant: a shared arm changes only after a click: a link to a step shows the step, and waits for Start. In the page in one
// file the arm belongs to the page, so the step begins at once.

import { beginAnew, remember, setScene } from "./actions.js";
import { keepAnswer, startAnswers } from "./answers.js";
import { Chart, drawBars, drawErrors, drawMap, drawPicture, drawResponses, ROOMY } from "./chart.js";
import { copyable } from "./copy.js";
import { followEnergy, KEPT, ofLimit, nothingSeen, shrinks, SOFT, stepIn, STEPS, stepsIn, WEAK } from "./course.js";
import { announce, byId, el, keepChoice, passFocus, remembered, setAddress, setAttribute, setText } from "./dom.js";
import { busy, numberField } from "./field.js";
import { duration, fixed, inPageNames, METHODS, multipleOf, partOf, seconds, shortName, significant } from "./format.js";
import { ENERGY, newest, record, recorded, VELOCITY } from "./history.js";
import { robotForm } from "./held_limit.js";
import { moveOf } from "./ladder.js";
import { drawLadder, keyOf, presentMove } from "./ladder_panel.js";
import { isAlone, linksIn } from "./kernel.js";
import { latestOnly } from "./latest.js";
import { FAILING, motionOf, motionsOf, playMotions } from "./motions.js";
import { StripChart } from "./plots.js";
import { controlPeriodLimit, verdict } from "./policy.js";
import { fromRest, heldTime, questionOf, rolloutArgs, stepsPerUpdate } from "./question.js";
import { connectionText } from "./readouts.js";
import { change, pause, rollout, setState, step as stepArm } from "./runtime.js";
import { judge, keep as keepResponse, LASTS, nameOf, present, responsesContent, shown } from "./responses.js";
import { LogScale } from "./scale.js";
import { SCENES, settingsOf } from "./scenes.js";
import { DEFAULTS, fromFragment, hasSettings, presentSettings, toFragment } from "./settings.js";
import { showForm } from "./sheet.js";
import { known, settingsKnown, state, unknown, watch, watchAll } from "./store.js";
import { Border, deviation, Series } from "./study.js";
import { Surface } from "./surface.js";

const FIRST = 0.5; // s: in this time of a response its settings are read
const SHAKES = 2; // rad/s: a visible speed beyond the limit
const LOOK_MS = 500;
const STEPS_SHOWN = 40; // measurements shown in slow motion
const ROWS = 13; // of the map's border
const FINEST = 0.001; // s: timestep at the border, which does not depend on it
const SPAN = 5; // s of the strip chart
const MEASURED = 1; // s of a measured move
const ALL_JOINTS = [true, true, true];
const MASSES = [0.5, 1, 2]; // of the last link [kg]
const DIVERGED = "The arm diverged. Change a setting, or press “Restart the arm”.";

/** The map's axes: control period [s], and damping gains as a multiple of the usual ones. */
const PERIODS = new LogScale(1e-3, 2e-2, [1, 2, 5, 10, 20].map((ms) => [1e-3 * ms, `${ms} ms`]));
const FACTORS = new LogScale(0.25, 4, [0.25, 0.5, 1, 2, 4].map((one) => [one, `${one < 1 ? `1/${1 / one}` : one}×`]));

/**
 * @typedef {object} ChartOfStep
 * @property {() => string} caption
 * @property {() => void} [draw] on the surface; nothing where the step has no chart
 * @property {() => import("./copy.js").Content | null} [content] to be copied
 * @property {(loop: import("./question.js").Question) => Promise<any>} [ask] for what it shows, about a loop from rest
 */
const content = () => now.found?.content ?? null;
/** @type {Record<string, ChartOfStep>} */
const CHARTS = {
  velocity: { caption: () => "Speed of the joints [rad/s]", ...strip("Speed of the joints", [{ column: VELOCITY }]) },
  energy: { caption: () => "Energy lost or gained since the start [J]", ...strip("Energy", [{ column: ENERGY, color: "ink" }], { level: 0 }) },
  bars: { caption: () => "A tiny push, at each measurement", draw: () => drawBars(surface, now.found?.bars ?? []), ask: askBars, content },
  errors: {
    caption: () => `Two errors of one move: ${shortName(state.integrator?.method)}, control period ${duration(heldTime(state))}`,
    draw: () => drawErrors(surface, now.found?.errors), ask: askErrors, content,
  },
  responses: {
    caption: () => "Joint 1 comes up to its setpoint",
    draw: () => {
      stripTime = newest();
      drawResponses(surface, now.responses, present(), state.setpoint[0], LASTS);
    },
    content: () => responsesContent(now.responses),
  },
  map: { caption: () => "Which period is stable", draw: paintMap, ask: askMap, content: () => border.content("Which period is stable") },
  ladder: { caption: () => "Error over run time", draw: () => drawLadder(surface, now.series.runs), content: () => now.series.content() },
  pictures: { caption: () => now.scene || "Twelve scenes", draw: () => playMotions(surface, now.motions, now.played, PLAYED_MS, ROUNDS) },
  form: { caption: () => "My arm" },
};

const border = new Border(FACTORS, ROWS, () => surface.redraw());
let at = 0; // the present step
let now = anew(); // the actions in it; a new object when its scene is set again
let surface;
let dial; // { field, show } of the present step
let stripTime = NaN;

function anew() {
  return {
    began: false, // whether it was started
    ready: false, // whether its scene is set; before that the arm shows another one
    guessed: -1,
    answered: -1,
    ticked: false,
    seen: nothingSeen(),
    found: /** @type {any} */ (null), // the answer that the chart shows: its bars or errors, and what can be copied of it
    firstError: NaN,
    responses: /** @type {import("./responses.js").Response[]} */ ([]),
    response: "", // the settings of the present one; empty if they changed on the way, and once it is kept
    series: new Series(),
    asked: "", // the settings of the chart
    scene: "", // the sentence of the started scene
    motions: /** @type {import("./motions.js").Motion[]} */ ([]), // of the started scene
    played: 0, // the time since they began [ms]
  };
}

/** The steps whose task was done once. The browser keeps them, and a link carries them. @type {Set<string>} */
const ticks = new Set();
const TICKS = "pendularm-done";

function tick(...ids) {
  for (const id of ids) ticks.add(id);
  keepChoice(TICKS, [...ticks].join(","));
  for (const [i, { id, title }] of STEPS.entries()) {
    const button = byId("course-steps").children[i];
    button.classList.toggle("done", ticks.has(id));
    setAttribute(button, "aria-label", `Step ${i + 1}: ${title}${ticks.has(id) ? ", done" : ""}`);
  }
}

/** The ticks in the form of a link; empty without one. */
export function ticksInLink() {
  return ticks.size > 0 ? `done=${[...ticks].join(",")}&` : "";
}

export function startCourse() {
  surface = new Surface(byId("course-chart"), () => CHARTS[STEPS[at].chart].draw?.());
  copyable(byId("course-caption").parentElement, () => CHARTS[STEPS[at].chart].content?.() ?? null);
  byId("course-back").addEventListener("click", () => go(at - 1));
  byId("course-next").addEventListener("click", () => go(at + 1));
  byId("course-start").addEventListener("click", begin);
  byId("course-again").addEventListener("click", () => report(again()));
  byId("course-steps").append(...STEPS.map((one, i) => el("button", {
    type: "button", class: "small", "data-step": one.id, "aria-label": `Step ${i + 1}: ${one.title}`, title: one.title, onclick: () => go(i),
  }, String(i + 1))));
  tick(...stepsIn(remembered(TICKS)), ...stepsIn(new URLSearchParams(location.hash.slice(1)).get("done")));
  at = Math.max(0, stepIn(location.hash));
  startAnswers();
  watch(["links", "answered"], open);
  let before = "";
  watch("connection", (connection) => {
    // A silent server still has the scene.
    if ([before, connection].includes("silent") && [before, connection].includes("open")) show();
    else rest();
    before = connection;
  });
  watchAll(look);
  rest();
}

/** Opens the step that a new address names. */
export function followLink() {
  if (stepIn(location.hash) < 0 && location.hash !== "") return;
  at = Math.max(0, stepIn(location.hash));
  open();
}

function open() {
  if (isAlone && settingsKnown() && state.view === "course" && !hasSettings(fromFragment(location.hash))) begin();
  else rest();
}

/** The present step in the form of a link; empty in the workbench. */
export function stepInLink() {
  return state.view === "course" ? `step=${STEPS[at].id}&` : "";
}

/** The number of links of the arm in this page, in the form of a link; empty if the address does not name it there. */
export function linksInLink() {
  return isAlone && linksIn(location.hash) ? `links=${state.links}` : "";
}

/** Reloads the page for an arm with this number of links, at the same step or at `hash`. */
export function chooseLinks(links, hash = `${stepInLink()}links=${links}`) {
  const address = new URL(location.href);
  address.searchParams.delete("links");
  address.hash = hash;
  setAddress(address);
  location.reload();
}

/** At most ten times a second, while something changes. */
export function moveCourse() {
  if (state.view === "course" && stripTime !== newest()) surface.redraw();
}

function rest() {
  now = anew();
  show();
}

function go(to) {
  if (to < 0 || to >= STEPS.length) return;
  at = to;
  setAddress(`#${[`step=${STEPS[at].id}`, linksInLink()].filter(Boolean).join("&")}`, "pushState");
  begin();
  byId("course-title").focus();
}

/** Sets the scene of the step, or restarts it. */
async function begin() {
  now = anew();
  const [mine, step] = [now, at];
  now.began = settingsKnown() !== null;
  show();
  if (!now.began) {
    // A click before the arm is known counts once it is.
    if (await known(settingsKnown) !== null && step === at && !now.began) begin();
    return;
  }
  remember();
  const { scene, offset, paused, title, text } = STEPS[at];
  // An arm that starts elsewhere is not yet moving there.
  const refused = await setScene(scene(state.links), paused === true || offset !== undefined);
  if (mine !== now) return;
  if (offset) await setState(offset.slice(0, state.links));
  if (offset && !paused) await pause(false);
  if (mine !== now) return;
  setText(byId("course-status"), refused);
  now.ready = true;
  byId("course-dial").inert = false;
  look();
  announce(`Step ${at + 1}: ${title}. ${text}`);
  if (paused) slowMotion(mine);
}

/** Restarts the arm of the step, with the present settings. */
async function again() {
  const { offset, paused } = STEPS[at];
  if (!offset) return beginAnew();
  await pause(true);
  const answer = await beginAnew();
  await setState(offset.slice(0, state.links));
  if (!paused) await pause(false);
  return answer;
}

async function report(call) {
  const { result, status } = await call;
  if (!result) setText(byId("course-status"), inPageNames(status));
}

/** The arm takes two control steps a second. It begins again after some, with another period, and when it has diverged. */
async function slowMotion(mine) {
  let [taken, at] = [0, heldTime(state)];
  while (mine === now) {
    await new Promise((done) => setTimeout(done, LOOK_MS));
    if (mine !== now || state.view !== "course" || !state.paused || document.hidden || state.connection !== "open") continue;
    if (taken >= STEPS_SHOWN || at !== heldTime(state) || state.diverged) {
      [taken, at] = [0, heldTime(state)];
      await again();
    }
    await stepArm(stepsPerUpdate(state));
    taken += 1;
  }
}

/**
 * Changes a setting in a step. The arm begins anew if it has diverged, and where the chart is of the whole motion since the start.
 * @param {Promise<{result: boolean, status: string, values: any}>} change
 */
async function changed(change) {
  const answer = await change;
  if (answer.result && (state.diverged || ["energy", "responses"].includes(STEPS[at].chart))) await again();
  return answer;
}

/** The usual damping gains, times a factor. @param {number} factor */
function damped(factor) {
  return /** @type {any} */ (DEFAULTS[state.links].gains).kd.map((kd) => Number((factor * kd).toPrecision(6)));
}

/** The damping gains as a multiple of the usual ones. */
function damping() {
  return state.gains && state.links > 0 ? state.gains.kd[0] / damped(1)[0] : NaN;
}

// The visible parts

function show() {
  const one = STEPS[at];
  for (const part of ["dial", "extra", "question"]) passFocus(byId(`course-${part}`), byId("course-title"));
  setText(byId("course-number"), `Step ${at + 1} of ${STEPS.length}`);
  setText(byId("course-title"), one.title);
  setText(byId("course-text"), one.text);
  const lost = state.connection !== "open";
  const start = `Press “Start” to set the arm.${isAlone ? "" : " Other viewers see the change."}`;
  setText(byId("course-status"), connectionText() || (!settingsKnown() || now.began ? "" : start));
  setText(byId("course-start"), now.began ? "Restart step" : "Start");
  if (lost) passFocus(byId("course-start"), byId("course-title"));
  byId("course-start").disabled = !settingsKnown() || lost;
  byId("course-back").disabled = at === 0;
  byId("course-next").disabled = at === STEPS.length - 1;
  [...byId("course-steps").children].forEach((button, i) => {
    if (i === at) button.setAttribute("aria-current", "step");
    else button.removeAttribute("aria-current");
  });
  byId("course-chart").hidden = !CHARTS[one.chart].draw || one.chart === "pictures";
  markOutdated(false);
  byId("course-extra").replaceChildren();
  if (settingsKnown()) fillExtra(one);
  makeDial(one);
  showBig();
  showTask();
  surface.redraw();
}

function fillExtra(one) {
  const place = byId("course-extra");
  if (one.methods) place.append(choices("method", "method", METHODS.map(([method]) => [method, shortName(method), "integrator", () => ({ method })])));
  if (one.chart === "responses") place.append(choices("motors", "effort limit and anti-windup", CURES.map(([name, isWeak, anti_windup]) => {
    const effort = isWeak ? WEAK[state.links] : null;
    return [String([isWeak, anti_windup]), effort ? `${effort[0]} N m, ${name}` : name, "motors", () => ({ effort, anti_windup })];
  })));
  if (one.chart === "map") place.append(choices("mass", "mass of the last link", MASSES.map((mass) => [String(mass), `last link ${mass} kg`, "params",
    () => ({ masses: [...state.params.masses.slice(0, -1), mass] })])));
  if (one.chart === "ladder") place.append(el("button", { type: "button", class: "primary", id: "course-measure",
    onclick: ({ target }) => busy(target, "Measuring…", measure) }, "Measure"));
  if (one.chart === "pictures") place.append(gallery(state.links));
  if (one.chart === "form") {
    showForm(place, () => { now.seen.sheet = true; look(); });
    place.append(robotForm());
  }
  showChosen();
}

/** Whether the efforts are limited, and what the integral does at the limit. @type {[string, boolean, string][]} */
const CURES = [["no limit", false, "clamp"], ["no cure", true, "none"], ["conditional", true, "conditional"], ["back-calculation", true, "back_calculation"]];

/** The present choice of each group of buttons, as the text that marks its button. */
const PRESENT = /** @type {Record<string, () => string>} */ ({
  method: () => String(state.integrator?.method), mass: () => String(state.params?.masses.at(-1)),
  motors: () => String([Boolean(state.motors?.effort), state.motors?.anti_windup]),
});

/** Buttons that change settings. @param {string} kind @param {string} label @param {any[][]} list the mark, text, group and new settings of each */
function choices(kind, label, list) {
  return el("div", { class: `buttons course-${kind}`, role: "group", "aria-label": label }, ...list.map(([mark, text, group, settings]) => el("button", {
    type: "button", class: "small", [`data-${kind}`]: mark, disabled: !state[group], onclick: () => report(changed(change(group, settings()))),
  }, text)));
}

/** The three gains of joint 1. The other joints have them in proportion. */
function gainFields() {
  const ranges = /** @type {Record<string, [string, number, number]>} */ ({
    kp: ["N m/rad", 20, 2000], ki: ["N m/(rad s)", 2, 2000], kd: ["N m s/rad", 5, 200] });
  return Object.entries(ranges).map(([key, [unit, low, high]]) => {
    const base = SOFT[state.links][key];
    const commit = (value) => changed(change("gains", { [key]: base.map((one) => Number(((value * one) / base[0]).toPrecision(6))) }));
    const field = numberField({ label: `${key} of joint 1`, short: key, unit, low, high, log: true, zero: key === "ki", commit });
    return { element: field.element, show: () => field.accept(state.gains[key][0]) };
  });
}

/** Pictures of the scenes, by number of links: made once. @type {Record<number, HTMLElement>} */
const galleries = {};

function gallery(links) {
  const others = SCENES.filter(({ id }) => !(id in FAILING));
  galleries[links] ??= el("div", {}, ...pictures(SCENES.filter(({ id }) => id in FAILING), links),
    el("details", {}, el("summary", {}, `The other ${others.length} scenes`), ...pictures(others, links)));
  return galleries[links];
}

/** Those for the present arm come first. @param {import("./scenes.js").Scene[]} scenes @param {number} links */
function pictures(scenes, links) {
  return [el("div", { class: "pictures" }, ...scenes.toSorted((one, other) => Number(other.links === links) - Number(one.links === links)).map((scene) => {
    const canvas = el("canvas", { "aria-hidden": "true" });
    const { text, act } = offer(scene, links);
    new Surface(canvas, (surface) => drawPicture(surface, scene));
    return el("button", { type: "button", class: "picture", id: `scene-${scene.id}`, disabled: act === null, onclick: act }, canvas,
      el("span", {}, scene.name), el("small", {}, text));
  }))];
}

/**
 * The sentence under a scene's picture, and the action of a click on it; null if a click does nothing. A
 * scene with another number of links needs that arm: the file loads it, and a server must be started with it.
 * @param {import("./scenes.js").Scene} scene
 * @param {number} links of the present arm
 */
function offer(scene, links) {
  if (scene.links === links) return { text: scene.expected, act: () => runScene(scene) };
  if (scene.links === 0) return { text: scene.expected, act: null };
  return isAlone ? { text: `Click for an arm of ${scene.links} links.`, act: () => chooseLinks(scene.links) }
    // Without line breaks in the option. Nobody copies these characters, because the text of a button cannot be selected.
    : { text: needed(scene.links).replace("--links ", "-\u2060-\u2060links\u00a0"), act: null };
}

/** How a server gets an arm with another number of links. @param {number} links */
export function needed(links) {
  return `Needs ${links} links: start pendularm with --links ${links}.`;
}

async function runScene(scene) {
  const mine = now;
  remember();
  const settings = settingsOf(scene);
  const refused = await setScene({ ...settings, controller: settings.controller ?? false }, false);
  if (mine !== now) return;
  const start = scene.watch?.start ?? scene.start;
  await setState(start, scene.velocity);
  now.motions = [];
  if (!refused) showMotions(scene, mine);
  now.scene = refused ? `Refused: ${refused}` : `${scene.name}: ${scene.expected}`;
  if (!refused) now.seen.scenes.add(scene.id);
  look();
}

/** Computes the correct and the failing motion of a scene, and plays them. */
async function showMotions(scene, mine) {
  const { correct, failing } = motionsOf(scene);
  const wanted = [correct, failing];
  const answers = await Promise.all(wanted.map(({ question, run }) => rollout(question, run)));
  if (mine !== now || !answers.every(({ result }) => result)) return;
  mine.motions = answers.map(({ values }, k) => motionOf(wanted[k], values, k === 0, PLAYED_MS / 1e3));
  mine.played = performance.now();
  byId("course-chart").hidden = false;
  surface.redraw();
}

const PLAYED_MS = 6000; // the clock at which a motion is over [ms]
const ROUNDS = 3; // how often it is played

/** The clock of a step: its slider, its present value and its limit [ms]. */
function clock(one) {
  if (one.dial !== "timestep") {
    return {
      label: "control period", unit: "ms", low: 0.5, high: 20, commit: (ms) => changed(change("period", { period: seconds(ms) })),
      value: () => 1e3 * heldTime(state), limit: () => 1e3 * controlPeriodLimit(state), fit: (ms) => multipleOf(1e3 * state.integrator.timestep, ms),
        rule: "it must be a whole number of timesteps",
    };
  }
  // In the chart of errors the period does not change. Energy has no limit: a stable method may lose it.
  const whole = one.chart === "errors"
    ? { high: 4, fit: (ms) => partOf(1e3 * (state.period?.period ?? 0), ms), rule: "it must divide the control period" } : { high: 100 };
  return {
    label: "timestep", unit: "ms", low: 0.1, ...whole, commit: (ms) => changed(change("integrator", { timestep: seconds(ms) })),
    value: () => 1e3 * (state.integrator?.timestep ?? NaN), limit: () => NaN,
  };
}

/** The one slider of a step, with its mark. */
function makeDial(one) {
  const place = byId("course-dial");
  dial = null;
  place.replaceChildren();
  place.hidden = !one.dial || (one.guess && now.guessed < 0);
  // While the scene is being set, its values would replace the student's.
  place.inert = now.began && !now.ready;
  if (!one.dial || !settingsKnown()) return;
  if (one.dial === "gains") {
    const fields = gainFields();
    place.append(...fields.map(({ element }) => element));
    dial = { show: () => { for (const field of fields) if (state.gains) field.show(); } };
    return dial.show();
  }
  const { value, limit, ...options } = one.dial === "damping"
    ? { label: "damping gains", unit: "times", low: FACTORS.low, high: FACTORS.high, commit: (factor) => changed(change("gains", { kd: damped(factor) })),
      value: damping, limit: () => NaN }
    : clock(one);
  const field = numberField({ log: true, ...options });
  dial = { show: () => { field.accept(Number(value().toPrecision(6))); field.mark(one.guess && !now.ticked ? NaN : limit()); } };
  place.append(field.element);
  dial.show();
}

function showBig() {
  const one = STEPS[at];
  const { kind } = verdict(state);
  const hidden = !one.dial || !now.began || (one.guess && now.guessed < 0);
  byId("course-big").hidden = hidden;
  const { figure, what, judged } = one.chart === "energy" ? bigEnergy() : one.chart === "responses" ? bigResponse() : bigClock(one, kind);
  setText(byId("course-figure"), hidden ? "" : figure);
  setText(byId("course-what"), what);
  const caption = CHARTS[one.chart].caption();
  setText(byId("course-caption"), caption);
  setAttribute(byId("course-chart"), "aria-label", caption);
  byId("course-big").classList.toggle("good", judged === "good");
  byId("course-big").classList.toggle("bad", judged === "bad");
  byId("course-again").hidden = !(now.ready && kind === "diverged" && one.chart !== "pictures");
  const status = byId("course-status");
  if (now.scene) setText(status, kind === "diverged" ? `${now.scene} The live arm diverged.` : now.scene);
  else if (kind === "diverged" && one.chart !== "pictures") setText(status, DIVERGED);
  else if (status.textContent === DIVERGED) setText(status, "");
}

/** A time and its limit, and whether it is stable. */
function bigClock(one, kind) {
  const { label, value, limit } = clock(one);
  const unknown = (one.guess && !now.ticked) || Number.isNaN(limit());
  const judged = unknown ? "" : ["stable", "here"].includes(kind) ? "good" : ["beyond", "never", "diverged"].includes(kind) ? "bad" : "";
  return { figure: ofLimit(value(), unknown ? NaN : limit()), what: label, judged };
}

/** The energy since the start of the swing, which is 0 there. */
function bigEnergy() {
  const energy = record.length > 0 ? record.data[record.last() + ENERGY] : NaN;
  const judged = Number.isNaN(energy) ? "" : Math.abs(energy) <= KEPT ? "good" : "bad";
  return { figure: `${energy >= 0.005 ? "+" : ""}${fixed(energy, 2)} J`, what: "energy since the start", judged };
}

/** How far the arm has passed its setpoint. */
function bigResponse() {
  const points = present();
  const { overshoot, error } = judge(points, state.setpoint[0]);
  const isOver = state.time >= LASTS;
  const figure = points.length > 0 ? `${significant(overshoot < 0.0005 ? 0 : overshoot, 2)} rad` : "–";
  return { figure, what: isOver ? `overshoot; ${significant(error, 2)} rad from the setpoint after ${LASTS} s` : "overshoot so far", judged: "" };
}

/** Keeps the response once it is complete, and says what the responses have shown. */
function lookAtResponse(seen) {
  if (!state.gains) return;
  const name = nameOf(state.gains, state.motors);
  // A motion belongs to the settings of its start, if they have stayed.
  if (state.time < FIRST) now.response = name;
  else if (now.response !== name || state.enabled !== true || state.diverged) now.response = "";
  if (now.response === "" || state.time < LASTS) return;
  now.response = "";
  const points = present();
  const question = fromRest(/** @type {any} */ (questionOf(state)), STEPS[at].offset?.slice(0, state.links));
  const one = { gains: state.gains, motors: state.motors, name, question, points, ...judge(points, state.setpoint[0]) };
  now.responses = keepResponse(now.responses, one);
  const found = shown(now.responses);
  for (const key of Object.keys(seen.responses)) seen.responses[key] ||= found[key];
  const words = Object.keys(seen.responses).filter((key) => seen.responses[key]);
  setText(byId("course-status"), words.length > 0 ? `Shown: ${words.join(", ")}.` : "");
}

function showTask() {
  const { id, task, guess, question } = STEPS[at];
  const { began, ticked, guessed, answered } = now;
  byId("course-task").hidden = !began || (guess !== undefined && guessed < 0);
  byId("course-task").classList.toggle("done", ticked);
  setText(byId("course-tick"), ticked ? "✓" : "○");
  setText(byId("course-task-text"), task.text);
  setText(byId("course-task-state"), ticked ? "Done." : "");
  const place = byId("course-question");
  const key = JSON.stringify([at, began, ticked, guessed, answered]);
  if (place.dataset.shown === key) return;
  place.dataset.shown = key;
  place.replaceChildren();
  if (guess && began && guessed < 0) ask(place, guess, -1, (k) => {
    now.guessed = k;
    keepAnswer(id, { guess: k });
    show();
    byId("course-dial").querySelector("input")?.focus({ preventScroll: true });
  });
  else if (ticked) {
    if (guess) place.append(el("p", { class: "note" },
      `${guessed === guess.right ? "Your guess was right." : `You guessed ${guess.answers[guessed]}.`} ${guess.because}`));
    ask(place, question, answered, (k) => {
      now.answered = k;
      keepAnswer(id, { answer: k });
      showTask();
      place.querySelector("[aria-pressed=true]")?.focus({ preventScroll: true });
      announce(k === question.right ? `Right. ${question.because}` : "Not that one. Try again.");
    });
  }
}

/** @param {HTMLElement} place @param {import("./course.js").Question} asks @param {number} chosen @param {(k: number) => void} choose */
function ask(place, { text, answers, right, because }, chosen, choose) {
  place.append(el("p", { class: "course-asks" }, text), el("div", { class: "buttons" }, ...answers.map((answer, k) => el("button", {
    type: "button", "aria-pressed": String(k === chosen), class: k === chosen ? (k === right ? "right" : "wrong") : "", onclick: () => choose(k),
  }, answer))));
  if (chosen >= 0) place.append(el("p", { class: "note" }, chosen === right ? `Right. ${because}` : "Not that one. Try again."));
}

// The events

/** At every message of the runtime. */
function look() {
  if (state.view !== "course" || state.links === 0 || !state.integrator || !state.gains) return;
  const one = STEPS[at];
  if (dial) dial.show();
  showChosen();
  showBig();
  if (!now.ready) return;
  const { seen } = now;
  const { kind } = verdict(state);
  const sceneIsSet = one.dial === "period" || Math.abs((state.period?.period ?? 0) - (one.scene(state.links).period?.period ?? 0)) < 1e-9;
  const fastest = Math.max(...state.velocity.subarray(0, state.links).map(Math.abs));
  seen.methods.add(state.integrator.method);
  seen.reached ||= state.goal?.outcome === "reached";
  seen.shook ||= state.enabled && heldTime(state) > controlPeriodLimit(state) && (fastest > SHAKES || kind === "diverged");
  seen.stable = state.enabled === true && heldTime(state) < controlPeriodLimit(state) && kind !== "diverged" && sceneIsSet;
  if (one.methods && one.chart === "velocity" && !sceneIsSet) seen.methods.clear();
  if (one.chart === "energy" && state.enabled === false && record.length > 0) {
    const of = JSON.stringify([state.integrator, state.params]);
    seen.energy = followEnergy(seen.energy, of, state.integrator.timestep, newest(), record.data[record.last() + ENERGY]);
  }
  if (one.chart === "responses") lookAtResponse(seen);
  refresh(one);
  if (!now.ticked && one.task.done(seen)) {
    now.ticked = true;
    tick(one.id);
    announce("Done.");
    if (dial) dial.show();
    showBig();
    const figure = `${byId("course-figure").textContent} ${byId("course-what").textContent}`;
    if (!byId("course-big").hidden) keepAnswer(one.id, { figure, settings: toFragment(/** @type {any} */ (presentSettings(state)), state.links) });
  }
  showTask();
}

function showChosen() {
  for (const [kind, present] of Object.entries(PRESENT)) {
    for (const one of byId("course-extra").querySelectorAll(`[data-${kind}]`)) setAttribute(one, "aria-pressed", String(one.dataset[kind] === present()));
  }
}

/** Requests the chart's data again, when its settings have changed. */
function refresh({ chart }) {
  if (now.series.move && keyOf(now.series.move) !== keyOf(presentMove())) {
    now.series.forget();
    surface.redraw();
  }
  // The charts are about the controller, which holds the stretched arm.
  const present = questionOf({ ...state, enabled: true, setpointKnown: true });
  if (!present || !CHARTS[chart].ask) return;
  const loop = fromRest({ ...present, setpoint: present.setpoint.map(() => 0) });
  const key = JSON.stringify([loop, heldTime(state)]);
  if (key === now.asked) return;
  now.asked = key;
  markOutdated(true);
  inquire({ ask: CHARTS[chart].ask, mine: now, key, loop });
}

/** A chart of earlier settings is faint until the study has answered. */
function markOutdated(/** @type {boolean} */ outdated) {
  byId("course-chart").classList.toggle("outdated", outdated);
}

const inquire = latestOnly(async ({ ask, mine, key, loop }) => {
  if (mine !== now) return;
  const found = await ask(loop);
  if (mine === now && key === now.asked) {
    now.found = found;
    markOutdated(false);
  }
  surface.redraw();
  look();
}, 60);

async function askBars(loop) {
  const { seen } = now;
  // Without gravity, so only the push is visible. It is a push of the velocity, which excites the fastest motion of the loop.
  const found = await deviation({ ...loop, params: { ...loop.params, gravity: 0 } }, loop.q, heldTime(state));
  seen.shrinks = shrinks(found?.bars ?? []);
  return found;
}

async function askErrors(loop) {
  const mine = now;
  const run = { duration: 2, samples: 101, reference: true };
  const { result, values: { error, sampling_error: sampling } } = await rollout(moveOf(loop), run);
  if (!result) return null;
  if (Number.isNaN(mine.firstError) && error > 0) mine.firstError = error;
  mine.seen.gain = mine.firstError / (error ?? NaN);
  return { errors: { error, sampling }, content: {
    name: "Two errors of one move", columns: ["error of the method [rad]", "error of the hold [rad]"], rows: [[error, sampling]],
    asked: [rolloutArgs(moveOf(loop), run)], python: "[(run.error, run.sampling_error) for run in runs]",
  } };
}

/** The border of the map. The damping and the clocks move the dot, not the border. */
function askMap(loop) {
  const common = { ...loop, integrator: "rk4", timestep: FINEST, control_period: 0 };
  return border.ask((factor) => ({ ...common, gains: { ...loop.gains, kd: damped(factor) } }), { limit: "control_period_limit" });
}

async function measure() {
  const mine = now;
  const move = await known(presentMove);
  if (!move) return setText(byId("course-status"), unknown().status);
  const refused = await mine.series.measure(move, MEASURED, () => mine === now, () => surface.redraw());
  if (refused === null) return;
  setText(byId("course-status"), inPageNames(refused));
  mine.seen.measured = refused === "";
  look();
}

/** Draws the last seconds, or copies them. @param {string} name @param {import("./plots.js").Series[]} series @param {{level?: number}} [more] */
function strip(name, series, more) {
  const chart = new StripChart(series, 0.2, 300);
  const view = () => ({ now: newest() || 0, span: SPAN, links: state.links, shown: ALL_JOINTS, across: "simulation time [s]", ...more });
  return {
    draw() {
      stripTime = newest();
      chart.draw(surface, view());
    },
    content: () => recorded(name, view()),
  };
}

function paintMap() {
  const chart = new Chart(surface, PERIODS, FACTORS, ROOMY);
  chart.frame({ across: "control period", up: "damping gains", grid: false });
  drawMap(chart, border.rows, heldTime(state), damping());
}
