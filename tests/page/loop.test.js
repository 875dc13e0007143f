// The linear loop against limits that the runtime's own study found (/study/stability), and against closed forms.

import assert from "node:assert/strict";
import { test } from "node:test";

import { amplification, factorOf, limitOf, loopAt, massMatrix, multipliers, noGains, restPose, scaled } from "../../page/loop.js";

const TWO = { gravity: 9.81, masses: [1, 1], lengths: [1, 1] };
const THREE = { gravity: 9.81, masses: [1, 1, 1], lengths: [1, 1, 1] };
const GAINS_TWO = { kp: [1000, 250], ki: [3000, 750], kd: [110, 22] };
const GAINS_THREE = { kp: [1900, 240, 115], ki: [4800, 500, 340], kd: [185, 32, 5] };
// As /study/stability answers for the starting pose: method, held, in every stage, left to itself.
const SERVED = [
  [TWO, GAINS_TWO, [
    ["euler", 0.004419060161572396, 0.004417632519923102, 0],
    ["midpoint", 0.004315645749141279, 0.004417632519901539, 0],
    ["verlet", 0.004315645749141279, 0.00431564574912098, 0.27821554522733537],
    ["rk4", 0.004315645749141279, 0.006152201711585508, 0.3934562001495723],
  ]],
  [THREE, GAINS_THREE, [
    ["euler", 0.0031727909571147746, 0.0031723963133774855, 0],
    ["midpoint", 0.003123063091770644, 0.0031723963133625634, 0],
    ["verlet", 0.003123063091770644, 0.003123063091756231, 0.19514340978136482],
    ["rk4", 0.003123063091770644, 0.004418027516089482, 0.27597445672085075],
  ]],
];

function near(found, wanted) {
  // The search halves its interval until it is a millionth wide.
  assert.ok(wanted === 0 ? found === 0 : Math.abs(found / wanted - 1) < 1e-6, `${found}, wanted ${wanted}`);
}

for (const [arm, gains, rows] of SERVED) {
  for (const [method, held, continuous, free] of rows) {
    test(`${method} with ${arm.masses.length} links has the limits that the runtime serves`, () => {
      const zero = arm.masses.map(() => 0);
      const loop = loopAt(arm, gains, restPose(arm, gains, zero));
      near(limitOf(loop, method, true), held);
      near(limitOf(loop, method, false), continuous);
      const none = noGains(zero.length);
      near(limitOf(loopAt(arm, none, restPose(arm, none, zero)), method), free);
    });
  }
}

test("a step just beyond the limit has a multiplier outside the unit circle, one just below has none", () => {
  const loop = loopAt(TWO, GAINS_TWO, [0, 0]);
  const limit = limitOf(loop, "rk4");
  const largest = (h) => Math.max(...multipliers(loop, "rk4", h).map(({ re, im }) => Math.hypot(re, im)));
  assert.ok(largest(0.99 * limit) < 1);
  assert.ok(largest(1.01 * limit) > 1);
});

test("stiffer gains bear only smaller timesteps", () => {
  const limit = (factor) => limitOf(loopAt(TWO, scaled(GAINS_TWO, factor), [0, 0]), "rk4");
  assert.ok(limit(2) < limit(1) && limit(1) < limit(0.5));
});

test("nothing limits an arm without gravity and control", () => {
  assert.equal(limitOf(loopAt({ ...TWO, gravity: 0 }, noGains(2), [0, 0]), "euler"), Infinity);
});

test("a single rod has the inertia of a rod about its end, m l² / 3", () => {
  assert.deepEqual(massMatrix([0.4], { gravity: 0, masses: [3], lengths: [2] }), [[4]]);
});

test("regions of stability end where the textbooks say", () => {
  // Euler and midpoint on the real axis at -2, RK4 at -2.7853 and at 2 sqrt(2) i, Verlet on the imaginary axis at 2i.
  for (const [method, re, im] of [["euler", -2, 0], ["midpoint", -2, 0], ["rk4", -2.785293563, 0], ["rk4", 0, Math.sqrt(8)]]) {
    assert.ok(Math.abs(amplification(method, re, im) - 1) < 1e-8, method);
  }
  assert.ok(amplification("verlet", 0, 1.99) < 1 + 1e-12);
  assert.ok(amplification("verlet", 0, 2.01) > 1.05);
});

test("gains that are a multiple of others are told, so that the map stays and the dot moves", () => {
  const base = { kp: [1000, 250], ki: [3000, 0], kd: [110, 22] };
  assert.ok(Math.abs(factorOf(scaled(base, 2.5), base) - 2.5) < 1e-12);
  for (const other of [{ ...base, kd: [110, 44] }, { ...base, ki: [3000, 1] }, null]) assert.ok(Number.isNaN(factorOf(other, base)));
});
