// @ts-check
// The panels beside the arm, one at a time, as tabs: arrow keys go from one to the next.
// Invariant: exactly one panel is shown, and only that one costs anything to draw.

import { byId } from "./dom.js";
import { set, state } from "./store.js";

const NAMES = ["plots", "stability", "error", "compare", "tasks"];

export function startTabs() {
  NAMES.forEach((name, i) => {
    const tab = byId(`tab-${name}`);
    tab.addEventListener("click", () => openTab(name));
    tab.addEventListener("keydown", ({ key }) => {
      const way = { ArrowLeft: -1, ArrowRight: 1 }[key];
      if (!way) return;
      const next = NAMES[(i + way + NAMES.length) % NAMES.length];
      openTab(next);
      byId(`tab-${next}`).focus();
    });
  });
}

export function openTab(name) {
  for (const one of NAMES) {
    byId(one).hidden = one !== name;
    byId(`tab-${one}`).setAttribute("aria-selected", String(one === name));
    byId(`tab-${one}`).tabIndex = one === name ? 0 : -1;
  }
  if (state.tab !== name) set("tab", name);
}
