// @ts-check
// Pointing at the arm's canvas: a drag sends goals for the end effector, with shift it places the setpoint directly.
// Arrow keys do the same for those who use no pointer.
// Invariant: at most ten requests a second leave while aiming, and the last place is always sent.

import { warn } from "./announce.js";
import { endEffector, showAim, toWorld } from "./arm_view.js";
import { goalOptions, showGoalPlace, showGoalRefusal } from "./goal_panel.js";
import { latestOnly } from "./latest.js";
import { nearestTurn } from "./mechanics.js";
import { cancelGoal, sendGoal, sendSetpoint, solve } from "./runtime.js";
import { state } from "./store.js";

const INTERVAL_MS = 100;
const ARROW_M = 0.05;
/** After the last arrow key the place counts as chosen. */
const SETTLE_MS = 600;

let aim = null;
let pointer = null;
let settle = 0;
let lastPlace = null; // of those sent, or about to be

const send = latestOnly(async (place) => {
  const answer = place.direct ? await placeSetpoint(place) : await sendGoal({ ...goalOptions(), x: place.x, y: place.y });
  place.refused = !answer.result;
  place.answered = true;
  showGoalRefusal(answer.result ? "" : answer.status);
  if (!answer.result) warn(answer.status);
  if (aim) showAim({ ...aim, refused: place.refused });
  else if (place === lastPlace) finish(place);
}, INTERVAL_MS);

/** A target that was refused stays in sight for a moment, so that one sees what was meant. */
function finish(place) {
  showAim(place.refused ? place : null);
  if (place.refused) setTimeout(() => { if (!aim && lastPlace === place) showAim(null); }, 1500);
}

async function placeSetpoint({ x, y }) {
  const answer = await solve({ x, y });
  if (answer.result) sendSetpoint(answer.values.positions.map((q, i) => nearestTurn(q, state.position[i])));
  return answer;
}

function moveTo(place, direct) {
  aim = { ...place, phi: direct ? undefined : goalOptions().phi, direct, refused: aim?.refused ?? false };
  lastPlace = { ...aim };
  showAim(aim);
  showGoalPlace(place);
  send(lastPlace);
}

function end() {
  pointer = null;
  aim = null;
  // Otherwise the answer to the last place, which is still to come, takes the mark away.
  if (lastPlace?.answered) finish(lastPlace);
}

/** Whether a drag places the setpoint without a key: on a touch screen there is none. */
function placesSetpoint() {
  /** @type {HTMLInputElement} */
  const chosen = document.querySelector("input[name=drag]:checked");
  return chosen.value === "setpoint";
}

export function startAim(canvas) {
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return toWorld(event.clientX - box.left, event.clientY - box.top);
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || state.links === 0) return;
    pointer = event.pointerId;
    canvas.setPointerCapture(pointer);
    moveTo(place(event), event.shiftKey || placesSetpoint());
  });
  canvas.addEventListener("pointermove", (event) => {
    if (event.pointerId === pointer) moveTo(place(event), event.shiftKey || aim?.direct);
  });
  canvas.addEventListener("pointerup", (event) => { if (event.pointerId === pointer) end(); });
  canvas.addEventListener("pointercancel", (event) => { if (event.pointerId === pointer) end(); });
  canvas.addEventListener("keydown", arrows);
}

function arrows(event) {
  const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (event.key === "Escape") cancelGoal();
  if (!way || state.links === 0 || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  const from = aim ?? (state.goal && !event.shiftKey ? state.goal.target : endEffector());
  const round = (value) => Math.round(value * 1e4) / 1e4;
  moveTo({ x: round(from.x + ARROW_M * way[0]), y: round(from.y + ARROW_M * way[1]) }, event.shiftKey);
  clearTimeout(settle);
  settle = setTimeout(end, SETTLE_MS);
}
