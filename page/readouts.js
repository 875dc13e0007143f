// Numbers in words and figures: time, real-time factor, timestep and its limit, energy, connection; and the arm in a sentence.
// Invariant: written a few times a second; only what changed touches the page.

import { METHODS } from "./controls.js";
import { byId, setText } from "./dom.js";
import { duration, fixed, significant } from "./format.js";
import { tip } from "./arm_view.js";
import { state, watch } from "./store.js";
import { exceedsLimit, limit } from "./transport.js";

/** Fewer joint states than this, a second, are worth a look. */
const LOW_RATE = 50;

export function startReadouts() {
  watch("connection", (now) => {
    const pill = byId("connection");
    pill.className = `pill ${now}`;
    setText(byId("connection-text"), { open: "connected", connecting: "connecting…", lost: "reconnecting…" }[now]);
  });
  watch("stability", showLimit);
  watch("stabilityMissing", showLimit);
  watch("integrator", showLimit);
  watch("estimate", showLimit);
}

export function methodName(method) {
  return METHODS.find(([name]) => name === method)?.[1] ?? method ?? "–";
}

/** Called a few times a second. */
export function showReadouts() {
  const { diagnostics } = state;
  setText(byId("sim-time"), fixed(state.time, 2));
  setText(byId("run-state"), runState());
  byId("run-state").className = `state ${diagnostics?.state === "diverged" ? "diverged" : state.paused ? "paused" : "running"}`;
  const factor = diagnostics?.real_time_factor ?? NaN;
  setText(byId("out-rtf"), state.paused ? "paused" : `${fixed(factor, 2)}×`);
  byId("out-rtf").classList.toggle("warn", !state.paused && diagnostics?.state === "running" && factor < 0.95);
  setText(byId("out-method"), methodName(state.integrator?.method).replace("Runge–Kutta 4", "RK 4"));
  setText(byId("out-timestep"), duration(state.integrator?.timestep ?? NaN));
  setText(byId("out-servo"), state.enabled == null ? "–" : state.enabled ? "on" : "off");
  setText(byId("out-steps"), `${significant(diagnostics?.steps_per_second ?? NaN, 3)}/s`);
  setText(byId("out-clients"), fixed(diagnostics?.clients ?? NaN, 0));
  setText(byId("out-rate"), `${fixed(state.rate, 0)} Hz`);
  byId("out-rate").classList.toggle("warn", state.connection === "open" && state.rate > 0 && state.rate < LOW_RATE);
  setText(byId("out-drops"), fixed(diagnostics?.dropped ?? NaN, 0));
  byId("out-drops").classList.toggle("warn", diagnostics?.dropped > 0);
}

function runState() {
  if (state.connection !== "open") return "no connection";
  if (state.diagnostics?.state === "diverged") return "diverged";
  return state.paused ? "paused" : "running";
}

/** The limit beside the timestep, and how much of it is used as a bar. */
function showLimit() {
  const most = limit();
  const known = Number.isFinite(most) && most > 0;
  const text = known ? duration(most) : most === 0 ? "no timestep" : most === Infinity ? "any timestep" : state.stabilityMissing ? "not offered" : "–";
  setText(byId("out-limit"), text);
  byId("out-limit").title = state.stabilityMissing ? "This runtime has no /study/stability (no provider)." : "Largest stable timestep, predicted at the present setpoint with the control held over each step.";
  byId("out-limit").classList.toggle("bad", exceedsLimit());
  const bar = byId("limit-bar");
  bar.hidden = !known || state.integrator == null;
  const used = state.integrator ? state.integrator.timestep / most : 0;
  bar.style.setProperty("--used", `${Math.min(100, 100 * used)}%`);
  bar.className = `limit-bar ${used > 1 ? "bad" : used > 0.7 ? "warn" : "good"}`;
  bar.setAttribute("aria-label", `timestep is ${fixed(100 * used, 0)} percent of the stability limit`);
  const { stability, estimate } = state;
  const advice = [];
  if (most === 0) advice.push("Grows at every timestep, by prediction.");
  if (stability?.minimum_over_poses_held > 0) advice.push(`Over all poses: ${duration(stability.minimum_over_poses_held)}.`);
  if (stability?.timestep_limit_continuous > 0) advice.push(`With control in every stage: ${duration(stability.timestep_limit_continuous)}.`);
  if (stability?.advised_timestep > 0) advice.push(`Advised: ${duration(stability.advised_timestep)}.`);
  setText(byId("limit-text"), advice.join(" "));
  setText(byId("out-error"), estimate ? `${significant(estimate.error_per_second, 2)} rad/s` : "–");
}

/** The arm in a sentence, for those who can't see it; read when the view has the focus. */
export function describeArm() {
  if (state.links === 0 || !state.params) return;
  const { x, y } = tip();
  const degrees = Array.from(state.position.subarray(0, state.links), (q) => fixed((q * 180) / Math.PI, 0));
  const goal = state.goal?.outcome === "active" ? ` Target at x ${fixed(state.goal.target.x, 2)}, y ${fixed(state.goal.target.y, 2)} metres, ${fixed(state.goal.distance, 2)} metres away.` : "";
  setText(byId("arm-text"), `${state.links} links, ${runState()}, servo ${state.enabled ? "on" : "off"}. Joints at ${degrees.join(", ")} degrees. `
    + `Tip at x ${fixed(x, 2)}, y ${fixed(y, 2)} metres.${goal}`);
}
