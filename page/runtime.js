// The runtime as the page sees it: topics into the store, commands out, settings asked for again now and then.
// Invariant: every answer's values go into the store, so that what is shown is what the runtime accepted.

import { Rosbridge, nobodyProvides } from "./rosbridge.js";
import { MOST_LINKS, set, state, tell } from "./store.js";
import { announce, warn } from "./announce.js";

/** Other clients change settings too, and no topic tells of it. */
const POLL_MS = 1000;
/** A service that nobody provides is asked for again, rarely: a provider may come. */
const MISSING_POLLS = 15;
export const DEFAULT_EPSILON = 0.02;

let bridge;
let arrived = 0; // joint states since the last reckoning of the rate
let counted = performance.now();
let missingPolls = 0;
let answeredQuestion = "";
let onReset = () => {};

export function start(whenReset) {
  onReset = whenReset;
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  bridge = new Rosbridge(`${scheme}://${location.host}/`, connection);
  bridge.onStatus = (text) => warn(text);
  bridge.subscribe("/joint_states", jointStates);
  bridge.subscribe("/joint_trajectory", trajectory);
  bridge.subscribe("/diagnostics", diagnostics);
  bridge.subscribe("/ik_action/feedback", feedback);
  bridge.subscribe("/ik_action/result", goalResult);
  bridge.subscribe("/ik_trial/status", (msg) => set("trial", msg));
  bridge.subscribe("/arm_sim/error_estimate", (msg) => set("estimate", msg));
  setInterval(poll, POLL_MS);
}

function connection(now) {
  const before = state.connection;
  set("connection", now);
  if (now === "open") {
    missingPolls = 0;
    answeredQuestion = "";
    set("stabilityMissing", false);
    set("goal", null);
    set("trial", null);
    set("estimate", null);
    poll();
    announce("Connected to the arm.");
  } else if (now === "lost" && before === "open") {
    warn("The connection is lost. The page reconnects by itself.");
    set("rate", 0);
  }
}

// Topics

function jointStates(msg) {
  const n = Math.min(msg.position.length, MOST_LINKS);
  const time = msg.header.stamp.sec + msg.header.stamp.nanosec * 1e-9;
  if (n !== state.links) {
    state.setpointKnown = false;
    set("links", n);
  }
  // The clock runs backwards only at a reset, which brings the setpoint back to the starting pose.
  if (time < state.time) {
    state.setpoint.fill(0);
    state.setpointKnown = true;
    set("goal", null);
    onReset();
  }
  state.time = time;
  for (let i = 0; i < n; i += 1) {
    state.position[i] = msg.position[i];
    state.velocity[i] = msg.velocity[i];
    state.effort[i] = msg.effort[i];
  }
  state.version += 1;
  arrived += 1;
  tell("version");
}

function trajectory(msg) {
  const last = msg?.points?.at?.(-1)?.positions;
  if (!Array.isArray(last) || last.length !== state.links || !last.every(Number.isFinite)) return;
  const names = msg.joint_names;
  const named = Array.isArray(names) && names.length === last.length
    && new Set(names).size === names.length && names.every((name) => /^joint[123]$/.test(name));
  for (let i = 0; i < last.length; i += 1) {
    state.setpoint[named ? Number(names[i].slice(5)) - 1 : i] = last[i];
  }
  state.setpointKnown = true;
  tell("setpoint");
}

