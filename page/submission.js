// A submission of an episode in the page in one file: opened or dropped, recomputed bit for bit, judged in words, and played.
// Invariant: the live arm does not change.

import { announce, byId, setText } from "./dom.js";
import { isAlone, score } from "./kernel.js";
import { playMotions } from "./motions.js";
import { set } from "./store.js";
import { Surface } from "./surface.js";
import { openTab } from "./views.js";

const MOST_BYTES = 2 ** 20; // the most bytes of a submission, as in the program
const STEP_MS = 50; // simulation time of a step [ms]

let surface;
let began = 0;
let steps = 0;
let motions = /** @type {import("./motions.js").Motion[]} */ ([]);

export function startSubmission() {
  byId("submission").hidden = !isAlone;
  if (!isAlone) return;
  surface = new Surface(byId("submission-motion"), (one) => playMotions(one, motions, began, STEP_MS * steps));
  byId("submission-file").addEventListener("change", ({ target }) => open(target.files[0]));
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    set("view", "workbench");
    openTab("tasks");
    open(event.dataTransfer?.files[0]);
  });
}

async function open(file) {
  if (!file) return;
  const [words, poses = [], target] = file.size > MOST_BYTES ? [`not a submission: more than ${MOST_BYTES} bytes`] : await score(await file.arrayBuffer());
  setText(byId("submission-text"), words);
  announce(words);
  byId("submission-motion").hidden = poses.length === 0;
  [began, steps] = [performance.now(), poses.length - 1];
  motions = poses.length > 0 ? [{ name: file.name, note: `${(steps * STEP_MS) / 1000} s`, poses, lengths: [1, 1], color: "accent", target }] : [];
  surface.redraw();
}
