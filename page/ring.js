// @ts-check
// A ring of rows of numbers: the newest `capacity` rows are kept, in memory that is taken once.
// Invariant: nothing is allocated after construction, however long the page stays open.

export class Ring {
  /** @param {number} capacity rows kept @param {number} width numbers per row */
  constructor(capacity, width) {
    this.capacity = capacity;
    this.width = width;
    this.data = new Float64Array(capacity * width);
    this.length = 0;
    this.head = 0; // the row that is written next
  }

  clear() {
    this.length = 0;
  }

  /** Makes room for one row, and gives the index in `data` where it begins. */
  push() {
    const offset = this.head * this.width;
    this.head = (this.head + 1) % this.capacity;
    if (this.length < this.capacity) this.length += 1;
    return offset;
  }

  /** Where row `i` begins in `data`; row 0 is the oldest. */
  at(i) {
    const row = this.head - this.length + i;
    return (row < 0 ? row + this.capacity : row) * this.width;
  }

  /** Where the newest row begins; only if there is one. */
  last() {
    return this.at(this.length - 1);
  }
}
