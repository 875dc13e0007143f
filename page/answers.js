// One sheet with the answers of the course: of each step the guess, the figure with its settings, and the answer. The browser keeps them.
// Invariant: the sheet has what the student chose and saw, and marks it. It never fills in anything.

import { STEPS } from "./course.js";
import { byId, el, fillTable, keepChoice, remembered } from "./dom.js";

/** @typedef {{guess?: number, figure?: string, settings?: string, answer?: number}} Answer guess and answer by their place in the list */

const KEPT = "pendularm-answers";

/** @type {Record<string, Answer>} */
let answers = {};

/** @param {string} id of the step @param {Answer} part */
export function keepAnswer(id, part) {
  answers[id] = { ...answers[id], ...part };
  keepChoice(KEPT, JSON.stringify(answers));
}

export function startAnswers() {
  try {
    answers = { ...JSON.parse(remembered(KEPT) ?? "{}") };
  } catch {
    // Something else has written there.
  }
  byId("answers-open").addEventListener("click", () => {
    fillTable(byId("answers-table"), ["step", "figure", "guess", "question", "answer"], STEPS.map(row));
    byId("answers").showModal();
  });
  byId("answers-print").addEventListener("click", () => print());
}

/** @param {import("./course.js").Step} step @param {number} i */
function row({ id, title, guess, question }, i) {
  const { figure = "", settings = "", ...chosen } = answers[id] ?? {};
  return [`${i + 1}. ${title}`, settings ? el("a", { href: `#${settings}`, title: "its settings" }, figure) : figure,
    marked(guess, chosen.guess), question.text, marked(question, chosen.answer)];
}

/** A choice, and whether it is right. @param {import("./course.js").Question | undefined} asked @param {number | undefined} chosen */
function marked(asked, chosen) {
  const text = asked?.answers[chosen ?? -1];
  return text ? `${text} ${chosen === asked.right ? "✓" : "✗"}` : "";
}
