// @ts-check
// A figure that jumps by powers of ten from one reading to the next, made readable: the median of the latest readings.
// Invariant: memory is bounded.

export class Median {
  /** @param {number} count readings that are kept */
  constructor(count) {
    this.count = count;
    /** @type {number[]} */
    this.readings = [];
  }

  clear() {
    this.readings.length = 0;
  }

  /** @param {number} value */
  add(value) {
    if (!Number.isFinite(value)) return;
    this.readings.push(value);
    if (this.readings.length > this.count) this.readings.shift();
  }

  /** NaN where there is no reading. */
  get value() {
    const sorted = [...this.readings].sort((a, b) => a - b);
    return sorted.length === 0 ? NaN : sorted[Math.floor(sorted.length / 2)];
  }
}
