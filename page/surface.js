// @ts-check
// A canvas as sharp as the screen: sized in device pixels, drawn in CSS pixels.
// Invariant: its size is read when it changes, not at every frame. It is opaque and has a pixel for each of the screen's that it
// covers, so that a frame of it is copied to the screen, neither blended nor resampled.

import { colors } from "./theme.js";

export class Surface {
  /** @param {HTMLCanvasElement} canvas @param {() => void} onResize */
  constructor(canvas, onResize) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.onResize = onResize;
    this.width = 0; // CSS pixels
    this.height = 0;
    this.density = 0; // device pixels in a CSS pixel; 0 before the first size
    const resized = new ResizeObserver(() => this.fit());
    resized.observe(canvas);
    resized.observe(document.body); // what grows above a canvas moves it, by a part of a pixel too
    this.watchDensity();
    this.fit();
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
