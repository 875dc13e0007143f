// The page's connection to the runtime: topics are stored, commands are sent, and settings are requested regularly.
// Invariant: the values of every answer are stored, so the page shows values that the runtime accepted.

import { announce, warn } from "./dom.js";
import { inPageNames, METHODS } from "./format.js";
import { Kernel, isAlone } from "./kernel.js";
import { latestOnly } from "./latest.js";
import { answerInForce, keepAnswer, motionHasChanged } from "./policy.js";
import { gainsArgs, loopKey, questionOf, rolloutArgs, stabilityArgs } from "./question.js";
import { Rosbridge, socketAddress } from "./rosbridge.js";
import { known, MOST_LINKS, nothingAsked, set, settingsKnown, state, tell, watch } from "./store.js";

const POLL_MS = 1000; // other clients change settings too, and no topic reports it
/** A more recent trajectory is newer than the setpoint in other messages. The next diagnostics are correct again. */
const TRAJECTORY_MS = 400;
const STILL_MS = 1000; // a paused arm needs few joint states [ms between two]
const HIDDEN_MS = 100; // a hidden page needs more, because they are recorded and must show a swing later
const TOUCHED_MS = 300; // after a change of a paused arm by this page, all joint states arrive for this time [ms]
const LONG_CALL_MS = 120000; // time for a computation or a search [ms]
/** A runtime that sends nothing for this time does not answer. It sends diagnostics once a second [ms]. */
const SILENT_MS = 3000;
/** Many setpoints may arrive per second. The study is asked about the latest. */
const STABILITY_MS = 200;
/** Default radius within which a goal counts as reached [m], as in the runtime. */
export const DEFAULT_EPSILON = 0.02;

let bridge;
let lastTrajectory = -Infinity;
let touched = -Infinity;
let onReset = () => {};
let beforeChange = () => {};

/** `whenReset` is called at a reset of the arm and at a new connection, `whenChanging` before the page changes a setting. */
export function start(whenReset, whenChanging) {
  onReset = whenReset;
  beforeChange = whenChanging;
  const dial = isAlone ? () => new Kernel() : () => new WebSocket(socketAddress(location.href));
  bridge = new Rosbridge(dial, connection);
  bridge.onStatus = (text) => warn(inPageNames(text));
  bridge.subscribe("/joint_states", jointStates);
  bridge.subscribe("/joint_trajectory", trajectory);
  bridge.subscribe("/diagnostics", diagnostics);
  bridge.subscribe("/ik_action/feedback", feedback);
  bridge.subscribe("/ik_action/result", goalResult);
  bridge.subscribe("/ik_trial/status", (msg) => set("trial", msg));
  pace();
  setInterval(() => { listen(); poll(); }, POLL_MS);
  watch(["integrator", "gains", "params", "friction", "motors", "period", "enabled", "setpoint", "links"], askStability);
  watch(["params", "enabled"], () => {
    set("pushed", false);
    if (state.goal?.outcome === "reached") set("goal", null); // the arm is not at the goal any more
  });
  watch("paused", pace);
  document.addEventListener("visibilitychange", pace);
}

/** Requests the joint states that are drawn or recorded: all for a visible moving arm, few for a paused or hidden one. */
function pace() {
  bridge.throttle("/joint_states", rests() ? STILL_MS : document.hidden ? HIDDEN_MS : 0);
}

function rests() {
  return state.paused === true && performance.now() - touched >= TOUCHED_MS;
}

/** A paused arm changes its pose after a request of this page. */
function touch() {
  touched = performance.now();
  pace();
  setTimeout(pace, TOUCHED_MS);
}

/** A server may keep its connection and say nothing, for example while it is stopped by a signal. */
function listen() {
  const isSilent = performance.now() - bridge.heard > SILENT_MS;
  if (state.connection === "open" && isSilent) set("connection", "silent");
  else if (state.connection === "silent" && !isSilent) set("connection", "open");
}

