// Eigenvalues against matrices whose own are known in closed form.

import assert from "node:assert/strict";
import { test } from "node:test";

import { eigenvalues } from "../../page/eigen.js";

/** Sorted by real, then imaginary part, rounding noise of an imaginary part left out of the order. */
function sorted(values) {
  return [...values].sort((a, b) => (Math.abs(a.re - b.re) > 1e-9 ? a.re - b.re : a.im - b.im));
}

function close(found, wanted, tolerance = 1e-12) {
  assert.equal(found.length, wanted.length);
  sorted(found).forEach((one, i) => {
    const size = Math.max(1, Math.hypot(wanted[i].re, wanted[i].im));
    assert.ok(Math.hypot(one.re - wanted[i].re, one.im - wanted[i].im) <= tolerance * size, `${one.re} ${one.im}`);
  });
}

test("a rotation has a conjugate pair on the unit circle", () => {
  const [c, s] = [Math.cos(0.3), Math.sin(0.3)];
  close(eigenvalues([[c, -s], [s, c]]), [{ re: c, im: -s }, { re: c, im: s }]);
});

test("roots of a polynomial come from its companion matrix", () => {
  // (x - 1)(x - 2)(x - 3)(x² + 2x + 5), multiplied out.
  const c = [-30, 43, -14, 4, -4];
  const n = c.length;
  const companion = Array.from({ length: n }, (_, i) => Array.from({ length: n }, (_, j) => (j === n - 1 ? -c[i] : i === j + 1 ? 1 : 0)));
  close(eigenvalues(companion), [{ re: -1, im: -2 }, { re: -1, im: 2 }, { re: 1, im: 0 }, { re: 2, im: 0 }, { re: 3, im: 0 }]);
});

test("a graded triangular matrix keeps its small eigenvalues", () => {
  const found = eigenvalues([[1e6, 1, 1], [0, 1, 1e-3], [0, 0, 1e-6]]);
  close(found, [{ re: 1e-6, im: 0 }, { re: 1, im: 0 }, { re: 1e6, im: 0 }]);
  assert.ok(Math.abs(Math.min(...found.map((one) => one.re)) - 1e-6) < 1e-15);
});

test("the cyclic shift of nine has the ninth roots of unity", () => {
  const n = 9;
  const found = eigenvalues(Array.from({ length: n }, (_, i) => Array.from({ length: n }, (_, j) => (j === (i + 1) % n ? 1 : 0))));
  for (const one of found) assert.ok(Math.abs(Math.hypot(one.re, one.im) - 1) < 1e-12);
  assert.ok(Math.abs(found.reduce((sum, one) => sum + one.re, 0)) < 1e-12);
});

test("what is not finite has none", () => {
  assert.equal(eigenvalues([[1, NaN], [0, 1]]), null);
});
