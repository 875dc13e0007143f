// Draws a line through many points with only a few of them. Points are omitted if the straight line passes them at an invisible
// distance. A line of ten seconds has 600 points, and on a screen a tenth of them is enough.
// Invariant: the vertical distance of every point from the drawn line is at most `MISS`. Points are in order from left to
// right.

/** [px] */
export const MISS = 0.25;

export class Pencil {
  /** @param {{moveTo(x: number, y: number): void, lineTo(x: number, y: number): void}} context the path to extend */
  constructor(context) {
    this.context = context;
    this.isDown = false;
    this.x = 0; // the last drawn point
    this.y = 0;
    this.lastX = 0; // the last given point
    this.lastY = 0;
    this.least = -Infinity; // slopes of lines from the drawn point that pass all later points
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

  /** Ends the line at the last given point. The next point begins another line. */
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
