// The two views of the page, Course and Workbench; the panels beside the arm as tabs; the full screen; the number of links.
// Also links to share: the settings are in the page's address, after the #.
// Invariant: a view only shows and hides; the arm and all settings are the same in both. Opening an address changes nothing;
// its settings wait for a click. Any page can link here, and a link must not be able to drive the arm.

import { apply, remember } from "./actions.js";
import { stepIn } from "./course.js";
import { chooseLinks, followLink, linksInLink, needed, stepInLink, ticksInLink } from "./course_view.js";
import { announce, byId, el, passFocus, setAddress, setText } from "./dom.js";
import { isAlone, linksIn } from "./kernel.js";
import { fromFragment, hasSettings, presentSettings, toFragment } from "./settings.js";
import { known, set, settingsKnown, state, unknown, watch } from "./store.js";

export function startViews() {
  byId("view-switch").addEventListener("click", () => show(state.view === "course" ? "workbench" : "course"));
  const refuse = () => announce("Full screen is not allowed here.");
  byId("full-screen").addEventListener("click", () => {
    if (document.fullscreenElement) document.exitFullscreen();
    else if (document.fullscreenEnabled) document.documentElement.requestFullscreen().catch(refuse);
    else refuse();
  });
  document.addEventListener("fullscreenchange", () => setText(byId("full-screen"), document.fullscreenElement ? "Leave full screen" : "Full screen"));
  startLinks();
  watch("view", (view) => {
    document.body.dataset.view = view;
    setText(byId("view-switch"), view === "course" ? "Workbench" : "Course");
    byId("course").hidden = view !== "course";
  });
  set("view", viewInLink() || "course");
  // Another link in the address bar of this page, or a click on the sheet's link.
  addEventListener("hashchange", () => {
    const view = viewInLink() || (location.hash === "" ? "course" : ""); // without a fragment it is the first address
    if (!view) return; // as after the link to the arm
    const links = linksIn(location.hash);
    // Settings wait for a click, and bring their arm then.
    if (isAlone && links && links !== state.links && !hasSettings(fromFragment(location.hash))) return chooseLinks(links, location.hash);
    set("view", view);
    followLink();
    if (settingsKnown()) offer();
  });
}

/** The view that the address names; empty if it names none. @returns {"course" | "workbench" | ""} */
function viewInLink() {
  if (stepIn(location.hash) >= 0) return "course";
  // A link with settings but without a step opens the workbench.
  return hasSettings(fromFragment(location.hash)) || /(^#|&)(links|workbench)\b/.test(location.hash) ? "workbench" : "";
}

/** In the page in one file the number of links can be chosen. Another number needs another arm, so the page is reloaded. */
function startLinks() {
  if (!isAlone) return;
  byId("links-choice").hidden = false;
  watch("links", (links) => { byId("links").value = String(links); });
  byId("links").addEventListener("change", ({ target }) => chooseLinks(target.value));
}

function show(view) {
  const links = linksInLink();
  if (view === "workbench" && stepIn(location.hash) >= 0) setAddress(`#${links || "workbench"}`, "pushState");
  set("view", view);
}

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

const SHOWN_MS = 2500;

export function startShare() {
  byId("share").addEventListener("click", share);
  watch(["answered", "links"], () => { if (settingsKnown() && !wasOffered) offer(); });
}

/** The page's address with the present settings after the #. */
export function address() {
  const link = new URL(location.href);
  link.search = ""; // it may hold a token
  link.hash = stepInLink() + ticksInLink() + toFragment(/** @type {any} */ (presentSettings(state)), state.links);
  return link.href;
}

async function share() {
  const link = await known(() => presentSettings(state)) && address();
  if (link) setAddress(new URL(link).hash);
  const refused = window === parent ? "Link is in the address bar" : "Copying is not allowed here";
  const said = !link ? unknown().status : await navigator.clipboard?.writeText(link).then(() => "Link copied", () => null) ?? refused;
  setText(byId("share-text"), said);
  announce(said);
  setTimeout(() => setText(byId("share-text"), "Share"), SHOWN_MS);
}

let wasOffered = false;

function offer() {
  wasOffered = true;
  const settings = fromFragment(location.hash);
  const banner = byId("offer");
  banner.hidden = !hasSettings(settings);
  if (banner.hidden) return;
  const given = new URLSearchParams(location.hash.slice(1));
  const text = [...given].filter(([name]) => !["links", "step", "done"].includes(name)).map(([name, value]) => `${name} ${value}`).join(" · ").slice(0, 300);
  const done = () => {
    passFocus(banner);
    banner.hidden = true;
  };
  const reason = el("p", { class: "refusal" });
  banner.replaceChildren(
    el("p", {}, "This link has settings: ", el("span", { class: "offer-text" }, text)),
    el("button", { type: "button", class: "primary", onclick: async () => {
      const links = linksIn(location.hash) ?? state.links;
      if (links !== state.links && isAlone) return chooseLinks(links, location.hash);
      remember();
      const refused = links !== state.links ? needed(links) : await apply(settings);
      setText(reason, refused);
      if (!refused) done();
    } }, "Apply"),
    el("button", { type: "button", onclick: done }, "Ignore"), reason,
  );
  announce("This link has settings. Apply or ignore them.");
}
