// @ts-check
// When to draw: a frame is asked for only if something has changed, and painters say whether they need one more.
// Invariant: with nothing to show, no frame is asked for; a page that is paused or hidden draws nothing.

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
