// @ts-check
// The lessons' row: a button for each, and the two sentences of the one that was chosen.
// Invariant: a lesson changes the arm only when it is clicked.

import { announce } from "./announce.js";
import { startLesson } from "./actions.js";
import { byId, el, setText } from "./dom.js";
import { LESSONS } from "./lessons.js";
import { set, state, watch } from "./store.js";

/** Here the lessons' buttons are far from the arm; as in `small.css`. */
const SMALL = "(max-width: 779px)";

export function startLessons() {
  const welcome = [...byId("lesson-text").childNodes].map((one) => one.cloneNode(true));
  const buttons = new Map(LESSONS.map((lesson) => [lesson, el("button", {
    type: "button", class: "small", "aria-pressed": "false", id: `lesson-${lesson.id}`, onclick: () => choose(lesson),
  }, lesson.name)]));
  byId("lesson-choice").append(...buttons.values());
  byId("lesson-text").addEventListener("click", ({ target }) => {
    const named = LESSONS.find(({ id }) => id === target.dataset.lesson);
    if (named) choose(named);
  });
  const show = () => {
    const chosen = state.lesson;
    for (const [lesson, button] of buttons) button.setAttribute("aria-pressed", String(lesson === chosen));
    byId("lesson-text").replaceChildren(...(chosen ? [chosen.text] : welcome.map((one) => one.cloneNode(true))));
  };
  watch("lesson", show);
}

async function choose(lesson) {
  if (state.links === 0) return;
  if (lesson === state.lesson) {
    set("lesson", null);
    announce("The lesson is over; its settings stay.");
    return;
  }
  if (matchMedia(SMALL).matches) byId("lesson-text").scrollIntoView();
  const refusals = await startLesson(lesson);
  if (refusals.length > 0) setText(byId("lesson-text"), `${lesson.text} Refused: ${refusals.join("; ")}`);
}
