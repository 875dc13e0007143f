// Light and dark themes, and the colours of the canvases from the style sheet.
// Invariant: colours are defined only in `style.css`.

import { byId, keepChoice, remembered } from "./dom.js";

const KEY = "pendularm-theme";
const NAMES = ["page", "panel", "ink", "muted", "line", "grid", "accent", "good", "warn", "bad", "target", "joint1", "joint2", "joint3", "kinetic",
  "potential", "stable", "unstable", "method1", "method2", "method3", "method4"];
const dark = matchMedia("(prefers-color-scheme: dark)");
/** Paper is always light, and the user may choose the colours of all elements except the canvases. */
const others = [matchMedia("print"), matchMedia("(forced-colors: active)")];
const listeners = [];

/** Colours by name, from the present theme; `joints` and `methods` in their order. */
export const colors = { joints: [], methods: [] };

export function onTheme(react) {
  listeners.push(react);
}

function read() {
  // A variable's text has both themes. As an element's computed colour it is one.
  const probe = byId("probe");
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    colors[name] = getComputedStyle(probe).color;
  }
  colors.joints = [colors.joint1, colors.joint2, colors.joint3];
  colors.methods = [colors.method1, colors.method2, colors.method3, colors.method4];
  for (const react of listeners) react();
}

function apply(choice) {
  if (choice) document.documentElement.dataset.theme = choice;
  else delete document.documentElement.dataset.theme;
  read();
}

export function startTheme() {
  apply(remembered(KEY));
  for (const one of [dark, ...others]) one.addEventListener("change", read);
  byId("theme").addEventListener("click", () => {
    const isDark = (document.documentElement.dataset.theme ?? (dark.matches ? "dark" : "light")) === "dark";
    const choice = isDark ? "light" : "dark";
    keepChoice(KEY, choice);
    apply(choice);
  });
}
