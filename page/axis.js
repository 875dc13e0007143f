// A range of round numbers around what is drawn, with ticks a person can read.
// Invariant: labels are made only when the range changes, not at every frame.

import { significant } from "./format.js";

/** Beyond this a diverged value is drawn at the edge: differences must stay finite. */
const LARGEST = 1e150;
const MOST_TICKS = 12;

export class Axis {
  /** @param {number} ticks about how many @param {number} least smallest span, so that rest looks like rest */
  constructor(ticks, least) {
    this.wanted = ticks;
    this.least = least;
    this.low = 0;
    this.high = 1;
    this.step = 1;
    this.count = 0;
    this.values = new Float64Array(MOST_TICKS);
    this.labels = [];
    this.begin();
  }

  /** Before the values are offered. */
  begin() {
    this.min = Infinity;
    this.max = -Infinity;
  }

  offer(value) {
    if (value < this.min) this.min = value;
    if (value > this.max) this.max = value;
  }

  /** After them: chooses the range. */
  end() {
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
    const low = Math.floor(min / step) * step;
    const high = Math.ceil(max / step) * step;
    if (low === this.low && high === this.high && step === this.step) return;
    this.low = low;
    this.high = high;
    this.step = step;
    this.count = Math.min(MOST_TICKS, Math.round((high - low) / step) + 1);
    this.labels.length = 0;
    for (let i = 0; i < this.count; i += 1) {
      this.values[i] = low + i * step;
      this.labels.push(significant(Math.abs(this.values[i]) < step / 2 ? 0 : this.values[i], 4));
    }
  }

  /** From 0 at the low end to 1 at the high one. */
  place(value) {
    return (Math.min(LARGEST, Math.max(-LARGEST, value)) - this.low) / (this.high - this.low);
  }
}
