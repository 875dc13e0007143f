// @ts-check
// The two views of the page, Course and Workbench, and the full screen.
// Invariant: a view only shows and hides; the arm and all settings are the same in both.

import { byId, setAddress, setText } from "./dom.js";
import { stepIn } from "./course.js";
import { set, state, watch } from "./store.js";

/** A link that brings settings but no step is about the workbench. */
const SETTINGS = /(^#|&)(links|method|timestep|gravity|masses|lengths|kp|ki|kd|period|delay|servo|setpoint|workbench)\b/;

export function startViews() {
  byId("view-switch").addEventListener("click", () => show(state.view === "course" ? "workbench" : "course"));
  byId("full-screen").addEventListener("click", () => {
    if (document.fullscreenElement) document.exitFullscreen();
    else document.documentElement.requestFullscreen?.();
  });
  document.addEventListener("fullscreenchange", () => setText(byId("full-screen"), document.fullscreenElement ? "Leave full screen" : "Full screen"));
  watch("view", (view) => {
    document.body.dataset.view = view;
    setText(byId("view-switch"), view === "course" ? "Workbench" : "Course");
    byId("course").hidden = view !== "course";
  });
  set("view", stepIn(location.hash) < 0 && SETTINGS.test(location.hash) ? "workbench" : "course");
}

/** @param {"course" | "workbench"} view */
function show(view) {
  if (view === "workbench" && stepIn(location.hash) >= 0) setAddress(location.pathname + location.search);
  set("view", view);
}
