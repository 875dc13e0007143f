// Scheduling of drawing: a frame is requested only after a change, and painters return whether they need another one. Also canvases with the screen's
// resolution: sized in device pixels, drawn in CSS pixels, and painted in the next frame after a change.
// Invariant: without a change no frame is requested, and a paused or hidden page draws nothing. A canvas's size is read when it changes, not at every frame.
// A canvas is opaque and has one pixel for each covered pixel of the screen, so the browser copies it without blending or resampling.

import { colors, onTheme } from "./theme.js";

export class Surface {
  /**
   * @param {HTMLCanvasElement} canvas @param {(surface: Surface) => void} paint paints everything on
   * this empty surface; not called while the canvas is hidden @param {() => void} [resized] called at
   * a new size or theme; by default the canvas is painted again
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
      paint(this);
      return false;
    });
    onTheme(() => this.onResize());
    const observer = new ResizeObserver(() => this.fit());
    observer.observe(canvas);
    observer.observe(document.body); // a growing element above a canvas moves it, even by part of a pixel
    this.watchDensity();
    this.fit();
  }

  /** Paints it in the next frame, or once it is visible. */
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
    // A browser rounds the edges of a box, so its number of pixels depends on its position.
    const width = Math.round(right * density) - Math.round(left * density);
    const height = Math.round(bottom * density) - Math.round(top * density);
    if (width === this.width * this.density && height === this.height * this.density && density === this.density) return;
    const isFirst = this.density === 0;
    this.density = density;
    this.width = width / density;
    this.height = height / density;
    this.canvas.width = Math.max(1, width);
    this.canvas.height = Math.max(1, height);
    this.context.setTransform(density, 0, 0, density, 0, 0);
    this.clear();
    this.onResize();
    // A new size empties the canvas, so it is painted before the browser shows it.
    if (!isFirst) draw(performance.now());
  }

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

/** The number of drawn frames, for tests. */
export const count = { frames: 0 };

/** @param {Painter} painter */
export function onFrame(painter) {
  painters.push(painter);
}

/** Requests the next frame after a change. */
export function wake() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(draw);
}

function draw(now) {
  asked = false;
  count.frames += 1;
  let again = false;
  for (const paint of painters) again = paint(now) || again;
  if (again) wake();
}
