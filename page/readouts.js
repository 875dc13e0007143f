// Readouts: time, real-time factor, timestep and its limit, energy, connection; and the arm in a sentence.
// Invariant: they are updated a few times a second, and only changed texts are written.

import { byId, setAttribute, setText } from "./dom.js";
import { fixed, significant } from "./format.js";
import { endEffector } from "./arm_view.js";
import { answerInForce, doublingTime, limitInForce, limitText, SLOW, verdict } from "./policy.js";
import { isAlone } from "./kernel.js";
import { LOOP, state, watch } from "./store.js";

export function startReadouts() {
  watch("connection", (now) => {
    const pill = byId("connection");
    pill.className = `pill ${now}`;
    const open = isAlone ? "in this page, no server" : "connected";
    setText(byId("connection-text"), { open, connecting: "connecting…", lost: "reconnecting…", silent: "no answer" }[now]);
  });
  watch(LOOP, showLimit);
}

/** Called a few times a second. */
export function showReadouts() {
  const diagnostics = state.connection === "open" ? state.diagnostics : null;
  setText(byId("sim-time"), fixed(state.time, 2));
  setText(byId("run-state"), runState());
  setAttribute(byId("run-state"), "class", `state ${diagnostics?.state === "diverged" ? "diverged" : ""}`);
  const factor = diagnostics?.real_time_factor ?? NaN;
  setText(byId("out-rtf"), state.paused ? "paused" : `${fixed(factor, 2)}×`);
  byId("out-rtf").classList.toggle("warn", !state.paused && diagnostics?.state === "running" && factor < SLOW);
}

function runState() {
  if (state.connection !== "open") return "no connection";
  if (state.diagnostics?.state === "diverged") return "diverged";
  return state.paused ? "paused" : "running";
}

/** The verdict on the timestep: in a word on the arm, in a sentence under it, and as advice under the clocks. */
function showLimit() {
  const said = verdict(state);
  const { limit, everyPose } = limitInForce(state);
  const pill = byId("verdict-pill");
  pill.hidden = ["offline", "diverged", "unknown"].includes(said.kind); // the other pill shows it, or the answer is pending
  pill.className = `state ${said.kind}`;
  setText(pill, said.pill);
  setText(byId("verdict"), said.kind === "never" ? `${said.sentence} ${growthText()}` : said.sentence);
  const bad = said.kind === "beyond" || said.kind === "never" || said.kind === "diverged";
  setText(byId("out-limit"), limitText(limit));
  byId("out-limit").title = said.where;
  byId("out-limit").classList.toggle("bad", bad);
  setText(byId("out-every"), state.enabled === false ? "–" : limitText(everyPose));
  const answer = state.enabled ? answerInForce(state) : null;
  setText(byId("out-certified"), answer?.certified === undefined || !(everyPose > 0) ? "" : answer.certified ? answer.bound_is_proven ? "bound"
    : "estimate" : "found");
  byId("out-every").title = answer?.worst_pose ? `at (${answer.worst_pose.map((q) => fixed(q, 2)).join(", ")}) rad` : "";
  byId("out-every").classList.toggle("warn", said.kind === "here");
}

function growthText() {
  const { method, timestep } = state.integrator;
  const seconds = doublingTime(method, timestep, answerInForce(state));
  return seconds > 0 ? `The energy of the fastest small swing doubles every ${significant(seconds, 2)} s.` : "";
}

/** The arm in a sentence for screen readers, read when the view has the focus. */
export function describeArm() {
  if (state.links === 0 || !state.params) return;
  const { x, y } = endEffector();
  const degrees = Array.from(state.position.subarray(0, state.links), (q) => fixed((q * 180) / Math.PI, 0));
  const goal = state.goal?.outcome === "active" ? ` Target at x ${fixed(state.goal.target.x, 2)}, y ${fixed(state.goal.target.y, 2)} metres, `
    + `${fixed(state.goal.distance, 2)} metres away.` : "";
  setText(byId("arm-text"), `${state.links} links, ${runState()}, controller ${state.enabled ? "on" : "off"}. Joints at ${degrees.join(", ")} degrees. `
    + `End effector at x ${fixed(x, 2)}, y ${fixed(y, 2)} metres.${goal}`);
}

/** Attempts to connect before the page says what may be wrong. */
export const MANY = 3;

/** Why the page has no arm, and what may help; empty while it has one. */
export function connectionText() {
  const { connection, failures, links } = state;
  if (connection === "open") return "";
  if (connection === "silent") return "No answer from the arm. The figures are old.";
  const text = links > 0 ? "Connection lost. Trying again…" : "Connecting to the arm…";
  if (failures < MANY || isAlone) return text;
  return `${text} The server may be stopped. Or it refuses pages of this address: then start it with --allow-origin ${location.origin}`;
}
