// The settings in the page's address, behind the #, to be sent to others.
// Invariant: opening an address changes nothing; its settings wait for a click. Any page can link here, and a link must not
// be able to drive the arm.

import { announce } from "./announce.js";
import { byId, el, setText } from "./dom.js";
import { plain } from "./format.js";
import { enable, sendSetpoint, setGains, setIntegrator, setParams } from "./runtime.js";
import { state, watch } from "./store.js";

const METHOD = /^(euler|midpoint|verlet|rk4)$/;
const SHOWN_MS = 2500;

export function startShare() {
  byId("share").addEventListener("click", share);
  if (location.hash.length > 1) watch("params", offer);
}

function list(values) {
  return values.map(plain).join(",");
}

/** The page's address with the present settings behind the #. */
export function address() {
  const { integrator, params, gains } = state;
  const parts = [
    ["links", state.links], ["method", integrator.method], ["timestep", plain(integrator.timestep)], ["gravity", plain(params.gravity)],
    ["masses", list(params.masses)], ["lengths", list(params.lengths)],
    ["kp", list(gains.kp)], ["ki", list(gains.ki)], ["kd", list(gains.kd)], ["servo", state.enabled ? "on" : "off"],
  ];
  if (state.setpointKnown) parts.push(["setpoint", list(Array.from(state.setpoint.subarray(0, state.links)))]);
  const link = new URL(location.href);
  link.search = ""; // it may hold a token
  link.hash = parts.map(([name, value]) => `${name}=${value}`).join("&");
  return link.href;
}

async function share() {
  if (!state.integrator || !state.params || !state.gains) return;
  const link = address();
  history.replaceState(null, "", new URL(link).hash);
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

/** What an address holds, as requests; unknown parts are left out, wrong values are left to the runtime to refuse. */
export function parse(hash) {
  const given = new URLSearchParams(hash.replace(/^#/, ""));
  const numbers = (name) => given.get(name)?.split(",").map(Number);
  const pick = (names, read) => {
    const found = names.map((name) => [name, read(name)]).filter(([, value]) => value !== undefined);
    return found.length > 0 ? Object.fromEntries(found) : null;
  };
  const single = (name) => (given.has(name) ? Number(given.get(name)) : undefined);
  const method = given.get("method") ?? undefined;
  return {
    integrator: pick(["method", "timestep"], (name) => (name === "method" ? (METHOD.test(method) ? method : undefined) : single(name))),
    params: pick(["gravity", "masses", "lengths"], (name) => (name === "gravity" ? single(name) : numbers(name))),
    gains: pick(["kp", "ki", "kd"], numbers),
    servo: given.has("servo") ? given.get("servo") === "on" : null,
    setpoint: numbers("setpoint") ?? null,
  };
}

let offered = false;

function offer() {
  if (offered) return;
  offered = true;
  const settings = parse(location.hash);
  if (!Object.values(settings).some((one) => one !== null)) return;
  const banner = byId("offer");
  const given = new URLSearchParams(location.hash.slice(1));
  const text = [...given].filter(([name]) => name !== "links").map(([name, value]) => `${name} ${value}`).join(" · ").slice(0, 300);
  const done = () => { banner.hidden = true; };
  const refused = el("p", { class: "refusal" });
  banner.replaceChildren(
    el("p", {}, "This link brings settings: ", el("span", { class: "offer-text" }, text)),
    el("button", { type: "button", class: "primary", onclick: async () => {
      const refusals = await apply(settings);
      setText(refused, refusals.join(" "));
      if (refusals.length === 0) done();
    } }, "Apply"),
    el("button", { type: "button", onclick: done }, "Ignore"), refused,
  );
  banner.hidden = false;
  announce("This link brings settings. Apply or ignore them.");
}

async function apply({ integrator, params, gains, servo, setpoint }) {
  const answers = [];
  if (params) answers.push(await setParams(params));
  if (gains) answers.push(await setGains(gains));
  if (integrator) answers.push(await setIntegrator(integrator));
  if (setpoint) sendSetpoint(setpoint);
  if (servo !== null) answers.push(await enable(servo));
  return answers.filter((answer) => !answer.result).map((answer) => answer.status);
}
