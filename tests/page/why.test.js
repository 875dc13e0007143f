// The reason for a limit: said of the loop in force, from the study's answer.

import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";

import { DEFAULTS } from "../../page/settings.js";
import { whyText } from "../../page/policy.js";

// As /study/stability answers for the usual gains, stretched out.
const SERVED = {
  timestep_limit_held: 0.004316, timestep_limit_continuous: 0.00615, minimum_over_poses_held: 0.004316, equilibrium_kind: "setpoint",
  critical: { growth_per_step: 1.2051, frequency: 105.325, joint: 1 },
};
const ALIKE = { euler: 0.004419, midpoint: 0.004316, verlet: 0.004316, rk4: 0.004316 };

function arm(changed = {}) {
  const { integrator, gains } = DEFAULTS[2];
  return { enabled: true, integrator, gains, ...changed };
}

test("a deviation that flips at every step is named with its joint and its growth", () => {
  const text = whyText(arm(), SERVED, ALIKE);
  assert.match(text, /^Why 4\.32 ms: joint 2 is the fastest\. A torque that is kept longer overshoots: .* flips at every step and grows by 21 %/);
  assert.match(text, /A better method does not help/);
});

test("a swing is named by its frequency, and methods with a longer limit by their names", () => {
  const swing = { ...SERVED, critical: { growth_per_step: 1.01, frequency: 3.66, joint: 0 } };
  const text = whyText(arm(), swing, { ...ALIKE, euler: 0.001 });
  assert.match(text, /a swing of joint 1 at 3\.66 Hz/);
  assert.match(text, /Midpoint, Verlet, Runge–Kutta 4: stable up to 4\.32 ms/);
});

test("the free arm is damped by nothing, and Euler adds to every swing", () => {
  const euler = arm({ enabled: false, integrator: { method: "euler", timestep: 0.001 } });
  assert.match(whyText(euler, SERVED, { ...ALIKE, euler: 0 }), /Every step of Euler adds a little to each swing/);
});

test("where the gains themselves are at fault no method is blamed", () => {
  const none = { euler: 0, midpoint: 0, verlet: 0, rk4: 0 };
  assert.match(whyText(arm(), { ...SERVED, timestep_limit_continuous: 0 }, none), /any method and any timestep/);
  assert.match(whyText(arm(), SERVED, none), /nothing damps the arm here/);
});

test("nothing is said of a loop that is not known", () => {
  assert.equal(whyText(arm(), null, ALIKE), "");
  assert.equal(whyText(arm(), SERVED, {}), "");
});

test("every module of the page is checked for its types", () => {
  const folder = new URL("../../page/", import.meta.url);
  const unchecked = readdirSync(folder).filter((name) => name.endsWith(".js") && !readFileSync(new URL(name, folder), "utf8").startsWith("// @ts-check\n"));
  assert.deepEqual(unchecked, []);
});
