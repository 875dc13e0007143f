// The course: short steps, tasks that tick themselves, and the scenes of the report.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { STEPS, followEnergy, nothingSeen, ofLimit, shrinks, stepIn } from "../../page/course.js";
import { SCENES, settingsOf } from "../../page/scenes.js";

const words = (text) => text.split(/\s+/).length;

test("eleven steps, each with scenes, at most 40 words, and sentences of at most 25", () => {
  assert.equal(STEPS.length, 11);
  for (const { id, text, scene } of STEPS) {
    for (const links of [2, 3]) assert.equal(scene(links).gains.kp.length, links, id);
    assert.ok(words(text) <= 40, `${id}: ${words(text)} words`);
    for (const sentence of text.split(/[.?!](?=\s|$)/)) assert.ok(words(sentence) <= 25, `${id}: ${sentence}`);
  }
});

test("every question has one right answer, with the reason", () => {
  for (const { id, question, guess } of STEPS) {
    for (const one of guess ? [question, guess] : [question]) {
      assert.ok(one.right >= 0 && one.right < one.answers.length && one.because.length > 20, id);
      assert.equal(new Set(one.answers).size, one.answers.length, id);
      assert.doesNotMatch(one.text, /every \d/, `${id}: three links have other periods`);
    }
  }
});

test("no task is done before anything is done, and each can be", () => {
  const all = { methods: new Set(["euler", "midpoint", "verlet", "rk4"]), reached: true, shook: true, shrinks: true, gain: 100, stable: true,
    measured: true, scenes: new Set("123"), energy: { timestep: 0.005, since: 0.01, until: 10, low: -0.05, high: 0.1 }, sheet: true,
      responses: { sag: true, overshoot: true, windup: true, cure: true } };
  for (const { id, task } of STEPS) {
    assert.equal(task.done(nothingSeen()), false, id);
    assert.equal(task.done(all), true, id);
  }
});

test("energy is kept at 5 ms, for ten seconds from the start, within 0.1 J, and not otherwise", () => {
  const { done } = STEPS.find(({ id }) => id === "energy").task;
  const keeps = ({ growth = 0, seconds = 10, timestep = 0.005, from = 0.016, of = () => "rk4" }) => {
    let { energy } = nothingSeen();
    for (let time = from; time <= seconds; time += 0.125) energy = followEnergy(energy, of(time), timestep, time, growth * time);
    energy = followEnergy(energy, of(seconds), timestep, seconds, growth * seconds);
    return done({ ...nothingSeen(), energy });
  };
  assert.ok(keeps({}) && keeps({ growth: 0.0099 }) && keeps({ growth: -0.0099 }));
  assert.ok(!keeps({ growth: 0.011 }) && !keeps({ growth: -0.011 }), "more than 0.1 J");
  assert.ok(!keeps({ seconds: 9.9 }), "too short");
  assert.ok(!keeps({ timestep: 0.01 }) && !keeps({ timestep: 0.001 }), "another timestep");
  assert.ok(!keeps({ from: 1, seconds: 12 }), "not from the start");
  assert.ok(!keeps({ of: (time) => (time < 2 ? "rk4" : "verlet"), seconds: 11.9 }), "another method on the way");
  // What was lost stays lost, although the energy of the rest varies little.
  let { energy } = nothingSeen();
  for (let time = 0.016; time < 40; time += 0.1) energy = followEnergy(energy, "verlet", 0.005, time, time < 1 ? -16 * time : -16);
  assert.ok(!done({ ...nothingSeen(), energy }));
});

test("bars that flip and grow differ from bars that decay", () => {
  assert.equal(shrinks([0.09, -0.16, 0.14, -0.4, 0.39, -0.9, 1.09, -2.06]), false);
  assert.equal(shrinks([0.3, -0.2, 0.1, -0.05, 0.02, -0.01]), true);
  assert.equal(shrinks([]), false);
});

test("a time and its limit have the same unit", () => {
  assert.equal(ofLimit(5.5, 4.316), "5.5 of 4.3 ms");
  assert.equal(ofLimit(1, NaN), "1 ms");
  assert.equal(ofLimit(5, 0), "5 ms, none known as stable");
});

test("a link names a step by its name, or by its number from before there was a step on PID", () => {
  const titles = ["#step=4", "#step=method&links=2", "#step=2", "#step=3", "#step=pid", "#step=10"].map((link) => STEPS[stepIn(link)].id);
  assert.deepEqual(titles, ["method", "method", "slow", "look", "pid", "own"]);
  assert.deepEqual(["#step=0", "#step=11", "#step=x", "#links=2", ""].map(stepIn), [-1, -1, -1, -1, -1]);
});

// The scenes, held to the report's source

const LINES = readFileSync(new URL("../../src/report/experiments/scenarios/scenes.txt", import.meta.url), "utf8").trim().split("\n");
const SOURCE = LINES.map((line) => line.split(" | ")).map(([id, parameters]) => ({ id, parameters }));

test("the page has the report's 43 scenes in their order, each with a name", () => {
  assert.equal(SOURCE.length, 43);
  assert.deepEqual(SCENES.map(({ id }) => id), SOURCE.map(({ id }) => id));
  for (const { id, name, expected } of SCENES) assert.ok(name && expected, id);
});

/** Figures in the report's words, and where a scene has them. */
const FIGURES = [
  ["links", /(?<!2 and )(\d) links/, ({ links }) => [links]],
  ...["kp", "ki", "kd"].map((gain) => [gain, new RegExp(`${gain} ([\\d.e]+)(?: and ([\\d.e]+))?`), ({ settings }) => settings.gains[gain]]),
  ["outer mass", /outer mass (\S+) kg/, ({ settings }) => settings.params.masses.slice(-1)],
  ["inner mass", /inner mass (\S+)/, ({ settings }) => settings.params.masses.slice(0, 1)],
  ["gravity", /(?:gravity (?=0)|without gravity|no gravity)(0?)/, ({ settings }) => [settings.params.gravity]],
  ["setpoint", /setpoint \((\S+), (\S+)\)/, ({ settings }) => settings.setpoint],
  ["outer length", /outer length (\S+) m/, ({ settings }) => settings.params.lengths.slice(-1)],
  ["velocity", /(\d{2,}) rad\/s$/, ({ velocity }) => velocity.slice(0, 1)],
];

test("a scene's links, gains, masses, gravity and setpoint are those that the report names", () => {
  const compared = SOURCE.flatMap(({ id, parameters }, i) => FIGURES.filter(([, named]) => named.test(parameters)).map(([name, named, figure]) => {
    const [first, second] = named.exec(parameters).slice(1).map((text) => (text === undefined ? undefined : Number(text)));
    const found = figure(SCENES[i]);
    assert.deepEqual(found, [first, second ?? first].slice(0, found.length), `${id} ${name}: ${parameters}`);
  }));
  assert.ok(compared.length > 60, `${compared.length} figures`);
});

test("every scene of an arm has all settings, of its own number of links", () => {
  for (const scene of SCENES.filter(({ links }) => links > 0)) {
    const { gains, params, integrator, period, setpoint } = settingsOf(scene);
    for (const list of [gains.kp, params.masses, params.lengths, scene.start, setpoint]) assert.equal(list.length, scene.links, scene.id);
    assert.ok(integrator.timestep > 0 && period.period >= 0, scene.id);
  }
});
