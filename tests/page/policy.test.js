// The verdict on the timestep: only about the active loop, and never too mild. The reason for a limit.

import assert from "node:assert/strict";
import { test } from "node:test";

import {
  answerInForce, controlPeriodLimit, doublingTime, energyName, factorOf, keepAnswer, limitInForce, motionHasChanged, periodText, scaled, verdict, whyText,
} from "../../page/policy.js";
import { loopKey, noGains, questionOf } from "../../page/question.js";

const VALUES = {
  timestep_limit_held: 0.0136, timestep_limit_continuous: 0.0204, minimum_over_poses_held: 0.00432,
  minimum_over_poses_continuous: 0.00615, advised_timestep: 0.00345,
};

function arm(changed = {}) {
  const state = {
    connection: "open", links: 2, enabled: true, setpointKnown: true, setpoint: Float64Array.of(0.9, -1.3, 0),
    position: new Float64Array(3), velocity: new Float64Array(3),
    integrator: { method: "rk4", timestep: 0.001 }, params: { gravity: 9.81, masses: [1, 1], lengths: [1, 1] },
    gains: { kp: [1000, 250], ki: [3000, 750], kd: [110, 22] }, period: { period: 0, effective_period: 0.001, delay: false },
      diagnostics: { state: "running" }, ...changed,
  };
  const { answers = { [state.integrator.method]: changed.stability ?? VALUES }, motions = {} } = changed;
  const asked = questionOf(state);
  const broken = state.diagnostics?.state === "diverged" ? asked : null; // the page saw it, and nothing has changed since
  return { broken, ...state, limits: { loop: asked ? loopKey(asked) : "", answers, motions } };
}

test("an answer about another loop is ignored, and gives no button", () => {
  const on = arm({ integrator: { method: "rk4", timestep: 0.01 } });
  const off = { ...on, enabled: false };
  assert.equal(answerInForce(off), null);
  const said = verdict(off);
  assert.equal(said.kind, "unknown");
  assert.ok(Number.isNaN(said.limit) && Number.isNaN(said.advised));
});

test("an answer without the delay is none for the loop with it, and the other way round", () => {
  const off = arm();
  const on = { ...off, period: { ...off.period, delay: true } };
  assert.ok(answerInForce(off));
  assert.equal(answerInForce(on), null);
  keepAnswer(on, { ...questionOf(on), integrator: "rk4" }, { ...VALUES, control_period_limit: 0.002 });
  assert.equal(controlPeriodLimit(on), 0.002);
  assert.equal(answerInForce({ ...on, period: off.period }), null);
});

const ADVISED = 0.8 * VALUES.minimum_over_poses_held;
const at = (timestep, changed = {}) => ({ integrator: { method: "rk4", timestep }, ...changed });
const served = (changed) => ({ stability: { ...VALUES, ...changed } });

/** A row: the case, its changed values, and the expected parts of the verdict. */
const VERDICTS = [
  ["within the limit of every pose", {}, { kind: "stable" }],
  ["within the limit of this pose alone", at(0.006), {
     kind: "here", sentence: /at the setpoint \(0\.90, −1\.30\) rad, but other poses are stable only up to 4\.32 ms/, advised: ADVISED }],
  ["beyond the limit", at(0.02), { kind: "beyond", sentence: /20 ms is above .* 13\.6 ms, at the setpoint/ }],
  ["a motion with a smaller limit than the pose", at(0.006, served({
    timestep_limit_motion: 0.004, motion_speed: 12.5, equilibrium: [0.9, -1.3], equilibrium_kind: "setpoint",
  })), { kind: "beyond", pill: "beyond the estimated limit", where: /^moving at up to 12\.5 rad\/s$/ }],
  ["a pose that the arm sags to", served({ equilibrium: [0.5, -1.4], equilibrium_kind: "sagging" }),
    { where: /^at the pose to which it sags, \(0\.50, −1\.40\) rad$/ }],
  ["Euler's free swing", { enabled: false, ...served({ timestep_limit_held: 0, advised_timestep: 0, minimum_over_poses_held: 0 }) },
    { kind: "never", advised: NaN }],
  ["nothing that limits", { enabled: false, stability: Object.fromEntries(Object.keys(VALUES).map((key) => [key, null])) },
    { kind: "stable", limit: Infinity, sentence: /^No limit was found, / }],
  ["numbers that overflow without a controller",
    { enabled: false, ...served({ timestep_limit_held: 0, equilibrium: [-1.57, 0], equilibrium_kind: "unstable" }) },
    { sentence: "No stable timestep is known, at (−1.57, 0.00) rad." }],
  ["an arm that has diverged", { diagnostics: { state: "diverged" } }, { kind: "diverged" }],
];
for (const [name, changed, wanted] of VERDICTS) {
  test(`the verdict on ${name}`, () => {
    const said = verdict(arm(changed));
    for (const [part, value] of Object.entries(wanted)) if (value instanceof RegExp) assert.match(said[part], value); else assert.equal(said[part], value);
  });
}

