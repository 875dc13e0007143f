// @ts-check
// Eigenvalues of small real matrices: Hessenberg form, then shifted QR by plane rotations in complex numbers.
// Matrices are arrays of rows. Source: Golub and Van Loan, Matrix Computations (2013), ch. 7.
// Invariant: bounded work; a matrix with an entry that is not finite has no eigenvalues (null).

/** @typedef {number[][]} Matrix */
/** @typedef {{re: number, im: number}} Complex */
/** @typedef {Float64Array[]} Rows */

const EPSILON = 2 ** -52;
/** QR steps for one eigenvalue; two or three are usual. */
const MOST_STEPS = 60;

/** @param {Matrix} matrix @returns {Complex[] | null} */
export function eigenvalues(matrix) {
  if (!matrix.every((row) => row.every(Number.isFinite))) return null;
  const h = toHessenberg(balance(matrix.map((row) => [...row])));
  const re = h.map((row) => Float64Array.from(row));
  const im = h.map((row) => new Float64Array(row.length));
  /** @type {Complex[]} */
  const found = [];
  let last = h.length - 1;
  let steps = 0;
  while (last >= 0) {
    const first = blockStart(re, im, last);
    if (first === last || steps === MOST_STEPS) {
      found.push({ re: re[last][last], im: im[last][last] });
      last -= 1;
      steps = 0;
      continue;
    }
    steps += 1;
    step(re, im, first, last, shift(re, im, last, steps));
  }
  return found;
}

/** Scales rows against columns by powers of two, so that graded matrices lose no digits. @param {Matrix} a */
function balance(a) {
  const n = a.length;
  for (let sweep = 0, changed = true; changed && sweep < 20; sweep += 1) {
    changed = false;
    for (let i = 0; i < n; i += 1) {
      let row = 0;
      let column = 0;
      for (let j = 0; j < n; j += 1) {
        if (j === i) continue;
        row += Math.abs(a[i][j]);
        column += Math.abs(a[j][i]);
      }
      if (row === 0 || column === 0) continue;
      const factor = 2 ** Math.round(Math.log2(row / column) / 2);
      if (factor === 1) continue;
      changed = true;
      for (let j = 0; j < n; j += 1) {
        a[i][j] /= factor;
        a[j][i] *= factor;
      }
    }
  }
  return a;
}

/** By elimination with pivots. @param {Matrix} a */
function toHessenberg(a) {
  const n = a.length;
  for (let k = 1; k < n - 1; k += 1) {
    let pivot = k;
    for (let i = k + 1; i < n; i += 1) if (Math.abs(a[i][k - 1]) > Math.abs(a[pivot][k - 1])) pivot = i;
    if (a[pivot][k - 1] === 0) continue;
    if (pivot !== k) {
      [a[pivot], a[k]] = [a[k], a[pivot]];
      for (const row of a) [row[pivot], row[k]] = [row[k], row[pivot]];
    }
    for (let i = k + 1; i < n; i += 1) {
      const factor = a[i][k - 1] / a[k][k - 1];
      if (factor === 0) continue;
      for (let j = 0; j < n; j += 1) a[i][j] -= factor * a[k][j];
      for (let j = 0; j < n; j += 1) a[j][k] += factor * a[j][i];
      a[i][k - 1] = 0;
    }
  }
  return a;
}

/** Where the block that ends at `last` begins: above it the subdiagonal is nothing. @param {Rows} re @param {Rows} im @param {number} last */
function blockStart(re, im, last) {
  for (let k = last; k > 0; k -= 1) {
    const beside = Math.hypot(re[k][k], im[k][k]) + Math.hypot(re[k - 1][k - 1], im[k - 1][k - 1]);
    if (Math.hypot(re[k][k - 1], im[k][k - 1]) <= EPSILON * beside) {
      re[k][k - 1] = 0;
      im[k][k - 1] = 0;
      return k;
    }
  }
  return 0;
}

/**
 * The eigenvalue of the last two rows and columns that is nearer to the last entry.
 * @param {Rows} re @param {Rows} im @param {number} last @param {number} steps @returns {Complex}
 */
function shift(re, im, last, steps) {
  const at = (/** @type {number} */ i, /** @type {number} */ j) => ({ re: re[i][j], im: im[i][j] });
  const [a, b, c, d] = [at(last - 1, last - 1), at(last - 1, last), at(last, last - 1), at(last, last)];
  // Now and then another shift, should the steps go round in a circle.
  if (steps % 11 === 0) return { re: d.re + Math.hypot(c.re, c.im), im: d.im };
  const half = { re: (a.re - d.re) / 2, im: (a.im - d.im) / 2 };
  const root = squareRoot({
    re: half.re * half.re - half.im * half.im + b.re * c.re - b.im * c.im,
    im: 2 * half.re * half.im + b.re * c.im + b.im * c.re,
  });
  const sign = half.re * root.re + half.im * root.im > 0 ? -1 : 1;
  return { re: d.re + half.re + sign * root.re, im: d.im + half.im + sign * root.im };
}

/** @param {Complex} z @returns {Complex} */
function squareRoot(z) {
  const size = Math.hypot(z.re, z.im);
  const re = Math.sqrt((size + Math.abs(z.re)) / 2);
  if (re === 0) return { re: 0, im: 0 };
  const im = z.im / (2 * re);
  return z.re >= 0 ? { re, im } : { re: Math.abs(im), im: z.im >= 0 ? re : -re };
}

/**
 * H - s = Q R, then R Q + s, on rows and columns `first` to `last`.
 * @param {Rows} re @param {Rows} im @param {number} first @param {number} last @param {Complex} s
 */
function step(re, im, first, last, s) {
  for (let k = first; k <= last; k += 1) {
    re[k][k] -= s.re;
    im[k][k] -= s.im;
  }
  const turns = [];
  for (let k = first; k < last; k += 1) {
    // A rotation of rows k and k + 1 that clears the entry below the diagonal: cosine c real, sine complex.
    const size = Math.hypot(re[k][k], im[k][k], re[k + 1][k], im[k + 1][k]);
    const turn = size === 0 ? [1, 0, 0, 0]
      : [re[k][k] / size, im[k][k] / size, re[k + 1][k] / size, im[k + 1][k] / size];
    turns.push(turn);
    const [ar, ai, br, bi] = turn;
    for (let j = k; j <= last; j += 1) {
      const [xr, xi, yr, yi] = [re[k][j], im[k][j], re[k + 1][j], im[k + 1][j]];
      re[k][j] = ar * xr + ai * xi + br * yr + bi * yi;
      im[k][j] = ar * xi - ai * xr + br * yi - bi * yr;
      re[k + 1][j] = ar * yr - ai * yi - br * xr + bi * xi;
      im[k + 1][j] = ar * yi + ai * yr - br * xi - bi * xr;
    }
  }
  for (let k = first; k < last; k += 1) {
    const [ar, ai, br, bi] = turns[k - first];
    for (let i = first; i <= Math.min(k + 1, last); i += 1) {
      const [xr, xi, yr, yi] = [re[i][k], im[i][k], re[i][k + 1], im[i][k + 1]];
      re[i][k] = xr * ar - xi * ai + yr * br - yi * bi;
      im[i][k] = xr * ai + xi * ar + yr * bi + yi * br;
      re[i][k + 1] = yr * ar + yi * ai - xr * br - xi * bi;
      im[i][k + 1] = yi * ar - yr * ai - xi * br + xr * bi;
    }
  }
  for (let k = first; k <= last; k += 1) {
    re[k][k] += s.re;
    im[k][k] += s.im;
  }
}
