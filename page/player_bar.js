// @ts-check
// The bar of a record that is replayed in the arm's place: speed, forward and back, and a place in it.
// Invariant: it is there while the runtime plays a record, and no timer runs without it.

import { byId, setAttribute, setText } from "./dom.js";
import { fixed } from "./format.js";
import { player } from "./runtime.js";
import { set, state, watch } from "./store.js";

const LOOK_MS = 250;
const SCRUB_STEPS = 1000;

let timer = 0;
let duration = NaN; // s
let held = false; // the scrubber is being moved

export function startPlayerBar() {
  const scrub = byId("player-scrub");
  scrub.addEventListener("input", () => {
    held = true;
    seek((Number(scrub.value) / SCRUB_STEPS) * duration);
  });
  scrub.addEventListener("change", () => { held = false; });
  byId("player-speed").addEventListener("change", ({ target }) => player("set_rate", { rate: Number(target.value) }));
  watch("replay", show);
  watch("connection", show);
}

function show() {
  const isShown = state.replay && state.connection === "open";
  byId("player").hidden = !isShown;
  clearInterval(timer);
  if (!isShown) return;
  look();
  timer = setInterval(look, LOOK_MS);
}

function seek(time) {
  if (!Number.isFinite(time)) return;
  const sec = Math.floor(time);
  player("seek", { time: { sec, nanosec: Math.floor((time - sec) * 1e9) } });
}

async function look() {
  if (document.hidden) return;
  const [place, speed, pause] = await Promise.all([player("get_position"), player("get_rate"), player("is_paused")]);
  if (!place.result || !speed.result || !pause.result) return;
  if (state.paused !== pause.values.paused) set("paused", pause.values.paused);
  duration = place.values.duration;
  const { position } = place.values;
  setText(byId("player-time"), `${fixed(position, 1)} of ${fixed(duration, 1)} s`);
  const scrub = byId("player-scrub");
  if (!held) scrub.value = String(Math.round((position / Math.max(duration, 1e-9)) * SCRUB_STEPS));
  setAttribute(scrub, "aria-valuetext", `${fixed(position, 1)} s`);
  // Another client may have chosen a speed that is not offered here.
  const offered = byId("player-speed");
  if (document.activeElement !== offered) offered.value = String(speed.values.rate);
}