test("beyond the limit, or after divergence, the limit of the pose counts instead of the motion's", () => {
  const thrashing = { ...VALUES, timestep_limit_motion: 1e-150, motion_speed: 5.6e156, equilibrium: [0.9, -1.3], equilibrium_kind: "setpoint" };
  for (const changed of [{ integrator: { method: "rk4", timestep: 0.02 } },
    { integrator: { method: "rk4", timestep: 0.02 }, diagnostics: { state: "diverged" } }]) {
    const found = limitInForce(arm({ stability: thrashing, motions: { rk4: { limit: 1e-6, speed: 1e6 } }, ...changed }));
    assert.deepEqual([found.limit, found.everyPose], [VALUES.timestep_limit_held, VALUES.minimum_over_poses_held]);
    assert.match(found.where, /^at the setpoint/);
    assert.equal(found.advised, 0.8 * VALUES.minimum_over_poses_held);
  }
});

test("a new limit of the motion causes a new request to the study", () => {
  const changed = (then, now) => motionHasChanged({ timestep_limit_motion: then }, { timestep_limit_motion: now });
  assert.ok(changed(0.004, 0.008) && changed(null, 0.004) && changed(0.004, Infinity));
  assert.ok(!changed(0.004, 0.0041) && !changed(null, Infinity) && !changed(0.004, NaN) && !changed(undefined, 0.004));
});

const sampled = (period, changed = {}) => arm({ period: { period, effective_period: period, delay: false }, ...changed });

test("a control period that is too long is unstable, however short the timestep", () => {
  const said = verdict(sampled(0.02));
  assert.deepEqual([said.kind, said.slow], ["beyond", true]);
  assert.match(said.sentence, /^A control period of 20 ms is above the limit 13\.6 ms, at the setpoint/);
  assert.ok(Number.isNaN(said.advised), "no smaller timestep helps");
  const here = verdict(sampled(0.006));
  assert.equal(here.kind, "here");
  assert.match(here.sentence, /^A control period of 6 ms is stable at the setpoint/);
  assert.equal(verdict(sampled(0.004)).kind, "stable");
});

const TWO_CLOCKS = { ...VALUES, timestep_limit: 0.08, timestep_limit_held: 0.08, control_period_limit: 0.104, minimum_over_poses_held: 0.09,
  timestep_limit_motion: 0.018, motion_speed: 22 };

test("the motion limits the timestep, not the control period", () => {
  assert.match(verdict(sampled(0.05, { stability: TWO_CLOCKS })).sentence, /^A control period of 50 ms is within the limit 104 ms, at the setpoint/);
  const coarse = verdict(sampled(0.05, { stability: TWO_CLOCKS, ...at(0.025) }));
  assert.match(coarse.sentence, /^25 ms is above the estimated limit 18 ms, moving at up to 22 rad\/s/);
  assert.deepEqual([coarse.kind, coarse.slow, coarse.advised < 0.018], ["beyond", false, true]);
  const shaking = sampled(0.2, { stability: { ...TWO_CLOCKS, timestep_limit: 0 } });
  assert.match(limitInForce(shaking).where, /^at the setpoint/, "its speed is that of the shaking");
  keepAnswer(shaking, { ...questionOf(shaking), integrator: "rk4" }, TWO_CLOCKS);
  assert.deepEqual(shaking.limits.motions, {});
  const noController = { gains: noGains(2), stability: TWO_CLOCKS };
  assert.deepEqual(verdict(sampled(0.05, noController)), verdict(arm(noController)));
});

test("a control period below the timestep, or without a controller, changes nothing", () => {
  for (const state of [sampled(0.0001), sampled(0.0014)]) assert.deepEqual(verdict(state), verdict(arm()));
  assert.deepEqual(verdict(sampled(0.02, { enabled: false })), verdict(arm({ enabled: false })));
});

test("the limit of the control period is the answer's own, or the timestep's where the answer names none", () => {
  assert.equal(controlPeriodLimit(arm()), VALUES.timestep_limit_held);
  assert.equal(controlPeriodLimit(arm({ stability: { ...VALUES, control_period_limit: 0.012 } })), 0.012);
  assert.equal(controlPeriodLimit(arm({ stability: { ...VALUES, control_period_limit: null } })), Infinity);
  assert.ok(Number.isNaN(controlPeriodLimit(arm({ enabled: false }))));
  // With a delay it is not known unless the answer names it.
  const delayed = { period: { period: 0, effective_period: 0.001, delay: true } };
  assert.equal(verdict(arm(delayed)).kind, "unknown");
  assert.equal(verdict(arm({ ...delayed, stability: { ...VALUES, control_period_limit: 0.0008 } })).kind, "beyond");
});

