// Starts the page: every part takes its place, then the runtime is called, then frames are drawn.
// Invariant: one loop draws everything, and a frame in which nothing changed costs next to nothing.

import { startAim } from "./aim.js";
import { clearTrail, drawArm, extendTrail, startArmView } from "./arm_view.js";
import { startCompare } from "./compare.js";
import { startControls } from "./controls.js";
import { byId } from "./dom.js";
import { startGoalPanel } from "./goal_panel.js";
import { startKeyboard } from "./keyboard.js";
import { drawPlots, redraw as redrawPlots, showValues, startPlots } from "./plots.js";
import { describeArm, showReadouts, startReadouts } from "./readouts.js";
import { record, take } from "./recorder.js";
import { start } from "./runtime.js";
import { startShare } from "./share.js";
import { watch } from "./store.js";
import { startTheme } from "./theme.js";
import { startTransport } from "./transport.js";
import { startTrialPanel } from "./trial_panel.js";

/** Figures change this often [ms]; faster can't be read. */
const FIGURES_MS = 125;
const SENTENCE_MS = 1000;

startTheme();
startArmView(byId("arm"));
startPlots();
startControls();
startTransport();
startReadouts();
startGoalPanel();
startTrialPanel();
startCompare();
startKeyboard();
startShare();
startAim(byId("arm"));

// On a small screen what is not needed at once is folded away.
if (matchMedia("(max-width: 779px)").matches) {
  for (const one of document.querySelectorAll("#controls > details:nth-of-type(n + 2), #tasks > details:nth-of-type(n + 2), #compare > details")) one.open = false;
}

function forget() {
  record.clear();
  clearTrail();
  redrawPlots();
}

watch("version", () => {
  take();
  extendTrail();
});
watch("links", forget);
start(forget);

setInterval(() => {
  showReadouts();
  showValues();
}, FIGURES_MS);
setInterval(describeArm, SENTENCE_MS);

let frame = 0;
function draw(now) {
  frame += 1;
  drawArm(now);
  drawPlots(frame);
  requestAnimationFrame(draw);
}
requestAnimationFrame(draw);
