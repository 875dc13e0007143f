// Pointing at the arm's canvas: a drag sends goals for the end effector, places the setpoint, or lifts the arm itself.
// Arrow keys do the same without a pointer.
// Invariant: while aiming, one request is sent at a time, at a bounded rate, and the last position is always sent.

import { endEffector, rounded, showAim, toWorld } from "./arm_view.js";
import { cancelTarget, goalOptions, showGoalPlace, showGoalRefusal } from "./tasks_panel.js";
import { inPageNames } from "./format.js";
import { latestOnly } from "./latest.js";
import { nearestInReach, nearestTurn } from "./mechanics.js";
import { sendGoal, sendSetpoint, setState, solve } from "./runtime.js";
import { known, state, unknown } from "./store.js";

const INTERVAL_MS = 100;
/** Time between two requests. A lifted arm falls a few millimetres in it [ms]. */
const LIFT_MS = 20;
const ARROW_M = 0.05;
const FINGER_PX = 36; // the radius that a finger covers [px]
const TAP_PX = 10; // a finger that moved less counts as a tap [px]
const SETTLE_MS = 600; // time after the last arrow key until the position counts as chosen

/** @typedef {"goal" | "setpoint" | "arm"} Mode what a drag moves */

let aim = null;
let pointer = null;
let settle = 0;
let lastPlace = null; // of the sent or next request

const send = latestOnly(async (place) => {
  report(place, place.mode === "setpoint" ? await placeSetpoint(place) : await sendGoal({ ...goalOptions(), x: place.x, y: place.y }));
}, INTERVAL_MS);

/** Moves the arm to the pointer, and holds it there until it is released. */
const lift = latestOnly(async (place) => {
  report(place, await putArm(place));
  if (aim?.mode === "arm" && !place.refused) lift(lastPlace);
}, LIFT_MS);

function report(place, answer) {
  place.refused = !answer.result;
  place.answered = true;
  showGoalRefusal(answer.result ? "" : inPageNames(answer.status));
  if (!aim) {
    if (place === lastPlace) finish(place);
  } else if (aim.refused !== place.refused) {
    aim = { ...aim, refused: place.refused };
    showAim(aim);
  }
}

/** A refused target stays visible for a moment, so the user sees it. */
function finish(place) {
  showAim(place.refused ? place : null);
  if (place.refused) setTimeout(() => { if (!aim && lastPlace === place) showAim(null); }, 1500);
}

/** The pose with the end effector at a position, each joint within half a turn of its present angle. A diverged arm has no useful count of turns. */
async function poseAt({ x, y }) {
  const answer = await solve({ x, y });
  return { answer, pose: answer.values.positions?.map((q, i) => (state.diverged ? q : nearestTurn(q, state.position[i]))) };
}

async function placeSetpoint(place) {
  const { answer, pose } = await poseAt(place);
  return answer.result ? sendSetpoint(pose) : answer;
}

async function putArm(place) {
  if (!place.pose) {
    const { answer, pose } = await poseAt(place);
    if (!answer.result) return answer;
    place.pose = pose;
  }
  return setState(place.pose);
}

/** @param {{x: number, y: number}} wished @param {Mode} mode */
function moveTo(wished, mode) {
  const place = mode === "arm" ? nearestInReach(wished, state.params.lengths) : wished;
  aim = { ...place, phi: mode === "goal" ? goalOptions().phi : undefined, mode, refused: aim?.refused ?? false };
  lastPlace = { ...aim };
  showAim(aim);
  if (mode === "arm") {
    lift(lastPlace);
  } else {
    showGoalPlace(place);
    send(lastPlace);
  }
}

function end() {
  pointer = null;
  // Sent once more at rest, because the arm has begun to fall.
  if (aim?.mode === "arm") lift(lastPlace);
  aim = null;
  // Otherwise the pending answer to the last position removes the mark.
  if (lastPlace?.answered) finish(lastPlace);
}

/** The mode chosen beside the view, because a touch screen has no keys. Shift means the setpoint. The course has no choice. @returns {Mode} */
function modeOf(event) {
  /** @type {HTMLInputElement} */
  const chosen = document.querySelector("input[name=drag]:checked");
  if (event.shiftKey) return "setpoint";
  return state.view === "course" ? "goal" : /** @type {Mode} */ (chosen.value);
}

/** The arm's lengths; null until they are known, and with them the place of a pointer in metres. */
function shape() {
  return state.links > 0 && state.params?.lengths.length === state.links ? state.params.lengths : null;
}

function isOnEnd({ clientX, clientY }) {
  if (!shape()) return false;
  const { x, y } = toWorld({ clientX, clientY });
  const end = endEffector();
  const edge = toWorld({ clientX: clientX + FINGER_PX, clientY }).x - x; // the same way in metres
  return Math.hypot(x - end.x, y - end.y) < edge;
}

/** A position that was pressed or tapped, chosen once the arm is known. */
async function choose(event) {
  if (await known(shape) === null) return showGoalRefusal(unknown().status);
  moveTo(toWorld(event), modeOf(event));
  end();
}

export function startAim(canvas) {
  // A finger that starts on the end effector drags it. Elsewhere it scrolls the page, and a tap chooses the position. A drag that starts
  // before the arm is known chooses the position where it ends.
  let tap = null;
  canvas.addEventListener("touchstart", (event) => { if (isOnEnd(event.touches[0])) event.preventDefault(); }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    tap = null;
    if (!shape() || (event.pointerType === "touch" && !isOnEnd(event))) {
      tap = event;
      return;
    }
    pointer = event.pointerId;
    canvas.setPointerCapture(pointer);
    moveTo(toWorld(event), modeOf(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (event.pointerId === pointer) moveTo(toWorld(event), event.shiftKey ? "setpoint" : aim.mode);
  });
  canvas.addEventListener("pointerup", (event) => {
    const isTap = tap?.pointerId === event.pointerId
      && (event.pointerType !== "touch" || Math.hypot(event.clientX - tap.clientX, event.clientY - tap.clientY) < TAP_PX);
    if (isTap) choose(event);
    else if (event.pointerId === pointer) end();
  });
  canvas.addEventListener("pointercancel", (event) => { if (event.pointerId === pointer) end(); });
  canvas.addEventListener("keydown", arrows);
}

async function arrows(event) {
  const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (event.key === "Escape") cancelTarget();
  if (!way || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  const mode = modeOf(event);
  if (await known(shape) === null) return showGoalRefusal(unknown().status);
  const from = aim ?? (state.goal && mode === "goal" ? state.goal.target : endEffector());
  moveTo({ x: rounded(from.x + ARROW_M * way[0]), y: rounded(from.y + ARROW_M * way[1]) }, mode);
  clearTimeout(settle);
  settle = setTimeout(end, SETTLE_MS);
}