test("the control period is given in steps and in time", () => {
  assert.equal(periodText(arm()), "");
  assert.equal(periodText(sampled(0.0101)), "10 steps, 10 ms");
  const delayed = { period: 0.01, effective_period: 0.01, delay: true };
  assert.equal(periodText(arm({ period: delayed })), "10 steps, 10 ms, delayed");
  assert.equal(periodText(arm({ period: null })), "");
});

test("energy drifts only if nothing puts any in", () => {
  const name = (enabled, pushed) => energyName({ enabled, pushed });
  assert.deepEqual([name(false, false), name(true, false), name(false, true)], ["drift", "work", "pushed in"]);
});

const FREE = {
  timestep_limit_held: 0.278, timestep_limit: 0.278, timestep_limit_continuous: 0.278, minimum_over_poses_held: 0.278, equilibrium: [-Math.PI / 2, 0],
  equilibrium_kind: "hanging", critical: { growth_per_step: 2.4, frequency: 1.14, joint: 1 }, timestep_limit_motion: 0.0488, motion_speed: 16.4,
    advised_timestep: 0.039,
};
const swing = (method, timestep, changed = {}) => arm({ enabled: false, integrator: { method, timestep }, stability: FREE, ...changed });

test("after a divergence the earlier limit of the motion counts, and the advice is never the diverged timestep", () => {
  const wild = { ...FREE, timestep_limit_motion: 1e-150, motion_speed: 1e150 };
  const diverged = { diagnostics: { state: "diverged", message: "" }, stability: wild };
  const known = swing("verlet", 0.1, { ...diverged, motions: { verlet: { limit: 0.0488, speed: 16.4 } } });
  assert.deepEqual([limitInForce(known).limit, verdict(known).kind], [0.0488, "diverged"]);
  assert.equal(verdict(known).advised, 0.8 * 0.0488);
  assert.match(verdict(known).sentence, /100 ms is above the estimated limit 48\.8 ms, moving at up to 16\.4 rad\/s/);
  const unknown = swing("verlet", 0.1, diverged);
  assert.equal(verdict(unknown).advised, 0.05);
});

test("a divergence is blamed on the timestep at which it happened, not on a later one", () => {
  const diverged = { diagnostics: { state: "diverged", message: "" } };
  const then = arm({ ...at(0.02), ...diverged });
  const shorter = { ...then, integrator: { method: "rk4", timestep: 0.0001 } };
  for (const state of [then, shorter]) assert.match(verdict(state).sentence, /^20 ms is above the limit 13\.6 ms/);
  assert.equal(verdict(then).advised, 0.8 * VALUES.minimum_over_poses_held);
  assert.ok(Number.isNaN(verdict(shorter).advised), "the arm may restart as it is set now");
  const softer = { ...shorter, gains: { ...then.gains, kp: [10, 10] } };
  assert.equal(verdict({ ...softer, limits: arm(softer).limits }).sentence, "Other settings are in force now.");
  assert.equal(verdict({ ...shorter, broken: null }).sentence, "", "the page has not seen it");
});

test("the motion's first limit is kept, and none of an arm that has diverged", () => {
  const state = swing("verlet", 0.1, { answers: {} });
    keepAnswer(state, { ...questionOf(state), integrator: "verlet" }, FREE);
  keepAnswer(state, { ...questionOf(state), integrator: "verlet" }, { ...FREE, timestep_limit_motion: 0.01 });
  assert.equal(state.limits.motions.verlet.limit, 0.0488);
  state.diagnostics = { state: "diverged" };
  keepAnswer(state, { ...questionOf(state), integrator: "rk4" }, { ...FREE, timestep_limit_motion: 1e-150 });
  assert.equal(state.limits.motions.rk4, undefined);
  const shaking = arm({ integrator: { method: "rk4", timestep: 0.02 } });
  keepAnswer(shaking, { ...questionOf(shaking), integrator: "rk4" }, VALUES);
  assert.deepEqual(shaking.limits.motions, {});
  keepAnswer(state, { ...questionOf(state), params: { gravity: 0, masses: [1, 1], lengths: [1, 1] }, integrator: "rk4" }, FREE);
  assert.deepEqual(Object.keys(state.limits.answers), ["rk4"]);
});

