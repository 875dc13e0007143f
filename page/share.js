// @ts-check
// The settings in the page's address, behind the #, to be sent to others.
// Invariant: opening an address changes nothing; its settings wait for a click. Any page can link here, and a link must not
// be able to drive the arm.

import { announce } from "./announce.js";
import { byId, el, setAddress, setText } from "./dom.js";
import { apply, remember } from "./actions.js";
import { presentStep } from "./course_view.js";
import { fromFragment, presentSettings, toFragment } from "./settings.js";
import { state, watch } from "./store.js";

const SHOWN_MS = 2500;

export function startShare() {
  byId("share").addEventListener("click", share);
  if (location.hash.length > 1) watch("params", offer);
}

/** The page's address with the present settings behind the #. */
export function address() {
  const link = new URL(location.href);
  link.search = ""; // it may hold a token
  const step = state.view === "course" ? `step=${presentStep()}&` : "";
  link.hash = step + toFragment(/** @type {any} */ (presentSettings(state)), state.links);
  return link.href;
}

async function share() {
  if (!presentSettings(state)) return;
  const link = address();
  setAddress(new URL(link).hash);
  let said = "Link copied";
  try {
    await navigator.clipboard.writeText(link);
  } catch {
    said = "Link is in the address bar";
  }
  setText(byId("share-text"), said);
  announce(said);
  setTimeout(() => setText(byId("share-text"), "Share"), SHOWN_MS);
}

let offered = false;

function offer() {
  if (offered) return;
  offered = true;
  const settings = fromFragment(location.hash);
  if (!Object.values(settings).some((one) => one !== null)) return;
  const banner = byId("offer");
  const given = new URLSearchParams(location.hash.slice(1));
  const text = [...given].filter(([name]) => name !== "links" && name !== "step").map(([name, value]) => `${name} ${value}`).join(" · ").slice(0, 300);
  const done = () => { banner.hidden = true; };
  const refused = el("p", { class: "refusal" });
  banner.replaceChildren(
    el("p", {}, "This link brings settings: ", el("span", { class: "offer-text" }, text)),
    el("button", { type: "button", class: "primary", onclick: async () => {
      remember();
      const refusals = await apply(settings);
      setText(refused, refusals.join(" "));
      if (refusals.length === 0) done();
    } }, "Apply"),
    el("button", { type: "button", onclick: done }, "Ignore"), refused,
  );
  banner.hidden = false;
  announce("This link brings settings. Apply or ignore them.");
}
