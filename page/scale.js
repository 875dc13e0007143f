// @ts-check
// Logarithmic axes for the figures beside the plots: where a value is, which value is there, and which ticks to write.
// Invariant: place and value are each other's inverse.

export class LogScale {
  /** @param {number} low @param {number} high */
  constructor(low, high) {
    this.low = low;
    this.high = high;
  }

  /** 0 at the low end, 1 at the high one. @param {number} value */
  place(value) {
    return Math.log(value / this.low) / Math.log(this.high / this.low);
  }

  /** @param {number} place */
  value(place) {
    return this.low * (this.high / this.low) ** place;
  }

  /** Powers of ten within, thinned to at most `most`. @param {number} most */
  ticks(most) {
    const from = Math.ceil(Math.log10(this.low) - 1e-9);
    const to = Math.floor(Math.log10(this.high) + 1e-9);
    const every = Math.max(1, Math.ceil((to - from + 1) / most));
    const ticks = [];
    for (let power = to; power >= from; power -= every) ticks.push(10 ** power);
    return ticks.reverse();
  }
}
