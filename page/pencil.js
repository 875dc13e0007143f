// Draws a line through many points as through a few of them. Points that a straight line would miss by less than can be seen
// are left out. A line of ten seconds has 600 points, and on a screen a tenth of them does.
// Invariant: no point is further from what is drawn than `MISS`, upwards or downwards; points come from left to right.

/** [px] */
export const MISS = 0.25;

export class Pencil {
  /** @param {{moveTo(x: number, y: number): void, lineTo(x: number, y: number): void}} context whose path is extended */
  constructor(context) {
    this.context = context;
    this.isDown = false;
    this.x = 0; // the point that was drawn last
    this.y = 0;
    this.lastX = 0; // the one that came last
    this.lastY = 0;
    this.least = -Infinity; // slopes of lines from the one drawn that miss none since
    this.most = Infinity;
  }

  /** @param {number} x @param {number} y */
  to(x, y) {
    if (!this.isDown) {
      this.context.moveTo(x, y);
      this.isDown = true;
      this.from(x, y);
      return;
    }
    const slope = (y - this.y) / (x - this.x);
    if (!(slope >= this.least && slope <= this.most)) {
      this.context.lineTo(this.lastX, this.lastY);
      this.from(this.lastX, this.lastY);
    }
    this.least = Math.max(this.least, (y - MISS - this.y) / (x - this.x));
    this.most = Math.min(this.most, (y + MISS - this.y) / (x - this.x));
    this.lastX = x;
    this.lastY = y;
  }

  /** The line ends at the point that came last; the next one begins another. */
  lift() {
    if (this.isDown && (this.lastX !== this.x || this.lastY !== this.y)) this.context.lineTo(this.lastX, this.lastY);
    this.isDown = false;
  }

  /** @param {number} x @param {number} y */
  from(x, y) {
    this.x = x;
    this.y = y;
    this.lastX = x;
    this.lastY = y;
    this.least = -Infinity;
    this.most = Infinity;
  }
}