function connection(now) {
  const before = state.connection;
  state.failures = bridge?.failures ?? 0;
  set("connection", now);
  if (now === "open") {
    // It may be another or a restarted runtime, so all old values are discarded.
    state.setpointKnown = false;
    set("answered", false);
    set("limits", nothingAsked());
    set("diagnostics", null);
    set("goal", null);
    set("trial", null);
    onReset();
    poll();
    announce("Connected to the arm.");
  } else if (now === "lost" && before === "open") {
    warn("The connection is lost. The page reconnects by itself.");
  }
}

// Topics

function jointStates(msg) {
  const n = Math.min(msg.position.length, MOST_LINKS);
  const time = msg.header.stamp.sec + msg.header.stamp.nanosec * 1e-9;
  if (n !== state.links) {
    state.setpointKnown = false;
    set("links", n);
  } else if (time === state.time && same(msg, n)) {
    return; // a paused arm sends the same state sixty times a second
  }
  // The clock runs backwards only at a reset, which returns the setpoint to the starting pose.
  if (time < state.time) {
    if (noTrajectoryOfLate()) keepSetpoint(new Array(n).fill(0));
    state.pushed = false;
    state.limits.motions = {};
    if (answerInForce(state)) askNow();
    set("goal", null);
    onReset();
  }
  state.time = time;
  for (let i = 0; i < n; i += 1) {
    state.position[i] = msg.position[i];
    state.velocity[i] = msg.velocity[i];
    state.effort[i] = msg.effort[i];
    if (state.enabled === false && msg.effort[i] !== 0) state.pushed = true;
  }
  state.version += 1;
  tell("version");
}

function same({ position, velocity, effort }, n) {
  for (let i = 0; i < n; i += 1) {
    if (position[i] !== state.position[i] || velocity[i] !== state.velocity[i] || effort[i] !== state.effort[i]) return false;
  }
  return true;
}

function trajectory(msg) {
  const last = msg?.points?.at?.(-1)?.positions;
  if (!Array.isArray(last) || last.length !== state.links || !last.every(Number.isFinite)) return;
  const names = msg.joint_names;
  const named = Array.isArray(names) && names.length === last.length
    && new Set(names).size === names.length && names.every((name) => /^joint[123]$/.test(name));
  const positions = new Array(last.length);
  for (let i = 0; i < last.length; i += 1) positions[named ? Number(names[i].slice(5)) - 1 : i] = last[i];
  lastTrajectory = performance.now();
  if (state.goal?.outcome === "reached") set("goal", null); // the arm has another setpoint, so the goal's mark is outdated
  keepSetpoint(positions);
}

function noTrajectoryOfLate() {
  return performance.now() - lastTrajectory > TRAJECTORY_MS;
}

function keepSetpoint(positions) {
  if (state.setpointKnown && positions.every((q, i) => q === state.setpoint[i])) return;
  state.setpoint.set(positions);
  state.setpointKnown = true;
  tell("setpoint");
}

/** Rust's text of a number. */
function told(text) {
  return text === "inf" ? Infinity : Number(text);
}

function diagnostics(msg) {
  const report = {};
  for (const status of msg.status) {
    const values = Object.fromEntries(status.values.map(({ key, value }) => [key, value]));
    if (status.name === "arm_sim") {
      for (const key of Object.keys(values)) report[key] = key === "state" ? values[key] : told(values[key]);
      const setpoint = values.setpoint ? JSON.parse(values.setpoint) : [];
      if (noTrajectoryOfLate() && setpoint.length === state.links && setpoint.every(Number.isFinite)) keepSetpoint(setpoint);
      report.level = status.level;
      report.message = status.message;
    }
  }
  const before = state.diagnostics?.state;
  if (report.state !== "diverged") keep("paused", report.state === "paused");
  // Limits of an arm that diverges are those of its wild motion.
  if (before === "diverged" && report.state !== before) set("limits", nothingAsked());
  // The settings at a divergence are known only if the page has seen it.
  if (report.state !== before) state.broken = report.state === "diverged" && before ? questionOf(state) : null;
  set("diagnostics", report);
  keep("diverged", report.state === "diverged");
  if (motionHasChanged(answerInForce(state), report)) askNow();
  if (before === report.state) return;
  // Another client may have caused this, with settings that are not known yet.
  poll()?.then(() => {
    if (!state.broken) return;
    state.broken = questionOf(state);
    set("diagnostics", state.diagnostics);
  });
  if (report.state === "diverged") warn(`The simulation has ${report.message}`);
}

