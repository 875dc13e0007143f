// Scales of the charts: the position of a value between the ends, and the marks.
// Invariant: labels are made only when the range changes, not at every frame.

import { duration, significant } from "./format.js";

/** @typedef {[number, string][]} Marks values and their labels */
/** @typedef {{place: (value: number) => number, marks: Marks}} Scale 0 at the low end, 1 at the high one */

/** Largest value of a linear scale. Larger ones are drawn at the edge, so differences stay finite. */
const LARGEST = 1e150;
const MOST_MARKS = 12;
/** The end of a logarithmic scale. Growth up to it is visible, and larger values need no distinction. */
export const LOG_END = 1e12;
const DECADES_A_MARK = [1, 2, 3, 4, 6, 12]; // decades of a logarithmic scale for one mark

/** log10 on both sides of zero, linear below 1. @param {number} value */
export function symmetricLog(value) {
  return Math.sign(value) * Math.log10(1 + Math.abs(value));
}

/**
 * A range of round numbers around the drawn values. If values diverge, the scale becomes logarithmic on both sides of
 * zero. Then exponential growth is a straight line, and the normal part stays visible.
 */
export class Axis {
  /**
   * @param {number} wanted about how many marks
   * @param {number} least smallest span, so that small noise at rest stays small
   * @param {number} sane largest magnitude of a linear scale
   */
  constructor(wanted, least, sane) {
    this.wanted = wanted;
    this.least = least;
    this.sane = sane;
    this.fixed = false; // the range does not change
    this.log = false;
    this.low = 0;
    this.high = 1;
    this.step = 1;
    /** @type {Marks} */
    this.marks = [];
  }

  /** Chooses the range for values from `min` to `max`. @param {number} min @param {number} max */
  fit(min, max) {
    if (this.fixed && this.marks.length > 0) return;
    if (Math.max(-min, max) > this.sane && min <= max) this.fitLog(min, max);
    else this.fitLinear(Math.max(min, -LARGEST), Math.min(max, LARGEST));
  }

  /** @param {number} min @param {number} max */
  fitLinear(min, max) {
    if (!(min <= max)) min = max = 0;
    // A span below rounding counts as zero.
    const missing = Math.max(0, Math.max(this.least, 1e-9 * Math.max(-min, max)) - (max - min));
    min -= missing / 2;
    max += missing / 2;
    const step = roundStep((max - min) / this.wanted);
    this.choose(false, Math.floor(min / step) * step, Math.ceil(max / step) * step, step);
  }

  /** @param {number} min @param {number} max */
  fitLog(min, max) {
    const reach = (/** @type {number} */ value) => Math.ceil(Math.log10(1 + Math.min(Math.max(0, value), LOG_END)) - 1e-9);
    const [down, up] = [reach(-min), reach(max)];
    const step = DECADES_A_MARK.find((one) => (up + down) / one <= 2 * this.wanted) ?? 12;
    this.choose(true, -Math.ceil(down / step) * step, Math.ceil(up / step) * step, step);
  }

  /** @param {boolean} log @param {number} low @param {number} high @param {number} step */
  choose(log, low, high, step) {
    if (log === this.log && low === this.low && high === this.high && step === this.step && this.marks.length > 0) return;
    Object.assign(this, { log, low, high, step });
    this.marks = Array.from({ length: Math.min(MOST_MARKS, Math.round((high - low) / step) + 1) }, (_, i) => {
      const at = low + i * step;
      // On a logarithmic scale marks are at powers of ten.
      return log ? [Math.sign(at) * (10 ** Math.abs(at) - 1), powerLabel(at)] : [at, significant(Math.abs(at) < step / 2 ? 0 : at, 4)];
    });
  }

  /** @param {number} value */
  place(value) {
    const at = this.log ? symmetricLog(Math.min(LOG_END, Math.max(-LOG_END, value))) : Math.min(LARGEST, Math.max(-LARGEST, value));
    return (at - this.low) / (this.high - this.low);
  }
}

/** The next larger of 1, 2, 5 and 10 times a power of ten. @param {number} rough */
function roundStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * (/** @type {number} */ ([1, 2, 5, 10].find((one) => rough <= one * power * (1 + 1e-12))) ?? 10);
}

/** @param {number} power */
function powerLabel(power) {
  const size = Math.abs(power);
  const sign = power < 0 ? "\u2212" : "";
  return power === 0 ? "0" : size < 4 ? `${sign}${10 ** size}` : `${sign}1e${size}`;
}

/** A logarithmic scale of positive values. `place` and `value` are inverse functions. */
export class LogScale {
  /** @param {number} low @param {number} high @param {Marks} [marks] else powers of ten, in seconds */
  constructor(low, high, marks) {
    this.low = low;
    this.high = high;
    this.marks = marks ?? this.powers(6, duration);
  }

  /**
   * From the power of ten below the smallest value to the one above the largest. @param {number[]} values @param {number} most
   * @param {(value: number) => string} label
   */
  static around(values, most, label) {
    const scale = new LogScale(10 ** Math.floor(Math.log10(Math.min(...values))), 10 ** Math.ceil(Math.log10(Math.max(...values) * 1.01)), []);
    scale.marks = scale.powers(most, label);
    return scale;
  }

  /** @param {number} value */
  place(value) {
    return Math.log(value / this.low) / Math.log(this.high / this.low);
  }

  /** @param {number} place */
  value(place) {
    return this.low * (this.high / this.low) ** place;
  }

  /** @param {number} value */
  within(value) {
    return Math.min(this.high, Math.max(this.low, value));
  }

  /** `value` times `factor`, up to the end of the scale. A value beyond the end can only come nearer. @param {number} value @param {number} factor */
  moved(value, factor) {
    const next = value * factor;
    return factor > 1 ? Math.max(value, Math.min(next, this.high)) : Math.min(value, Math.max(next, this.low));
  }

  /** Powers of ten within, at most `most` of them. @param {number} most @param {(value: number) => string} label @returns {Marks} */
  powers(most, label) {
    const from = Math.ceil(Math.log10(this.low) - 1e-9);
    const to = Math.floor(Math.log10(this.high) + 1e-9);
    const every = Math.max(1, Math.ceil((to - from + 1) / most));
    const marks = /** @type {Marks} */ ([]);
    for (let power = to; power >= from; power -= every) marks.unshift([10 ** power, label(10 ** power)]);
    return marks;
  }
}

/** A power of ten, so that all marks of an axis have one form. @param {number} value */
export function powerOfTen(value) {
  return `1e${Math.round(Math.log10(value))}`.replace("-", "\u2212");
}

/** Seconds from one time to another. @param {number} from @param {number} to @returns {Scale} */
export function times(from, to) {
  const span = to - from;
  const every = roundStep(span / 8);
  const marks = /** @type {Marks} */ ([]);
  for (let k = Math.max(0, Math.ceil(from / every - 1e-9)); k * every <= to; k += 1) marks.push([k * every, significant(k * every, 7)]);
  return { place: (time) => (time - from) / span, marks };
}
