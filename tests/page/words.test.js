// Numbers in words, scales, medians, settings in links, and the way back.

import assert from "node:assert/strict";
import { test } from "node:test";

import { Axis, symmetricLog } from "../../page/axis.js";
import { duration, exact, fixed, plain, short, significant } from "../../page/format.js";
import { LESSONS } from "../../page/lessons.js";
import { DEFAULTS, Undo, fromFragment, presentSettings, toFragment } from "../../page/settings.js";
import { Median } from "../../page/smooth.js";

test("a field shows four digits, and its exponent whole", () => {
  assert.equal(plain(3.00591098005247), "3.006");
  assert.equal(plain(-3.75616e73), "-3.756e+73");
  assert.equal(plain(1234567), "1235000");
  assert.equal(plain(NaN), "");
});

test("a figure in a caption keeps its digits few", () => {
  assert.deepEqual([short(-0.0421, 3), short(2271.893, 3), short(-7450.32, 2), short(123456.7, 2), short(1e9, 3), short(0, 3), short(NaN, 3)],
    ["−0.042", "2271.9", "−7450.3", "123457", "1e9", "0.000", "–"]);
});

test("a link keeps all digits", () => {
  assert.equal(Number(exact(0.1 + 0.2)), 0.1 + 0.2);
});

test("what is not finite is a dash", () => {
  for (const text of [fixed(NaN, 2), significant(Infinity, 3), duration(-Infinity)]) assert.equal(text, "–");
});

test("durations have the unit that suits them", () => {
  assert.deepEqual([duration(0.00345), duration(2.5e-5), duration(1), duration(0)], ["3.45 ms", "25 µs", "1 s", "0 s"]);
});

test("an axis is linear while values are sane, logarithmic once they explode", () => {
  const axis = new Axis(4, 0.2, 100);
  axis.begin();
  for (const value of [-1, 3]) axis.offer(value);
  axis.end();
  assert.ok(!axis.log && axis.low <= -1 && axis.high >= 3);
  axis.begin();
  for (const value of [-1, 3, 1e148]) axis.offer(value);
  axis.end();
  assert.ok(axis.log);
  // Equal factors are equal distances, and one radian is still told from none.
  const distance = axis.place(1e11) - axis.place(1e9);
  assert.ok(Math.abs(axis.place(1e7) - axis.place(1e5) - distance) < 1e-6);
  assert.ok(axis.place(1) > axis.place(0));
  // The scale ends; values beyond stay at its edge.
  assert.equal(axis.place(1e148), axis.place(1e12));
});

test("a fixed scale stays", () => {
  const axis = new Axis(4, 0.2, 100);
  axis.begin();
  axis.offer(2);
  axis.end();
  const { high } = axis;
  axis.fixed = true;
  axis.begin();
  axis.offer(50);
  axis.end();
  assert.equal(axis.high, high);
});

test("the symmetric logarithm is odd and near zero the identity over ln 10", () => {
  assert.equal(symmetricLog(-9), -1);
  assert.ok(Math.abs(symmetricLog(1e-6) - 1e-6 / Math.LN10) < 1e-12);
});

test("a median is not moved by one wild reading, and forgets", () => {
  const median = new Median(5);
  for (const value of [1, 1.1, 1e9, 0.9, 1]) median.add(value);
  assert.equal(median.value, 1);
  for (let k = 0; k < 5; k += 1) median.add(7);
  assert.equal(median.value, 7);
  median.clear();
  assert.ok(Number.isNaN(median.value));
});

test("settings survive a link", () => {
  for (const links of [2, 3]) {
    const settings = { ...DEFAULTS[links], period: { period: 0.0021, delay: true }, setpoint: [0.1 + 0.2, -1e-9, 3].slice(0, links), servo: true };
    assert.deepEqual(fromFragment(`#${toFragment(settings, links)}`), settings);
  }
});

test("a link may hold less, and what is none of ours is left out", () => {
  const settings = fromFragment("#kp=1,2&method=leapfrog&__proto__=1");
  assert.deepEqual(settings.gains, { kp: [1, 2] });
  assert.equal(settings.integrator, null);
});

test("a link may say where the arm is let go", () => {
  assert.deepEqual(fromFragment("#position=0.3,-1e-6&velocity=2,0").start, { position: [0.3, -1e-6], velocity: [2, 0] });
  assert.equal(fromFragment("#kp=1,2").start, undefined);
});

test("settings are present once the runtime has said them all", () => {
  assert.equal(presentSettings({ links: 2, integrator: null }), null);
});

test("a slider that is dragged is one change to undo", () => {
  const undo = new Undo();
  undo.remember(DEFAULTS[2], 0);
  undo.remember({ ...DEFAULTS[2], servo: true }, 300);
  undo.remember({ ...DEFAULTS[2], servo: true }, 900);
  const present = { ...DEFAULTS[2], integrator: null };
  assert.deepEqual(undo.take(present), DEFAULTS[2]);
  assert.equal(undo.take(present), undefined);
});

test("a change that was refused is none to undo", () => {
  const undo = new Undo();
  const before = { ...DEFAULTS[2], servo: true };
  undo.remember(before, 0);
  undo.remember(DEFAULTS[2], 2000);
  undo.remember(structuredClone(DEFAULTS[2]), 4000);
  assert.ok(undo.leadsBackFrom(DEFAULTS[2]));
  assert.deepEqual(undo.take(DEFAULTS[2]), before);
  undo.remember(DEFAULTS[2], 6000);
  assert.ok(!undo.leadsBackFrom(DEFAULTS[2]));
  assert.equal(undo.take(DEFAULTS[2]), undefined);
});

test("every lesson has a few short sentences and whole settings for any arm", () => {
  for (const lesson of LESSONS) {
    const sentences = lesson.text.split(/(?<=[.!?]) /);
    assert.ok(sentences.length >= 2 && sentences.length <= 5, lesson.id);
    for (const sentence of sentences) assert.ok(sentence.split(" ").length <= 30, sentence);
    for (const links of [2, 3]) {
      const { params, gains, setpoint, integrator } = lesson.settings(links);
      for (const list of [params.masses, params.lengths, gains.kp, gains.ki, gains.kd, setpoint]) assert.equal(list.length, links);
      assert.ok(integrator.method && integrator.timestep > 0);
    }
  }
});