function feedback(msg) {
  const same = state.goal?.id === msg.goal_id;
  set("goal", {
    id: msg.goal_id,
    target: msg.target,
    epsilon: same ? state.goal.epsilon : DEFAULT_EPSILON,
    distance: msg.distance_remaining,
    elapsed: msg.elapsed,
    outcome: "active",
  });
}

function goalResult(msg) {
  if (state.goal?.id !== msg.goal_id) return;
  set("goal", { ...state.goal, distance: msg.final_distance, outcome: msg.outcome });
  if (msg.outcome === "reached" && !state.trial?.running) announce("Target reached.");
}

// Settings: each call reads or changes them, and stores the present values.

/** Asks for all settings. Returns the answer to the last question, after which all are known. */
function poll() {
  if (!bridge.open || document.hidden) return undefined;
  for (const group of GROUPS) change(group, {});
  pause();
  const last = enable();
  askStability();
  return last.then(() => keep("answered", true));
}

/** The service of each group of settings, in the order in which they are set. @type {Record<string, string>} */
const SERVICES = {
  params: "/arm_sim/set_params", gains: "/pid_controller/set_gains", integrator: "/arm_sim/set_integrator", period: "/pid_controller/set_period",
  friction: "/arm_sim/set_friction", motors: "/pid_controller/set_limits", sensors: "/pid_controller/set_sensors",
};
export const GROUPS = Object.keys(SERVICES);
/** The delay is a value of two groups, so a change of one asks for the other. @type {Record<string, string>} */
const OTHER = { period: "sensors", sensors: "period" };

/** A change by this page. All settings must be known before it, because it can be undone. */
async function changing(call) {
  await known(settingsKnown);
  beforeChange();
  set("changing", state.changing + 1);
  const answer = await call();
  set("changing", state.changing - 1);
  return answer;
}

/** Changes settings of a group, or reads them without `args`. @param {string} group @param {Record<string, any>} args */
export async function change(group, args) {
  const call = async () => {
    const told = await bridge.call(SERVICES[group], args);
    if (Object.keys(told.values).length > 0) keep(group, told.values);
    return told;
  };
  const answer = await (Object.keys(args).length > 0 ? changing(call) : call());
  if (args.delay !== undefined) await change(OTHER[group], {});
  return answer;
}

/** Switches something on or off, or reads it. @param {string} service @param {string} key @param {boolean} [data] */
async function flip(service, key, data) {
  const answer = await bridge.call(service, data === undefined ? {} : { data });
  if ("data" in answer.values) keep(key, answer.values.data);
  return answer;
}

/** This is not a setting, so there is nothing to undo. @param {boolean} [data] */
export const pause = (data) => flip("/arm_sim/pause", "paused", data);

/** Switches the controller. @param {boolean} [data] */
export function enable(data) {
  const call = () => flip("/pid_controller/enable", "enabled", data);
  return data === undefined ? call() : changing(call);
}

function keep(key, value) {
  if (JSON.stringify(state[key]) !== JSON.stringify(value)) set(key, value);
}

