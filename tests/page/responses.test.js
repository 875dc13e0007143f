// The step on PID: each response is judged with its own settings, and the four effects are told apart.

import assert from "node:assert/strict";
import { test } from "node:test";

import { judge, keep, nameOf, shown } from "../../page/responses.js";

const gains = (ki) => ({ kp: [200, 100], ki: [ki, ki / 2], kd: [60, 20] });
const motors = (anti_windup, effort = [30, 10]) => ({ effort, anti_windup, tracking_time: 0.2 });
const response = (ki, motor, overshoot, error) => ({ gains: gains(ki), motors: motor, name: nameOf(gains(ki), motor), points: [], overshoot, error });

test("overshoot and error are measured from the setpoint", () => {
  const { overshoot, error } = judge([[0, -1.5], [1, 0.25], [2, 0.125]], 0.1);
  assert.ok(Math.abs(overshoot - 0.15) < 1e-12 && Math.abs(error - 0.025) < 1e-12);
  assert.equal(judge([[0, -1.5], [1, -0.2]], 0).overshoot, 0);
});

test("sag, overshoot, windup and cure are told apart", () => {
  const free = motors("clamp", null);
  const only = (...ones) => Object.entries(shown(ones)).filter(([, is]) => is).map(([name]) => name);
  assert.deepEqual(only(response(0, free, 0, 0.1)), ["sag"]);
  assert.deepEqual(only(response(900, free, 0.7, 0)), ["overshoot"]);
  assert.deepEqual(only(response(60, free, 0.03, 0.01)), []);
  const windup = response(60, motors("none"), 0.08, 0.03);
  assert.deepEqual(only(windup), ["windup"]);
  assert.deepEqual(only(windup, response(60, motors("conditional"), 0, 0.005)), ["windup", "cure"]);
  assert.deepEqual(only(windup, response(30, motors("conditional"), 0, 0.005)), ["windup"], "other gains are no cure");
});

test("a response with the same settings replaces the old one, and few are kept", () => {
  const many = [1, 2, 3, 4, 5].map((ki) => response(ki, null, 0, 0)).reduce(keep, []);
  assert.deepEqual(many.map((one) => one.gains.ki[0]), [2, 3, 4, 5]);
  assert.deepEqual(keep(many, response(3, null, 1, 1)).map((one) => one.overshoot), [0, 0, 0, 1]);
});
