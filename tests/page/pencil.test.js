// A line through many points, drawn through few.

import assert from "node:assert/strict";
import { test } from "node:test";

import { MISS, Pencil } from "../../page/pencil.js";

/** The strokes that are drawn of `lines`, each a list of points. */
function drawn(...lines) {
  const strokes = [];
  const pencil = new Pencil({ moveTo: (x, y) => strokes.push([[x, y]]), lineTo: (x, y) => strokes.at(-1).push([x, y]) });
  for (const line of lines) {
    for (const [x, y] of line) pencil.to(x, y);
    pencil.lift();
  }
  return strokes;
}

/** The height at `x` of a line through `points`. */
function height(points, x) {
  const k = points.findIndex(([right]) => right >= x);
  if (points[k][0] === x) return points[k][1];
  const [[a, p], [b, q]] = [points[k - 1], points[k]];
  return p + ((x - a) / (b - a)) * (q - p);
}

const curve = (f) => Array.from({ length: 601 }, (_, i) => [i * 0.7, f(i)]);

test("a smooth line takes few points and misses none by more than it may", () => {
  const line = curve((i) => 40 * Math.sin(i / 40));
  const [points] = drawn(line);
  assert.ok(points.length < 100, `${points.length} points`);
  for (const [x, y] of line) assert.ok(Math.abs(height(points, x) - y) <= MISS + 1e-9, `at ${x}`);
});

test("a shaking line keeps every turn", () => {
  const line = curve((i) => (i % 2 === 0 ? 20 : -20));
  assert.equal(drawn(line)[0].length, line.length);
});

test("one spike is kept at its full height", () => {
  const [points] = drawn(curve((i) => (i === 300 ? 1e6 : 0)));
  assert.ok(points.some(([, y]) => y === 1e6));
  assert.ok(points.length <= 6);
});

test("a straight line takes two points, a gap stays a gap, and a point alone is no line", () => {
  const strokes = drawn([[0, 0], [1, 0], [2, 0]], [[5, 1]], []);
  assert.deepEqual(strokes, [[[0, 0], [2, 0]], [[5, 1]]]);
});
