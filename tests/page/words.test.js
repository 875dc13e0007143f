// Numbers as text, scales, settings in links, and the inverse of each.

import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";

import { duration, fixed, inPageNames, multipleOf, partOf, plain, short, significant } from "../../page/format.js";
import { Rosbridge, socketAddress } from "../../page/rosbridge.js";
import { Axis, symmetricLog } from "../../page/scale.js";
import { DEFAULTS, Undo, fromFragment, presentSettings, toFragment } from "../../page/settings.js";

test("a field shows four digits and its exponent whole, a caption few digits", () => {
  assert.deepEqual([3.00591098005247, -3.75616e73, 1234567, NaN].map(plain), ["3.006", "-3.756e+73", "1235000", ""]);
  assert.deepEqual([short(-0.0421, 3), short(2271.893, 3), short(-7450.32, 2), short(123456.7, 2), short(1e9, 3), short(0, 3), short(NaN, 3)],
    ["−0.042", "2271.9", "−7450.3", "123457", "1e9", "0.000", "–"]);
});

test("a time that must fit another one is near the typed one, and a refused time stays", () => {
  assert.deepEqual([partOf(4, 3), partOf(4, 0.3), partOf(4, 9), partOf(4, -1), partOf(0, 3)], [4, 0.307692308, 4, -1, 3]);
  assert.deepEqual([multipleOf(0.1, 5.57), multipleOf(0.1, 0.03), multipleOf(0.1, -1)], [5.6, 0.1, -1]);
});

test("durations have the unit that suits them, and a number that is not finite is a dash", () => {
  for (const text of [fixed(NaN, 2), significant(Infinity, 3), duration(-Infinity)]) assert.equal(text, "–");
  assert.deepEqual([duration(0.00345), duration(2.5e-5), duration(1), duration(0)], ["3.45 ms", "25 µs", "1 s", "0 s"]);
});

test("an axis is linear while values are sane, logarithmic once they explode, and stays if it is fixed", () => {
  const axis = new Axis(4, 0.2, 100);
  axis.fit(-1, 3);
  assert.ok(!axis.log && axis.low <= -1 && axis.high >= 3);
  axis.fit(-1, 1e148);
  assert.ok(axis.log);
  // Equal factors are equal distances, and one radian still differs from zero.
  const distance = axis.place(1e11) - axis.place(1e9);
  assert.ok(Math.abs(axis.place(1e7) - axis.place(1e5) - distance) < 1e-6);
  assert.ok(axis.place(1) > axis.place(0));
  // The scale ends; values beyond stay at its edge.
  assert.equal(axis.place(1e148), axis.place(1e12));
  axis.fit(-1e148, 1);
  assert.ok(axis.low === -12 && axis.marks.length <= 12);
  axis.fixed = true;
  axis.fit(2, 50);
  assert.equal(axis.low, -12);
});

test("the symmetric logarithm is odd and near zero the identity over ln 10", () => {
  assert.equal(symmetricLog(-9), -1);
  assert.ok(Math.abs(symmetricLog(1e-6) - 1e-6 / Math.LN10) < 1e-12);
});

test("settings survive a link, once all have arrived", () => {
  for (const links of [2, 3]) {
    const params = { gravity: 2.5, masses: [1, 2, 3].slice(0, links), lengths: [0.7, 1.1, 0.9].slice(0, links) };
    const settings = { ...DEFAULTS[links], params, period: { period: 0.0021, delay: true }, setpoint: [0.1 + 0.2, -1e-9, 3].slice(0, links), controller: true };
    assert.deepEqual(fromFragment(`#${toFragment(settings, links)}`), settings);
  }
  assert.equal(presentSettings({ links: 2, integrator: null }), null);
});

test("a link may have fewer settings, the arm's start, and unknown names, which are ignored", () => {
  const settings = fromFragment("#kp=1,2&leapfrog=1&__proto__=1");
  assert.deepEqual(settings.gains, { kp: [1, 2] });
  assert.equal(settings.integrator, null);
  assert.deepEqual(fromFragment("#position=0.3,-1e-6&velocity=2,0").start, { position: [0.3, -1e-6], velocity: [2, 0] });
  assert.equal(fromFragment("#kp=1,2").start, undefined);
});

test("a wrong value in a link is kept, because the runtime refuses it", () => {
  const { integrator, params, gains, period, controller, setpoint } = fromFragment("#method=leapfrog&gravity=&masses=1,&kp= "
    + "&period=x&delay=maybe&controller=constructor&setpoint=");
  assert.deepEqual([integrator, params, gains], [{ method: "leapfrog" }, { gravity: NaN, masses: [1, NaN] }, { kp: [NaN] }]);
  assert.deepEqual([period, controller, setpoint], [{ period: NaN, delay: "maybe" }, "constructor", [NaN]]);
});

