// The page's figures: comparisons, error against run time, growth, files to keep.

import assert from "node:assert/strict";
import { test } from "node:test";

import { between, csvText, record, take } from "../../page/history.js";
import { cheapest, describeRun, distances, endOf, errorText, moveOf, read, rungs, stamp, timestepsFor, total, uncertaintyOf } from "../../page/ladder.js";
import { nearestInReach } from "../../page/mechanics.js";
import { LogScale } from "../../page/scale.js";
import { DEFAULTS } from "../../page/settings.js";
import { state } from "../../page/store.js";

/** A run of one joint at 0.1 s through `seconds` of 2 s, at `slope` rad/s. */
function run(seconds, slope, energy = 1) {
  const times = Array.from({ length: Math.round(seconds * 10) + 1 }, (_, k) => k / 10);
  return {
    method: "euler", timestep: 0.1, times, positions: times.map((t) => [slope * t]), velocities: times.map(() => [slope]),
    energy: times.map((t) => energy * t), evaluations: times.length, wall_time: 1e-3,
    divergence: seconds < 2 ? { step: times.length, time: seconds } : null,
  };
}

test("a finished run has figures, and no divergence", () => {
  const [one, reference] = [run(2, 1.6), run(2, 1)];
  const away = distances(one, reference);
  assert.ok(Math.abs(away.at(-1) - 1.2) < 1e-9);
  const line = describeRun(one, away);
  assert.deepEqual([line.outcome, line.energy, line.error], ["0.1 rad off from 0.20 s on", "2 J", "1.2 rad"]);
  assert.equal(describeRun(one, away.map(() => 0.05)).outcome, "within 0.1 rad");
});

test("a run that diverged has its time, but no energy and no error", () => {
  const one = run(0.6, 3);
  one.energy[6] = null;
  const away = distances(one, run(2, 1));
  const line = describeRun(one, away);
  assert.equal(line.outcome, "diverged at t = 0.60 s");
  assert.deepEqual([line.energy, line.error], ["–", "–"]);
  assert.equal(away[7], null);
  assert.notEqual(away[6], null);
  // The last step may be the one that diverged.
  assert.equal(endOf(run(1.9, 3)), 1.9);
  assert.equal(endOf(run(2, 3)), null);
});

test("a run is not judged by a reference that ended before it, and energy that overflowed is not known", () => {
  const one = run(2, 1);
  one.energy[20] = null;
  for (const reference of [run(0, 1), run(1.5, 9)]) {
    const { outcome, energy, error } = describeRun(one, distances(one, reference));
    assert.deepEqual([outcome, energy, error], ["–", "–", "–"]);
  }
});

test("all methods climb the same ladder, and the cheapest run that is good enough is found for each", () => {
  assert.equal(rungs().length, 4 * timestepsFor().length);
  assert.equal(rungs()[0].timestep, 0.032);
  const rung = (method, error, wall) => ({ method, timestep: 1, error, wall, evaluations: 1, divergedAt: null });
  const best = cheapest([rung("euler", 1e-4, 9), rung("euler", 1e-3, 5), rung("rk4", 1e-2, 1), rung("rk4", 1e-6, 2), rung("verlet", null, 1)], 1e-3);
  assert.deepEqual(best.map(({ method, wall }) => [method, wall]), [["euler", 5], ["rk4", 2]]);
});

test("each timestep of a series divides the control period, so all runs have one controller", () => {
  for (const period of [0.004, 0.0055, 0.01, 1 / 3]) {
    for (const { timestep } of rungs(period)) {
      assert.ok(Math.abs(period / timestep - Math.round(period / timestep)) < 1e-9 && timestep <= period, `${timestep} of ${period}`);
    }
  }
});

test("place and value of a logarithmic scale are each other's inverse", () => {
  const scale = new LogScale(1e-4, 0.1);
  assert.ok(Math.abs(scale.value(scale.place(0.003)) - 0.003) < 1e-15);
  assert.deepEqual(scale.marks.map(([, label]) => label), ["100 µs", "1 ms", "10 ms", "100 ms"]);
});

test("a value moves on a scale in the asked direction only, by no more than the factor, and stops at the ends", () => {
  const scale = new LogScale(1e-4, 0.1);
  const moved = (value) => [scale.moved(value, 1 / 1.1), scale.moved(value, 1), scale.moved(value, 1.1)];
  assert.deepEqual(moved(0.01), [0.01 / 1.1, 0.01, 0.01 * 1.1]);
  assert.deepEqual(moved(0.099), [0.099 / 1.1, 0.099, 0.1]);
  assert.deepEqual(moved(1e-5), [1e-5, 1e-5, 1e-5 * 1.1]);
  assert.deepEqual(moved(0.5), [0.5 / 1.1, 0.5, 0.5]);
});

