// @ts-check
// The recording's controls: scrub, step, replay in slow motion, back to live; and the stopwatch.
// Invariant: they move what is shown, never the arm.

import { byId, setAttribute, setText } from "./dom.js";
import { fixed } from "./format.js";
import { onFrame, wake } from "./frames.js";
import { advance, goLive, halt, play, seek, shown, span, stepBy } from "./playback.js";
import { state, watch } from "./store.js";

/** How far back a replay begins [s]. */
const REPLAY_SECONDS = 5;
const SCRUB_STEPS = 1000;

let lastFrame = NaN;
let watchFrom = NaN; // simulation time at which the stopwatch was started
let watchTo = NaN; // and stopped

export function startHistory() {
  byId("history-play").addEventListener("click", () => {
    if (shown.playing) halt();
    else play(speed(), REPLAY_SECONDS);
    wake();
  });
  byId("history-speed").addEventListener("change", () => { shown.speed = speed(); });
  byId("history-back").addEventListener("click", () => stepBy(-1));
  byId("history-on").addEventListener("click", () => stepBy(1));
  byId("history-live").addEventListener("click", goLive);
  byId("watch").addEventListener("click", stopwatch);
  byId("history-scrub").addEventListener("input", ({ target }) => {
    const all = span();
    if (!all) return;
    shown.playing = false;
    const part = Number(target.value) / SCRUB_STEPS;
    if (part === 1) goLive();
    else seek(all.from + part * (all.to - all.from));
  });
  watch("playback", showHistory);
  onFrame(playOn);
}

function speed() {
  return Number(byId("history-speed").value);
}

/** Gives whether it plays on. */
function playOn(now) {
  const seconds = Number.isFinite(lastFrame) ? (now - lastFrame) / 1000 : 0;
  lastFrame = shown.playing ? now : NaN;
  advance(seconds);
  return shown.playing;
}

/** A few times a second, and whenever the recording is touched. */
export function showHistory() {
  const all = span();
  const scrub = byId("history-scrub");
  const part = shown.live || !all || all.to === all.from ? 1 : (shown.time - all.from) / (all.to - all.from);
  scrub.value = String(Math.round(part * SCRUB_STEPS));
  setAttribute(scrub, "aria-valuetext", shown.live ? "live" : `${fixed(shown.time, 2)} s, ${fixed(state.time - shown.time, 2)} s ago`);
  byId("history-live").disabled = shown.live;
  setText(byId("history-play"), shown.playing ? "Hold" : "Replay");
  byId("stage").classList.toggle("recording", !shown.live);
  showStopwatch();
}

function stopwatch() {
  const time = shown.time;
  if (Number.isNaN(watchFrom)) watchFrom = time;
  else if (Number.isNaN(watchTo)) watchTo = time;
  else {
    watchFrom = NaN;
    watchTo = NaN;
  }
  showStopwatch();
}

function showStopwatch() {
  const runs = Number.isFinite(watchFrom);
  byId("watch-hud").hidden = !runs;
  setText(byId("watch"), !runs ? "Stopwatch" : Number.isNaN(watchTo) ? "Stop" : "Clear");
  if (runs) setText(byId("watch-hud"), `stopwatch ${fixed((Number.isNaN(watchTo) ? shown.time : watchTo) - watchFrom, 3)} s`);
}
