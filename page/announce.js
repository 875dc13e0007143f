// @ts-check
// Says aloud, to screen readers, what others see happen: goals reached, refusals, a lost connection.
// Invariant: only events are announced. Values that change all the time are in texts that are read when asked for.

import { byId } from "./dom.js";

const REPEAT_MS = 3000;
let lastText = "";
let lastTime = -Infinity;

function say(id, text) {
  const now = performance.now();
  if (text === lastText && now - lastTime < REPEAT_MS) return; // a drag may be refused many times a second
  lastText = text;
  lastTime = now;
  const region = byId(id);
  // Emptied first, since a region that does not change is not read again.
  region.textContent = "";
  requestAnimationFrame(() => {
    region.textContent = text;
  });
}

export function announce(text) {
  say("announce-polite", text);
}

export function warn(text) {
  say("announce-assertive", text);
}