function diagnostics(msg) {
  const report = { clients: NaN, dropped: NaN };
  for (const status of msg.status) {
    const values = Object.fromEntries(status.values.map(({ key, value }) => [key, value]));
    if (status.name === "arm_sim") {
      for (const key of Object.keys(values)) report[key] = key === "state" ? values[key] : Number(values[key]);
      report.level = status.level;
      report.message = status.message;
    } else if (status.name === "gateway") {
      report.clients = Number(values.connections);
      report.dropped = Number(values.messages_dropped);
    }
  }
  const before = state.diagnostics?.state;
  set("diagnostics", report);
  if (before !== report.state && report.state === "diverged") warn(`The simulation has ${report.message}`);
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

// Settings: each call asks or changes, and stores what is now in force.

function poll() {
  const now = performance.now();
  const rate = (arrived * 1000) / Math.max(1, now - counted);
  set("rate", state.rate > 0 && arrived > 0 ? (state.rate + rate) / 2 : rate); // timers come and go by some milliseconds
  arrived = 0;
  counted = now;
  if (!bridge.open || document.hidden) return;
  setParams({});
  setIntegrator({});
  setGains({});
  pause();
  enable();
  askStability();
}

async function settings(service, args, keep) {
  const answer = await bridge.call(service, args);
  if (Object.keys(answer.values).length > 0) keep(answer.values);
  return answer;
}

/** Stores `value` under `key`, and tells of it only where it differs. */
function keep(key, value) {
  if (JSON.stringify(state[key]) !== JSON.stringify(value)) set(key, value);
}

export const setParams = (args) => settings("/arm_sim/set_params", args, (values) => keep("params", values));
export const setIntegrator = (args) => settings("/arm_sim/set_integrator", args, (values) => keep("integrator", values));
export const setGains = (args) => settings("/pid_controller/set_gains", args, (values) => keep("gains", values));
export const pause = (data) => settings("/arm_sim/pause", data === undefined ? {} : { data }, (values) => keep("paused", values.data));
export const enable = (data) => settings("/pid_controller/enable", data === undefined ? {} : { data }, (values) => keep("enabled", values.data));
export const reset = () => bridge.call("/arm_sim/reset");
export const step = (steps) => bridge.call("/arm_sim/step", { steps });
export const disturb = (effort, seconds) => bridge.call("/arm_sim/disturb", { effort, duration: seconds });
export const solve = (target) => bridge.call("/ik/solve", target);
export const cancelGoal = () => bridge.call("/ik_action/cancel_goal");
export const trialStart = (args) => bridge.call("/ik_trial/start", args);
export const trialSkip = () => bridge.call("/ik_trial/skip");
export const trialStop = () => bridge.call("/ik_trial/stop");
/** Offline motion of the same arm; long ones take their time. */
export const rollout = (args) => bridge.call("/study/rollout", args, 120000);

export async function sendGoal(args) {
  const answer = await bridge.call("/ik_action/send_goal", args);
  if (answer.result) {
    // Feedback may have come before; it knows everything but the epsilon.
    const known = state.goal?.id === answer.values.goal_id ? state.goal : { distance: NaN, elapsed: 0, outcome: "active" };
    const { x, y, phi } = args;
    set("goal", { ...known, id: answer.values.goal_id, target: known.target ?? { x, y, phi }, epsilon: args.epsilon ?? DEFAULT_EPSILON });
  }
  return answer;
}

/** Sends `positions` [rad] as the setpoint; it comes back over the topic like anybody's. */
export function sendSetpoint(positions) {
  const names = Array.from({ length: state.links }, (_, i) => `joint${i + 1}`);
  bridge.publish("/joint_trajectory", {
    header: { stamp: { sec: 0, nanosec: 0 }, frame_id: "" },
    joint_names: names,
    points: [{ positions, velocities: [], accelerations: [], time_from_start: { sec: 0, nanosec: 0 } }],
  });
}

/** What the limit depends on; the timestep is not among it. Reckoning it takes a while, so it is asked for only when this changes. */
function stabilityQuestion() {
  const { integrator, gains, params, enabled, setpoint, setpointKnown } = state;
  return JSON.stringify([integrator?.method, gains, params, enabled, setpointKnown && Array.from(setpoint)]);
}

async function askStability() {
  if (state.stabilityMissing && (missingPolls += 1) % MISSING_POLLS !== 0) return;
  const question = stabilityQuestion();
  if (question === answeredQuestion) return;
  const answer = await bridge.call("/study/stability");
  const missing = nobodyProvides(answer);
  if (answer.result) answeredQuestion = question;
  if (missing !== state.stabilityMissing) set("stabilityMissing", missing);
  keep("stability", answer.result ? answer.values : null);
}
