// Multiples of gains, which the map of stability is drawn by.

import assert from "node:assert/strict";
import { test } from "node:test";

import { factorOf, isFree, noGains, scaled } from "../../page/gains.js";

test("gains that are a multiple of others are told, so that the map stays and the dot moves", () => {
  const base = { kp: [1000, 250], ki: [3000, 0], kd: [110, 22] };
  assert.ok(Math.abs(factorOf(scaled(base, 2.5), base) - 2.5) < 1e-12);
  for (const other of [{ ...base, kd: [110, 44] }, { ...base, ki: [3000, 1] }, null]) assert.ok(Number.isNaN(factorOf(other, base)));
});

test("no gains at all leave the arm to itself", () => {
  assert.ok(isFree(noGains(3)));
  assert.ok(!isFree({ ...noGains(2), kd: [0, 1] }));
});