test("a slider that is dragged is one change to undo", () => {
  const undo = new Undo();
  undo.remember(DEFAULTS[2], 0);
  undo.remember({ ...DEFAULTS[2], controller: true }, 300);
  undo.remember({ ...DEFAULTS[2], controller: true }, 900);
  const present = { ...DEFAULTS[2], integrator: null };
  assert.deepEqual(undo.take(present), DEFAULTS[2]);
  assert.equal(undo.take(present), undefined);
});

test("a refused change cannot be undone", () => {
  const undo = new Undo();
  const before = { ...DEFAULTS[2], controller: true };
  undo.remember(before, 0);
  undo.remember(DEFAULTS[2], 2000);
  undo.remember(structuredClone(DEFAULTS[2]), 4000);
  assert.ok(undo.leadsBackFrom(DEFAULTS[2]));
  assert.deepEqual(undo.take(DEFAULTS[2]), before);
  undo.remember(DEFAULTS[2], 6000);
  assert.ok(!undo.leadsBackFrom(DEFAULTS[2]));
  assert.equal(undo.take(DEFAULTS[2]), undefined);
});

test("a refusal keeps the runtime's names until it is shown", async () => {
  globalThis.WebSocket ??= { OPEN: 1 };
  const socket = { readyState: 1, send() {} };
  const refused = new Rosbridge(() => socket, () => {}).call("/set");
  const status = "gains.kp[0] must be a number, got null";
  socket.onmessage({ data: JSON.stringify({ op: "service_response", id: "page-1", status }) });
  assert.equal((await refused).status, status);
  assert.equal(inPageNames(status), "kp 1 must be a number");
});

test("a refusal has the names of the page's fields", () => {
  const shown = {
    "kp[0] must be a number, got null; kp[1] must be a number, got null": "kp 1 must be a number; kp 2 must be a number",
    "epsilon must be greater than 0, got -1; success_hold must be at least 0, got -1":
      "tolerance must be greater than 0, got -1; hold must be at least 0, got -1",
    "phi = 2 puts the wrist 3.4 m from the base": "orientation = 2 puts the wrist 3.4 m from the base",
    "effort[0] must be a number, got null": "torque 1 must be a number",
    "effort must have 2 entries, got 1": "torque must have 2 entries, got 1",
    "period must be at least 0, got -1": "control period must be at least 0, got -1",
    'data must be true or false, got "maybe"': 'controller must be on or off, got "maybe"',
    "masses must have 2 entries, got 1": "masses must have 2 entries, got 1",
    "M must be symmetric: M[11][0] is 1": "M must be symmetric: M at row 12, column 1 is 1",
  };
  for (const [status, text] of Object.entries(shown)) assert.equal(inPageNames(status), text);
});

test("the WebSocket is in the folder of the page, also behind a proxy", () => {
  const pages = {
    "http://127.0.0.1:9095/": "ws://127.0.0.1:9095/", "https://host/arm1/": "wss://host/arm1/",
      "https://host/arm1/index.html?links=2#step=own": "wss://host/arm1/",
  };
  for (const [page, socket] of Object.entries(pages)) assert.equal(socketAddress(page), socket);
});

test("a request with a number that is not finite is refused, because null can mean the default", async () => {
  globalThis.WebSocket ??= { OPEN: 1 };
  const sent = [];
  const bridge = new Rosbridge(() => ({ readyState: 1, send: (text) => sent.push(text) }), () => {});
  assert.equal((await bridge.call("/run", { duration: NaN })).status, "duration must be a number");
  assert.equal((await bridge.call("/run", { params: { gravity: Infinity, masses: [1] } })).status, "params.gravity must be a number");
  assert.equal(sent.length, 0);
  const call = bridge.call("/run", { params: { masses: [NaN] }, integrator: "rk4", duration: 1 });
  assert.equal(sent.length, 1, "the runtime names the entries of a list");
  bridge.answer("page-1", { result: true });
  assert.ok((await call).result);
});

test("each link of the worksheets sets everything", () => {
  const text = readFileSync(new URL("../../course/worksheets.md", import.meta.url), "utf8");
  const links = [...text.matchAll(/\(\.\.\/pendularm\.html(#[^)]*)\)/g)].map(([, hash]) => hash);
  assert.equal(links.length, 8);
  for (const link of links) {
    const settings = fromFragment(link);
    for (const [key, wanted] of Object.entries(DEFAULTS[2])) {
      assert.deepEqual(Object.keys(settings[key] ?? {}).sort(), Object.keys(wanted ?? {}).sort(), `${key} in ${link}`);
    }
    assert.deepEqual([settings.start.position.length, settings.start.velocity.length], [2, 2]);
  }
});

test("no line of the page and its tests is longer than 160 characters", () => {
  for (const folder of ["../../page/", "../page/", "../browser/"].map((path) => new URL(path, import.meta.url))) {
    for (const name of readdirSync(folder).filter((one) => /\.(js|mjs|html|css|svg|py)$/.test(one))) {
      const long = readFileSync(new URL(name, folder), "utf8").split("\n").findIndex((line) => [...line].length > 160);
      assert.equal(long, -1, `${name}: line ${long + 1}`);
    }
  }
});
