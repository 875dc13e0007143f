// @ts-check
// The recording, looked at again while the arm goes on: a time in it, step by step, in slow motion, and back to now.
// The arm itself always runs in real time; only its recording can be slow.
// Invariant: looking back changes nothing of the arm; the shown time lies within the record.

import { EFFORT, POSITION, SETPOINT, TIME, VELOCITY, firstAfter, record } from "./history.js";
import { MOST_LINKS, state, tell } from "./store.js";

/** The joint state that the pictures show: the latest joint state, or one of the recording. */
export const shown = {
  live: true,
  playing: false,
  speed: 1,
  time: 0, // s, simulation time
  position: new Float64Array(MOST_LINKS),
  velocity: new Float64Array(MOST_LINKS),
  effort: new Float64Array(MOST_LINKS),
  setpoint: new Float64Array(MOST_LINKS),
  setpointKnown: false,
};

/** The first and the last time of the recording [s]; null where there is none. */
export function span() {
  if (record.length === 0) return null;
  return { from: record.data[record.at(0) + TIME], to: record.data[record.last() + TIME] };
}

/** Takes the latest joint state, unless the recording is looked at. */
export function follow() {
  if (!shown.live) return;
  shown.time = state.time;
  shown.position.set(state.position);
  shown.velocity.set(state.velocity);
  shown.effort.set(state.effort);
  shown.setpoint.set(state.setpoint);
  shown.setpointKnown = state.setpointKnown;
}

/** Back to the arm as it is. */
export function goLive() {
  shown.live = true;
  shown.playing = false;
  follow();
  tell("playback");
}

/** Shows the recording at `time` [s], or as near to it as there is one. @param {number} time */
export function seek(time) {
  const all = span();
  if (!all) return;
  shown.live = false;
  shown.time = Math.min(all.to, Math.max(all.from, time));
  read(shown.time);
  tell("playback");
}

/** A recorded joint state back or forth. @param {1 | -1} way */
export function stepBy(way) {
  if (record.length === 0) return;
  shown.playing = false;
  const now = shown.live ? record.length - 1 : nearest(shown.time);
  const row = Math.min(record.length - 1, Math.max(0, now + way));
  seek(record.data[record.at(row) + TIME]);
}

/** Plays on from where it is, or from `back` seconds before now. @param {number} speed @param {number} back */
export function play(speed, back) {
  const all = span();
  if (!all) return;
  shown.speed = speed;
  if (shown.live || shown.time >= all.to) seek(all.to - back);
  shown.playing = true;
  tell("playback");
}

export function halt() {
  shown.playing = false;
  tell("playback");
}

/** Wall time goes on by `seconds`. @param {number} seconds */
export function advance(seconds) {
  if (!shown.playing) return;
  const all = span();
  const next = shown.time + seconds * shown.speed;
  if (!all) goLive();
  else if (next >= all.to) goLive(); // caught up with the arm
  else seek(next);
}

/** @param {number} time */
function nearest(time) {
  const after = Math.min(firstAfter(time), record.length - 1);
  if (after === 0) return 0;
  const at = (/** @type {number} */ row) => record.data[record.at(row) + TIME];
  return time - at(after - 1) < at(after) - time ? after - 1 : after;
}

/** Between two rows positions follow the cubic that has their values and velocities; the rest goes straight. */
function read(/** @type {number} */ time) {
  const { data } = record;
  const next = Math.min(firstAfter(time), record.length - 1);
  const [a, b] = [record.at(Math.max(0, next - 1)), record.at(next)];
  const h = data[b + TIME] - data[a + TIME];
  const s = h > 0 ? (time - data[a + TIME]) / h : 1;
  for (let i = 0; i < MOST_LINKS; i += 1) {
    const [p, q] = [data[a + POSITION + i], data[b + POSITION + i]];
    const [v, w] = [h * data[a + VELOCITY + i], h * data[b + VELOCITY + i]];
    const change = q - p;
    shown.position[i] = s === 1 ? q : p + s * (v + s * (3 * change - 2 * v - w + s * (v + w - 2 * change)));
    shown.velocity[i] = data[a + VELOCITY + i] + s * (data[b + VELOCITY + i] - data[a + VELOCITY + i]);
    shown.effort[i] = data[b + EFFORT + i];
    shown.setpoint[i] = data[b + SETPOINT + i];
  }
  shown.setpointKnown = Number.isFinite(shown.setpoint[0]);
}
