// @ts-check
// Files to keep: the recording as CSV, the plots as PNG or SVG.
// Invariant: the page's memory is not kept: a file is handed to the browser and released.

import { csvText } from "./csv.js";
import { byId, el } from "./dom.js";
import { drawAll, heightOfAll } from "./plots.js";
import { presentSettings } from "./settings.js";
import { state } from "./store.js";
import { SvgContext } from "./svg_context.js";
import { colors } from "./theme.js";

const WIDTH = 640; // CSS pixels
const DENSITY = 2; // of a PNG
const KEPT_MS = 10000;

export function startSave() {
  const choice = byId("plot-save");
  choice.addEventListener("change", () => {
    const kind = choice.value;
    choice.value = "";
    save(kind);
  });
}

async function save(kind) {
  const contents = { csv: () => new Blob([csvText(state.links, presentSettings(state))], { type: "text/csv" }), svg, png }[kind];
  if (contents) hand(await contents(), `pendularm.${kind}`);
}

/** The plots as an SVG file. */
export function svg() {
  const context = new SvgContext(WIDTH, heightOfAll(), colors.panel);
  drawAll(context, WIDTH);
  return new Blob([context.toString()], { type: "image/svg+xml" });
}

function png() {
  const canvas = el("canvas", { width: WIDTH * DENSITY, height: heightOfAll() * DENSITY });
  const context = canvas.getContext("2d");
  context.scale(DENSITY, DENSITY);
  context.fillStyle = colors.panel;
  context.fillRect(0, 0, WIDTH, heightOfAll());
  drawAll(context, WIDTH);
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}

function hand(blob, name) {
  const url = URL.createObjectURL(blob);
  el("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), KEPT_MS);
}
