// The recording looked at again: within its bounds, between its rows, and back to now.

import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { advance, follow, goLive, play, record, seek, shown, span, stepBy, take } from "../../page/history.js";
import { state } from "../../page/store.js";

/** A joint that moves as t³, sampled ten times a second through two seconds. */
beforeEach(() => {
  record.clear();
  state.links = 2;
  state.params = { gravity: 9.81, masses: [1, 1], lengths: [1, 1] };
  state.setpointKnown = true;
  for (let k = 0; k <= 20; k += 1) {
    const t = k / 10;
    state.time = t;
    state.position.set([t ** 3, 0, 0]);
    state.velocity.set([3 * t * t, 0, 0]);
    take();
  }
  goLive();
});

test("it begins with the arm as it is", () => {
  assert.ok(shown.live);
  assert.equal(shown.position[0], 8);
  assert.deepEqual(span(), { from: 0, to: 2 });
});

test("between two rows it follows the motion, by positions and velocities", () => {
  seek(0.25);
  assert.ok(!shown.live);
  assert.ok(Math.abs(shown.position[0] - 0.25 ** 3) < 1e-12);
});

test("it stays within what is recorded", () => {
  seek(-5);
  assert.equal(shown.time, 0);
  seek(99);
  assert.equal(shown.time, 2);
});

test("it steps from row to row, also off the live end", () => {
  stepBy(-1);
  assert.ok(Math.abs(shown.time - 1.9) < 1e-12);
  stepBy(-1);
  stepBy(1);
  assert.ok(Math.abs(shown.time - 1.9) < 1e-12);
});

test("slow motion goes at a part of real time, and ends at the live arm", () => {
  play(0.1, 1);
  assert.equal(shown.time, 1);
  advance(1);
  assert.ok(Math.abs(shown.time - 1.1) < 1e-12);
  advance(100);
  assert.ok(shown.live);
});

test("while the recording is looked at the arm goes on unseen", () => {
  seek(1);
  state.position.set([77, 0, 0]);
  follow();
  assert.equal(shown.position[0], 1);
  goLive();
  assert.equal(shown.position[0], 77);
});
