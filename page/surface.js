// When to draw: a frame is asked for only if something has changed, and painters say whether they need one more. And a canvas as
// sharp as the screen: sized in device pixels, drawn in CSS pixels, painted in the next frame after something of it has changed.
// Invariant: with nothing to show, no frame is asked for; a page that is paused or hidden draws nothing. A canvas's size is read when
// it changes, not at every frame. A canvas is opaque and has a pixel for each pixel of the screen that it covers: the browser copies it,
// and neither blends nor resamples.

import { colors, onTheme } from "./theme.js";

export class Surface {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => void} paint all of it, on an empty canvas; not called while the canvas is hidden
   * @param {() => void} [resized] what a new size or theme is to do, else it is painted anew
   */
  constructor(canvas, paint, resized) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.width = 0; // CSS pixels
    this.height = 0;
    this.density = 0; // device pixels in a CSS pixel; 0 before the first size
    this.stale = false;
    this.onResize = resized ?? (() => this.redraw());
    onFrame(() => {
      if (!this.stale || this.width === 0) return false;
      this.stale = false;
      this.clear();
      paint();
      return false;
    });
    onTheme(() => this.onResize());
    const observer = new ResizeObserver(() => this.fit());
    observer.observe(canvas);
    observer.observe(document.body); // what grows above a canvas moves it, by a part of a pixel too
    this.watchDensity();
    this.fit();
  }

  /** Paints it in the next frame, or once it is in sight. */
  redraw() {
    this.stale = true;
    if (this.width > 0) wake();
  }

  // The density changes when a window moves to another screen, or by zoom.
  watchDensity() {
    const query = matchMedia(`(resolution: ${devicePixelRatio}dppx)`);
    query.addEventListener("change", () => { this.fit(); this.watchDensity(); }, { once: true });
  }

  fit() {
    const density = devicePixelRatio || 1;
    const { left, top, right, bottom } = this.canvas.getBoundingClientRect();
    // A browser rounds where the edges are, so that a box's place has a say in how many pixels it covers.
    const width = Math.round(right * density) - Math.round(left * density);
    const height = Math.round(bottom * density) - Math.round(top * density);
    if (width === this.width * this.density && height === this.height * this.density && density === this.density) return;
    this.density = density;
    this.width = width / density;
    this.height = height / density;
    this.canvas.width = Math.max(1, width);
    this.canvas.height = Math.max(1, height);
    this.context.setTransform(density, 0, 0, density, 0, 0);
    this.onResize();
  }

  /** Paints all of it in the colour of what it stands on. */
  clear() {
    this.context.globalAlpha = 1;
    this.context.fillStyle = colors.panel;
    this.context.fillRect(0, 0, this.width, this.height);
  }
}

/** @typedef {(now: number) => boolean} Painter true: one more frame is needed */

/** @type {Painter[]} */
const painters = [];
let asked = false;

/** How many frames have been drawn; for tests and the curious. */
export const count = { frames: 0 };

/** @param {Painter} painter */
export function onFrame(painter) {
  painters.push(painter);
}

/** Something has changed: the next frame is drawn. */
export function wake() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(draw);
}

/** @param {number} now */
function draw(now) {
  asked = false;
  count.frames += 1;
  let again = false;
  for (const paint of painters) again = paint(now) || again;
  if (again) wake();
}