test("a position out of reach is replaced by the nearest one within", () => {
  const near = (place, lengths, expected) => {
    const found = nearestInReach(place, lengths);
    assert.ok(Math.hypot(found.x - expected.x, found.y - expected.y) < 1e-12, JSON.stringify(found));
  };
  near({ x: 0.3, y: -0.4 }, [1, 1], { x: 0.3, y: -0.4 });
  near({ x: 3, y: 4 }, [1, 1], { x: 1.2, y: 1.6 });
  // Links of 2 m and 0.5 m leave a hole of 1.5 m around the base.
  near({ x: 0, y: -1 }, [2, 0.5], { x: 0, y: -1.5 });
  near({ x: 0, y: 0 }, [2, 0.5], { x: 1.5, y: 0 });
  near({ x: 0, y: 0 }, [1, 1, 1], { x: 0, y: 0 });
});

test("a file has its settings, and empty cells for numbers that are not finite", () => {
  record.clear();
  state.links = 2;
  state.params = DEFAULTS[2].params;
  state.time = 0.5;
  state.position.set([Infinity, 0.25, 0]);
  state.velocity.fill(0);
  state.setpointKnown = false;
  take();
  const lines = csvText(2, DEFAULTS[2]).split("\r\n");
  for (const setting of ["# method=rk4", "# timestep=0.001", "# kp=1000,250", "# masses=1,1", "# controller=off"]) assert.ok(lines.includes(setting), setting);
  const header = lines.find((line) => line.startsWith("time [s]"));
  const row = lines[lines.indexOf(header) + 1].split(",");
  assert.equal(header.split(",").length, row.length);
  assert.deepEqual(row.slice(0, 5), ["0.5", "", "0.25", "", ""]);
});

test("between two states the trail follows the motion, and is straight across a gap", () => {
  record.clear();
  const at = (time, position, velocity) => {
    state.time = time;
    state.position.set([position, 0, 0]);
    state.velocity.set([velocity, 0, 0]);
    take();
  };
  at(0.2, 0.2 ** 3, 3 * 0.2 ** 2);
  at(0.3, 0.3 ** 3, 3 * 0.3 ** 2);
  at(0.4, 0.4 ** 3, 900);
  const q = new Float64Array(3);
  between(record.at(0), record.at(1), 0.5, q);
  assert.ok(Math.abs(q[0] - 0.25 ** 3) < 1e-15);
  between(record.at(1), record.at(2), 0.5, q);
  assert.ok(Math.abs(q[0] - (0.3 ** 3 + 0.4 ** 3) / 2) < 1e-15);
});

test("an error, one below the reference's uncertainty, and one of a chaotic motion differ", () => {
  const rung = (error, error_uncertainty, divergence = null) => read(
    { method: "rk4", timestep: 0.001 }, { divergence, error, error_uncertainty, wall_time: 1e-3, evaluations: 1 },
  );
  assert.equal(errorText(rung(0.00234, 1e-13)), "0.0023");
  assert.equal(errorText(rung(null, 2e-13)), "< 2e\u221212");
  assert.equal(errorText(rung(null, 0.4)), "too wild to follow");
  assert.equal(errorText(rung(null, null)), "no figure");
  assert.equal(errorText(rung(1, 1e-13, { time: 0.5 })), "diverged at 0.5 s");
  assert.equal(uncertaintyOf([rung(1, 1e-13), rung(1, 3e-13), rung(1, null)]), 3e-13);
  assert.equal(uncertaintyOf([rung(1, undefined)]), null);
});

test("a closed loop has two errors, and a run that diverged has none", () => {
  const values = { error: 1e-8, sampling_error: 8e-3, error_uncertainty: 1e-15, wall_time: 1e-3, evaluations: 8 };
  const whole = read({ method: "rk4", timestep: 0.004 }, values);
  assert.deepEqual([whole.error, whole.sampling, total(whole)], [1e-8, 8e-3, 8e-3]);
  assert.equal(errorText(whole), "1e−8 + 0.008");
  assert.deepEqual(cheapest([whole], 1e-3), [], "the hold counts: the method's own error is not all");
  const broken = read({ method: "rk4", timestep: 0.004 }, { ...values, error: 1e136, sampling_error: 1e136, divergence: { time: 2 } });
  assert.deepEqual([broken.error, broken.sampling, broken.divergedAt], [null, null, 2]);
});

test("a measurement names its move and its settings", () => {
  const { params, gains } = DEFAULTS[2];
  const question = { params, gains, setpoint: [1, 2], control_period: 0, delay: false, q: [3, 4], qd: [5, 6], integrator: "rk4", timestep: 0.001 };
  assert.match(stamp(moveOf({ ...question, control_period: 0.004, delay: true }), 2), /controller every 4 ms, delayed, kp/);
  assert.match(stamp(moveOf(question), 2), /^Move to \(0\.9, −1\.3\) rad, 2 s from rest.*controller at every step, kp 1000, 250.*masses 1, 1 kg/);
  assert.match(stamp(moveOf({ ...question, gains: { kp: [0, 0], ki: [0, 0], kd: [0, 0] } }), 2), /^Free swing, 2 s from rest, stretched out; masses 1, 1 kg/);
});
