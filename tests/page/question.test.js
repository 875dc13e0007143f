// One question: everything on which an answer of the study depends is in it.

import assert from "node:assert/strict";
import { test } from "node:test";

import { fromRest, loopKey, noGains, questionOf, rolloutArgs, stabilityArgs, withFixedPeriod } from "../../page/question.js";
import { DEFAULTS, presentSettings } from "../../page/settings.js";

/** The page's state with these settings and this start. */
function live({ integrator, params, gains, period, friction, motors, sensors, controller, setpoint, start, ...others }) {
  return {
    links: 2, integrator, params, gains, period, friction, motors, sensors, enabled: controller,
    setpoint: Float64Array.from([...setpoint, 0]), setpointKnown: true,
    position: Float64Array.from([...start.position, 0]), velocity: Float64Array.from([...start.velocity, 0]), ...others,
  };
}

const SETTINGS = { ...structuredClone(DEFAULTS[2]), controller: true, start: { position: [0.1, 0.2], velocity: [0.3, 0.4] } };

/** All settings with one number, text or switch changed, each with its path. */
function* variations(value, path = []) {
  if (value !== null && typeof value === "object") {
    for (const key of Object.keys(value)) {
      for (const [changed, name] of variations(value[key], [...path, key])) {
        const copy = Array.isArray(value) ? [...value] : { ...value };
        copy[key] = changed;
        yield [copy, name];
      }
    }
  } else yield [value === null ? [1, 1] : typeof value === "number" ? value + 0.5 : typeof value === "boolean" ? !value : `other ${value}`, path.join(".")];
}

test("each setting of the arm, and its start, is in the question and in both requests", () => {
  const before = questionOf(live(SETTINGS));
  const requests = [stabilityArgs, (question) => rolloutArgs(question, { duration: 1, samples: 2 })];
  let compared = 0;
  for (const [settings, name] of variations(SETTINGS)) {
    const question = questionOf(live(settings));
    compared += 1;
    assert.notDeepEqual(question, before, name);
    for (const request of requests) assert.notDeepEqual(request(question), request(before), name);
  }
  assert.ok(compared >= 20, `${compared} settings`);
});

test("the settings that a question is built from are all that a link has", () => {
  const known = presentSettings(live(SETTINGS));
  assert.deepEqual(Object.keys(known).sort(), Object.keys(DEFAULTS[2]).sort());
});

test("an answer belongs to a loop: each of its settings but method, timestep and start is in its key", () => {
  const before = loopKey(questionOf(live(SETTINGS)));
  for (const [settings, name] of variations(SETTINGS)) {
    const isLoop = !/^(integrator|start)/.test(name);
    assert.equal(loopKey(questionOf(live(settings))) !== before, isLoop, name);
  }
});

test("a controller that is off has no gains, no clock and no setpoint in the question", () => {
  const off = (changed) => questionOf(live({ ...SETTINGS, controller: false, ...changed }));
  assert.deepEqual(off({}).gains, noGains(2));
  for (const changed of [{ period: { period: 0.01, delay: true } }, { setpoint: [1, 1] }, { gains: { kp: [1, 1], ki: [1, 1], kd: [1, 1] } }]) {
    assert.deepEqual(off(changed), off({}));
  }
});

test("there is no question until all settings are known", () => {
  for (const key of ["params", "gains", "integrator", "period", "enabled"]) assert.equal(questionOf({ ...live(SETTINGS), [key]: null }), null, key);
  assert.equal(questionOf({ ...live(SETTINGS), setpointKnown: false }), null);
  assert.equal(questionOf({ ...live(SETTINGS), links: 3 }), null, "the settings of the old arm");
});

test("runs that are compared have one control period, in whole timesteps of the compared ones", () => {
  const at = (control_period, timestep) => withFixedPeriod({ ...questionOf(live(SETTINGS)), control_period, timestep }).control_period;
  assert.deepEqual([at(0, 0.01), at(0.004, 0.01), at(0.02, 0.01), at(0.0251, 0.01)], [0.01, 0.01, 0.02, 0.03]);
  const free = questionOf(live({ ...SETTINGS, controller: false }));
  assert.equal(withFixedPeriod(free), free);
});

test("from rest the loop is the same and the start is stretched out", () => {
  const question = questionOf(live(SETTINGS));
  assert.equal(loopKey(fromRest(question)), loopKey(question));
  assert.deepEqual([fromRest(question).q, fromRest(question).qd], [[0, 0], [0, 0]]);
});
