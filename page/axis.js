// @ts-check
// A range of round numbers around what is drawn, with ticks a person can read. Where values explode the scale turns
// logarithmic on both sides of zero, so that steady growth is a straight line and the sane part stays in sight.
// Invariant: labels are made only when the range changes, not at every frame.

import { significant } from "./format.js";

/** Beyond this a linear scale draws at the edge: differences must stay finite. */
const LARGEST = 1e150;
const MOST_TICKS = 12;
/** Where a logarithmic scale ends: beyond it nothing is worth telling apart, and growth up to it stays in sight. */
export const LOG_END = 1e12;
/** Decades of a logarithmic scale for one tick. */
const DECADES_A_TICK = [1, 2, 3, 4, 6, 12];

/** log10 on both sides of zero, linear below 1. @param {number} value */
export function symmetricLog(value) {
  return Math.sign(value) * Math.log10(1 + Math.abs(value));
}

export class Axis {
  /**
   * @param {number} ticks about how many
   * @param {number} least smallest span, so that rest looks like rest
   * @param {number} sane largest magnitude of a linear scale
   */
  constructor(ticks, least, sane = Infinity) {
    this.wanted = ticks;
    this.least = least;
    this.sane = sane;
    this.fixed = false; // the range stays as it is
    this.log = false;
    this.low = 0;
    this.high = 1;
    this.step = 1;
    this.count = 0;
    this.values = new Float64Array(MOST_TICKS);
    /** @type {string[]} */
    this.labels = [];
    this.min = Infinity;
    this.max = -Infinity;
  }

  /** Before the values are offered. */
  begin() {
    this.min = Infinity;
    this.max = -Infinity;
  }

  /** @param {number} value */
  offer(value) {
    if (value < this.min) this.min = value;
    if (value > this.max) this.max = value;
  }

  /** After them: chooses the range. */
  end() {
    if (this.fixed && this.count > 0) return;
    const largest = Math.max(-this.min, this.max);
    if (largest > this.sane) this.fitLog();
    else this.fitLinear();
  }

  fitLinear() {
    let min = Math.max(this.min, -LARGEST);
    let max = Math.min(this.max, LARGEST);
    if (!(min <= max)) {
      min = 0;
      max = 0;
    }
    // A span that rounding would swallow is none.
    const missing = Math.max(this.least, 1e-9 * Math.max(-min, max)) - (max - min);
    if (missing > 0) {
      min -= missing / 2;
      max += missing / 2;
    }
    const rough = (max - min) / this.wanted;
    const power = 10 ** Math.floor(Math.log10(rough));
    const ratio = rough / power;
    const step = power * (ratio <= 1 ? 1 : ratio <= 2 ? 2 : ratio <= 5 ? 5 : 10);
    this.choose(false, Math.floor(min / step) * step, Math.ceil(max / step) * step, step);
  }

  fitLog() {
    const reach = (/** @type {number} */ value) => Math.ceil(Math.log10(1 + Math.min(value, LOG_END)) - 1e-9);
    const up = reach(Math.max(0, this.max));
    const down = reach(Math.max(0, -this.min));
    const step = DECADES_A_TICK.find((one) => (up + down) / one <= 2 * this.wanted) ?? 12;
    this.choose(true, -Math.ceil(down / step) * step, Math.ceil(up / step) * step, step);
  }

  /** @param {boolean} log @param {number} low @param {number} high @param {number} step */
  choose(log, low, high, step) {
    if (log === this.log && low === this.low && high === this.high && step === this.step) return;
    this.log = log;
    this.low = low;
    this.high = high;
    this.step = step;
    this.count = Math.min(MOST_TICKS, Math.round((high - low) / step) + 1);
    this.labels.length = 0;
    for (let i = 0; i < this.count; i += 1) {
      const at = low + i * step;
      // On a logarithmic scale ticks are kept where they are drawn: at powers of ten.
      this.values[i] = log ? Math.sign(at) * (10 ** Math.abs(at) - 1) : at;
      this.labels.push(log ? powerLabel(at) : significant(Math.abs(at) < step / 2 ? 0 : at, 4));
    }
  }

  /** From 0 at the low end to 1 at the high one. @param {number} value */
  place(value) {
    if (this.log) return (symmetricLog(Math.min(LOG_END, Math.max(-LOG_END, value))) - this.low) / (this.high - this.low);
    return (Math.min(LARGEST, Math.max(-LARGEST, value)) - this.low) / (this.high - this.low);
  }
}

/** @param {number} power */
function powerLabel(power) {
  if (power === 0) return "0";
  const sign = power < 0 ? "\u2212" : "";
  const size = Math.abs(power);
  return size < 4 ? `${sign}${10 ** size}` : `${sign}1e${size}`;
}
