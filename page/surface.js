// A canvas as sharp as the screen: sized in device pixels, drawn in CSS pixels.
// Invariant: its size is read when it changes, not at every frame.

export class Surface {
  /** @param {HTMLCanvasElement} canvas @param {() => void} onResize */
  constructor(canvas, onResize) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.onResize = onResize;
    this.width = 0; // CSS pixels
    this.height = 0;
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.watchDensity();
    this.fit();
  }

  // The density changes when a window moves to another screen, or by zoom.
  watchDensity() {
    const query = matchMedia(`(resolution: ${devicePixelRatio}dppx)`);
    query.addEventListener("change", () => { this.fit(); this.watchDensity(); }, { once: true });
  }

  fit() {
    const { clientWidth, clientHeight } = this.canvas;
    const density = devicePixelRatio || 1;
    this.width = clientWidth;
    this.height = clientHeight;
    this.canvas.width = Math.max(1, Math.round(clientWidth * density));
    this.canvas.height = Math.max(1, Math.round(clientHeight * density));
    this.context.setTransform(density, 0, 0, density, 0, 0);
    this.onResize();
  }
}
