// Starts the page: sets up every part, then connects to the runtime. Frames are drawn when something has changed.
// Invariant: without a change nothing is drawn, and no timer runs.

import { remember, startActions } from "./actions.js";
import { startAim } from "./aim.js";
import { hasMoved, redrawTrail, startArmView } from "./arm_view.js";
import { startCompare } from "./compare.js";
import { startControls } from "./controls.js";
import { startCopy } from "./copy.js";
import { moveCourse, startCourse } from "./course_view.js";
import { byId, setAddress } from "./dom.js";
import { wake } from "./surface.js";
import { startKeyboard } from "./keyboard.js";
import { startLadder } from "./ladder_panel.js";
import { startStability } from "./stability_panel.js";
import { movePlots, redraw as redrawPlots, showValues, startPlots } from "./plots.js";
import { startRealism } from "./realism.js";
import { describeArm, showReadouts, startReadouts } from "./readouts.js";
import { record, take } from "./history.js";
import { start } from "./runtime.js";
import { watch, watchAll } from "./store.js";
import { startSubmission } from "./submission.js";
import { startTasks } from "./tasks_panel.js";
import { startTheme } from "./theme.js";
import { startTransport } from "./transport.js";
import { startShare, startTabs, startViews } from "./views.js";

/** Interval of plots and trail [ms], all in one frame. The arm itself moves in every frame. */
const BEAT_MS = 100;
const FIGURES = 2; // figures change every few intervals, because faster changes cannot be read
const SENTENCE_MS = 1000;

// The token is in a cookie now, which scripts cannot read. So it is removed from the address, and is not in the history or in copied links.
const address = new URL(location.href);
if (address.searchParams.has("token")) {
  address.searchParams.delete("token");
  setAddress(address);
}

startTheme();
startTabs();
startArmView(byId("arm"));
startPlots();
startControls();
startRealism();
startTransport();
startReadouts();
startTasks();
startSubmission();
startStability();
startLadder();
startCompare();
startActions();
startCopy();
startKeyboard();
startShare();
startAim(byId("arm"));
startCourse();
startViews();

// On a small screen less important parts are folded.
if (innerWidth < 48.75 * parseFloat(getComputedStyle(document.documentElement).fontSize)) {
  for (const one of document.querySelectorAll("#controls > details:nth-of-type(n + 3)")) one.removeAttribute("open");
}

/** Clears the recording: of another run it would be one curve with the next. */
function forget() {
  record.clear();
  redrawPlots();
}

watch("version", () => {
  take();
  if (hasMoved()) wake();
});
watch("links", forget);
start(forget, remember);

let beats = 0;
let described = -Infinity;
let left = 0; // remaining intervals, so the figures show the last message

function beat() {
  left -= 1;
  if (left > 0) setTimeout(beat, BEAT_MS);
  if (document.hidden) return;
  beats += 1;
  if (beats % FIGURES === 0) {
    showReadouts();
    showValues();
  }
  const now = performance.now();
  if (now - described >= SENTENCE_MS) {
    described = now;
    describeArm();
  }
  movePlots();
  moveCourse();
  redrawTrail();
}

watchAll(() => {
  if (left === 0) setTimeout(beat, BEAT_MS);
  left = FIGURES;
});