export const disturb = (effort, seconds) => bridge.call("/arm_sim/disturb", { effort, duration: seconds });
export const solve = (target) => bridge.call("/ik/solve", target);
export const cancelGoal = () => bridge.call("/ik_action/cancel_goal");
export const trialStart = (args) => bridge.call("/ik_trial/start", args);
export const trialSkip = () => bridge.call("/ik_trial/skip");
export const trialStop = () => bridge.call("/ik_trial/stop");

// The study's answers

/** Gains for an arm. @param {import("./question.js").Question} question */
export const suggestGains = (question) => bridge.call("/study/gains", gainsArgs(question), LONG_CALL_MS);
/** Limits of any robot. @param {Record<string, any>} args */
export const heldLimit = (args) => bridge.call("/study/held_limit", args, LONG_CALL_MS);
/** An offline motion. @param {import("./question.js").Question} question @param {import("./question.js").Run} run */
export const rollout = (question, run) => bridge.call("/study/rollout", rolloutArgs(question, run), LONG_CALL_MS);
/** Limits of a loop. @param {import("./question.js").Question} question */
export const stability = (question) => bridge.call("/study/stability", stabilityArgs(question), LONG_CALL_MS);

export async function step(steps) {
  const answer = await bridge.call("/arm_sim/step", { steps });
  touch();
  return answer;
}

export async function reset() {
  const answer = await bridge.call("/arm_sim/reset");
  if (answer.result) {
    touch();
    keepSetpoint(new Array(state.links).fill(0));
  }
  return answer;
}

/**
 * Puts the arm into another pose [rad], with these velocities [rad/s] or at rest, running or paused. This is not a
 * setting, so there is nothing to undo. @param {number[]} position @param {number[]} [velocity]
 */
export async function setState(position, velocity = position.map(() => 0)) {
  const answer = await bridge.call("/arm_sim/set_state", { position, velocity });
  if (answer.result) {
    touch();
    state.pushed = false; // energy is measured from here
    if (state.goal?.outcome === "reached") set("goal", null); // the arm is not at the goal any more
  }
  return answer;
}

export async function sendGoal(args) {
  const answer = await bridge.call("/ik_action/send_goal", args);
  if (answer.result) {
    // Feedback may have arrived before. It has everything except the epsilon.
    const known = state.goal?.id === answer.values.goal_id ? state.goal : { distance: NaN, elapsed: 0, outcome: "active" };
    const { x, y, phi } = args;
    set("goal", { ...known, id: answer.values.goal_id, target: known.target ?? { x, y, phi }, epsilon: args.epsilon ?? DEFAULT_EPSILON });
  }
  return answer;
}

/** Sends `positions` [rad] as the setpoint. It arrives on the topic, like every client's. A message has no answer, so only a missing connection is refused. */
export function sendSetpoint(positions) {
  if (!bridge.open) return { result: false, status: "not connected", values: {} };
  beforeChange();
  const names = Array.from({ length: state.links }, (_, i) => `joint${i + 1}`);
  bridge.publish("/joint_trajectory", {
    header: { stamp: { sec: 0, nanosec: 0 }, frame_id: "" },
    joint_names: names,
    points: [{ positions, velocities: [], accelerations: [], time_from_start: { sec: 0, nanosec: 0 } }],
  });
  return { result: true, status: "", values: {} };
}

/** Asks about the active loop with each method, the present one first. Computing takes time, so only the newest loop counts. */
const askNow = latestOnly(async () => {
  const present = questionOf(state);
  if (!present) return;
  const isPresent = (method) => Number(method === present.integrator);
  for (const [method] of METHODS.toSorted(([one], [other]) => isPresent(other) - isPresent(one))) {
    const asked = { ...present, integrator: method };
    const { result, values } = await stability(asked);
    const now = questionOf(state);
    if (!now || loopKey(now) !== loopKey(asked)) return;
    keepAnswer(state, asked, result ? values : null);
    tell("limits");
  }
}, STABILITY_MS);

function askStability() {
  if (questionOf(state) && bridge.open && !answerInForce(state)) askNow();
}