test("a button's limit counts the motion, whatever the method", () => {
  const state = swing("verlet", 0.001, { answers: {
    verlet: FREE, rk4: { ...FREE, timestep_limit_held: 0.393, timestep_limit: 0.393, timestep_limit_motion: 0.0762 } } });
  assert.deepEqual(["verlet", "rk4", "euler"].map((method) => limitInForce(state, method).limit), [0.0488, 0.0762, NaN]);
  // Midpoint's free swing gains energy slowly at short steps. Euler's does not.
  const grows = { ...FREE, timestep_limit_held: 0, timestep_limit: 0 };
  const midpoint = [1e-6, 0.001, 0.02, 0.1].map((timestep) => limitInForce(swing("midpoint", timestep, { stability: grows })).limit);
  for (const limit of midpoint) assert.equal(limit, midpoint[0], "no limit depends on the timestep");
  assert.ok(Math.abs(doublingTime("midpoint", midpoint[0], grows) - 600) < 1e-6 && Math.abs(midpoint[0] - 0.01206) < 1e-5);
  assert.equal(limitInForce(swing("midpoint", 0.001, { stability: { ...grows, timestep_limit_motion: 0.005 } })).limit, 0.005);
  assert.equal(limitInForce(swing("euler", 0.001, { stability: grows })).limit, 0);
  assert.ok(Math.abs(doublingTime("euler", 0.001, grows) - 13.5) < 0.1);
});

test("with a control period of its own the timestep has its own limit", () => {
  const twoClocks = { ...VALUES, timestep_limit: 0.002, control_period_limit: 0.0136 };
  assert.equal(limitInForce(sampled(0.004, { stability: twoClocks })).limit, 0.002);
  assert.equal(limitInForce(sampled(0.02, { stability: { ...twoClocks, timestep_limit: 0 } })).limit, VALUES.timestep_limit_held);
});

// The reason

// As /study/stability answers for the usual gains, stretched out.
const SERVED = {
  timestep_limit_held: 0.004316, timestep_limit_continuous: 0.00615, minimum_over_poses_held: 0.004316, equilibrium_kind: "setpoint",
  critical: { growth_per_step: 1.2051, frequency: 105.325, joint: 1 },
};
const ALIKE = { euler: 0.004419, midpoint: 0.004316, verlet: 0.004316, rk4: 0.004316 };

/** The reason with an answer of the study, and each method's limit. */
const why = (answer, limits, changed = {}) => {
  const answers = Object.entries(limits).map(([method, limit]) => [method, { ...answer, timestep_limit_held: limit }]);
  return whyText(arm({ answers: Object.fromEntries(answers), ...changed }));
};

test("a deviation that flips at every step is named with its joint and its growth", () => {
  const text = why(SERVED, ALIKE);
  assert.match(text, /^Why 4\.32 ms: joint 2 is the fastest\. A torque that is held longer overshoots: .* flips at every step and grows by 21 %/);
  assert.match(text, /A better method hardly helps/);
  assert.match(why({ ...SERVED, minimum_over_poses_held: 0.002 }, ALIKE), /^Why 2 ms, the smallest limit of all poses: a swing of joint 2/);
});

test("a swing is named by its frequency, and methods with a longer limit by their names", () => {
  const swing = { ...SERVED, critical: { growth_per_step: 1.01, frequency: 3.66, joint: 0 } };
  const text = why(swing, { ...ALIKE, euler: 0.001 });
  assert.match(text, /a swing of joint 1 at 3\.66 Hz/);
  assert.match(text, /Midpoint, Verlet, Runge–Kutta 4: stable up to 4\.32 ms/);
});

test("the free arm has no damping, and Euler increases every swing", () => {
  const euler = { enabled: false, integrator: { method: "euler", timestep: 0.001 } };
  assert.match(why(SERVED, { ...ALIKE, euler: 0 }, euler), /With Euler even a small swing grows/);
});

test("gains that are unstable by themselves are not explained by the method", () => {
  const none = { euler: 0, midpoint: 0, verlet: 0, rk4: 0 };
  assert.match(why({ ...SERVED, timestep_limit_continuous: 0 }, none), /no stable timestep is known for these gains/);
  assert.match(why(SERVED, none), /too little damps the arm here/);
});

test("an unknown loop has no verdict", () => {
  assert.equal(why(SERVED, { rk4: 0.004316 }), "", "the other methods are asked about");
  assert.equal(whyText({ ...arm(), gains: null }), "");
});

// Gains

test("a multiple of the gains is recognised, so the map stays and the dot moves", () => {
  const base = { kp: [1000, 250], ki: [3000, 0], kd: [110, 22] };
  assert.ok(Math.abs(factorOf(scaled(base, 2.5), base) - 2.5) < 1e-12);
  for (const other of [{ ...base, kd: [110, 44] }, { ...base, ki: [3000, 1] }, null]) assert.ok(Number.isNaN(factorOf(other, base)));
});
