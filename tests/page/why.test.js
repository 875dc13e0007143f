// The timestep that each method bears, and the reason: said of the loop in force, and in keeping with its modes.

import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";

import { METHODS } from "../../page/format.js";
import { loopInForce } from "../../page/growth.js";
import { limitOf } from "../../page/loop.js";
import { DEFAULTS } from "../../page/settings.js";
import { whyText } from "../../page/why.js";

function arm(changed = {}) {
  const { integrator, params, gains } = DEFAULTS[2];
  return { links: 2, enabled: true, setpoint: new Float64Array(3), setpointKnown: true, integrator, params, gains, ...changed };
}

/** What the runtime serves for the loop in force, computed anew. */
function methodLimits(state) {
  const found = loopInForce(state);
  return found && Object.fromEntries(METHODS.map(([method]) => [method, limitOf(found.loop, method, true)]));
}

const why = (state) => whyText(state, methodLimits(state));

test("with efforts held over the step all methods bear about the same, and the reason is named", () => {
  const text = why(arm());
  // 2 over the fastest rate, 453 per second, is 4.4 ms: there a step overshoots as far as it was away.
  assert.match(text, /^Why 4\.32 ms: the loop’s fastest mode \(joint 2, by its derivative gain\) dies away at 453 per second\./);
  assert.match(text, /longer than 1\.95\/453 s overshoots/);
  assert.match(text, /All methods bear about the same/);
});

test("where a swing grows first it is named by its frequency, and methods that bear more by their names", () => {
  const text = why(arm({ gains: { kp: [2000, 500], ki: [0, 0], kd: [5, 2] } }));
  assert.match(text, /a swing of 3\.66 Hz\. An effort held for longer than 0\.02 of it/);
  assert.match(text, /Midpoint, Verlet and Runge–Kutta 4 bear most, 5\.94 ms\./);
});

test("the arm left to itself is damped by nothing, and Euler adds to every swing", () => {
  assert.match(why(arm({ enabled: false, integrator: { method: "euler", timestep: 0.001 } })), /every step of Euler adds a little to each swing/);
  assert.match(why(arm({ enabled: false })), /fastest small swing has 1\.14 Hz.* up to 393 ms/);
});

test("where the gains themselves are at fault no method is blamed", () => {
  assert.match(why(arm({ gains: { kp: [1, 1], ki: [3000, 3000], kd: [0, 0] } })), /no method and no timestep helps/);
  assert.match(why(arm({ gains: { kp: [1000, 250], ki: [0, 0], kd: [0, 0] } })), /nothing damps the arm here/);
});

test("nothing is said of a loop that is not known", () => {
  assert.equal(why(arm({ gains: null })), "");
});

test("every module of the page is checked for its types", () => {
  const folder = new URL("../../page/", import.meta.url);
  const unchecked = readdirSync(folder).filter((name) => name.endsWith(".js") && !readFileSync(new URL(name, folder), "utf8").startsWith("// @ts-check\n"));
  assert.deepEqual(unchecked, []);
});
