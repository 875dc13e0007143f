// @ts-check
// Numbers in words and figures: time, real-time factor, timestep and its limit, energy, connection; and the arm in a sentence.
// Invariant: written a few times a second; only what changed touches the page.

import { byId, setAttribute, setText } from "./dom.js";
import { duration, fixed, shortName, significant } from "./format.js";
import { endEffector } from "./arm_view.js";
import { shown } from "./playback.js";
import { adviceText, answerInForce, doublingTime, limitInForce, limitText, verdict, worstText } from "./policy.js";
import { isAlone } from "./kernel.js";
import { isStill } from "./runtime.js";
import { Median } from "./smooth.js";
import { state, watch } from "./store.js";

/** Fewer joint states than this, a second, are worth a look. */
const LOW_RATE = 50;
/** Below this real-time factor the runtime lags. */
const LAGS = 0.95;
/** Estimates that are shown as one: two seconds of them. */
const ESTIMATES = 10;
/** A local error below this is rounding, whatever its digits [rad/s]. */
const ROUNDING = 1e-12;

const estimates = new Median(ESTIMATES);

export function startReadouts() {
  watch("connection", (now) => {
    const pill = byId("connection");
    pill.className = `pill ${now}`;
    setText(byId("connection-text"), { open: isAlone ? "in this page, no server" : "connected", connecting: "connecting…", lost: "reconnecting…" }[now]);
  });
  const causes = ["connection", "stability", "stabilityMissing", "integrator", "gains", "params", "period", "setpoint", "enabled", "diagnostics"];
  for (const key of causes) watch(key, showLimit);
  watch("integrator", () => estimates.clear());
  watch("estimate", (estimate) => {
    if (!estimate) estimates.clear();
    else estimates.add(estimate.error_per_second);
  });
}

/** Called a few times a second. */
export function showReadouts() {
  const diagnostics = state.connection === "open" ? state.diagnostics : null;
  setText(byId("sim-time"), fixed(shown.time, 2));
  setText(byId("run-state"), runState());
  setAttribute(byId("run-state"), "class", `state ${!shown.live ? "recorded" : diagnostics?.state === "diverged" ? "diverged" : ""}`);
  const { value } = estimates;
  setText(byId("out-error"), value < ROUNDING ? "rounding" : Number.isFinite(value) ? `${significant(value, 2)} rad` : "–");
  const factor = diagnostics?.real_time_factor ?? NaN;
  setText(byId("out-rtf"), state.paused ? "paused" : `${fixed(factor, 2)}×`);
  byId("out-rtf").classList.toggle("warn", !state.paused && diagnostics?.state === "running" && factor < LAGS);
  setText(byId("out-method"), shortName(state.integrator?.method));
  setText(byId("out-timestep"), duration(state.integrator?.timestep ?? NaN));
  setText(byId("out-servo"), state.enabled == null ? "–" : state.enabled ? "on" : "off");
  setText(byId("out-steps"), state.paused ? "–" : `${significant(diagnostics?.steps_per_second ?? NaN, 3)}/s`);
  setText(byId("out-clients"), fixed(diagnostics?.clients ?? NaN, 0));
  setText(byId("out-rate"), isStill() ? "–" : `${fixed(state.rate, 0)} Hz`);
  byId("out-rate").classList.toggle("warn", state.connection === "open" && !isStill() && state.rate > 0 && state.rate < LOW_RATE);
  setText(byId("out-drops"), fixed(diagnostics?.dropped ?? NaN, 0));
  byId("out-drops").classList.toggle("warn", diagnostics?.dropped > 0);
}

function runState() {
  if (state.connection !== "open") return "no connection";
  if (!shown.live) return shown.playing && shown.speed !== 1 ? `recording, 1/${fixed(1 / shown.speed, 0)} speed` : "recording";
  if (state.diagnostics?.state === "diverged") return "diverged";
  return state.paused ? "paused" : "running";
}

/** The verdict on the timestep: in a word on the arm, in a sentence under it; and under the clocks what to use. */
function showLimit() {
  const said = verdict(state);
  const { limit, everyPose } = limitInForce(state);
  const pill = byId("verdict-pill");
  pill.hidden = said.kind === "offline" || said.kind === "diverged" // the other pill says so
    || (said.kind === "unknown" && !state.stabilityMissing); // the answer is on its way
  pill.className = `state ${said.kind}`;
  setText(pill, said.pill);
  setText(byId("verdict"), said.kind === "never" ? `${said.sentence} ${growthText()}` : said.sentence);
  const bad = said.kind === "beyond" || said.kind === "never" || said.kind === "diverged";
  setText(byId("out-limit"), state.stabilityMissing && Number.isNaN(limit) ? "not offered" : limitText(limit));
  byId("out-limit").title = said.where;
  byId("out-limit").classList.toggle("bad", bad);
  setText(byId("out-every"), state.enabled === false || state.stabilityMissing ? "–" : limitText(everyPose));
  const answer = state.enabled ? answerInForce(state) : null;
  setText(byId("worst-text"), worstText(answer));
  setText(byId("out-certified"), answer?.certified === undefined || !(everyPose > 0) ? "" : answer.certified ? answer.bound_is_proven ? "proven" : "bounded" : "found");
  byId("out-every").classList.toggle("warn", said.kind === "here");
  setText(byId("limit-text"), adviceText(state));
}

/** How fast a small free swing gains energy. */
function growthText() {
  const seconds = doublingTime(state, answerInForce(state));
  return seconds > 0 ? `The energy of a small swing doubles every ${significant(seconds, 2)} s.` : "";
}

/** The arm in a sentence, for those who can't see it; read when the view has the focus. */
export function describeArm() {
  if (state.links === 0 || !state.params) return;
  const { x, y } = endEffector();
  const degrees = Array.from(state.position.subarray(0, state.links), (q) => fixed((q * 180) / Math.PI, 0));
  const goal = state.goal?.outcome === "active" ? ` Target at x ${fixed(state.goal.target.x, 2)}, y ${fixed(state.goal.target.y, 2)} metres, ${fixed(state.goal.distance, 2)} metres away.` : "";
  setText(byId("arm-text"), `${state.links} links, ${runState()}, controller ${state.enabled ? "on" : "off"}. Joints at ${degrees.join(", ")} degrees. `
    + `End effector at x ${fixed(x, 2)}, y ${fixed(y, 2)} metres.${goal}`);
}
