// @ts-check
// One instant that all plots point at: under the pointer, or where the recording is looked at.
// Invariant: the pointer goes before the recording; with neither there is no cursor (NaN).

import { wake } from "./frames.js";
import { shown } from "./playback.js";
import { tell } from "./store.js";

let hovered = NaN;

/** The instant that the plots mark [s, simulation time]; NaN where there is none. */
export function cursor() {
  if (Number.isFinite(hovered)) return hovered;
  return shown.live ? NaN : shown.time;
}

/** @param {number} time NaN once the pointer has left */
export function hover(time) {
  if (Object.is(time, hovered)) return;
  hovered = time;
  tell("cursor");
  wake();
}
