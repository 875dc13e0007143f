// Creates elements from code, and announces events to screen readers: reached goals, refusals, a lost connection. Text from the
// runtime is always text, never markup.
// Invariant: there is no `innerHTML` and no style attribute, because the page's policy forbids them. Only events are announced.
// Values that change continuously are in texts that are read on request.

/** `el("p", { class: "note" }, "text", child)`; `on...` properties are listeners. */
/** @returns {any} */
export function el(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** Fills a table: a row of heads, then rows that begin with their own head. A head is its text, or its text and its class. */
export function fillTable(table, heads, rows) {
  const head = (scope, one) => el("th", { scope, class: [one].flat()[1] }, [one].flat()[0]);
  table.replaceChildren(
    el("thead", {}, el("tr", {}, ...heads.map((one) => head("col", one)))),
    el("tbody", {}, ...rows.map(([first, ...cells]) => el("tr", {}, head("row", first), ...cells.map((text) => el("td", {}, text))))),
  );
}

/** @param {string} id @returns {any} the element, of whatever kind the document has it */
export function byId(id) {
  return document.getElementById(id);
}

/**
 * Sets the page's address. Inside a frame this may be forbidden. With "pushState" it is a new entry of the history, so that the browser's Back leads to
 * the present one. @param {string | URL} address @param {"replaceState" | "pushState"} [how]
 */
export function setAddress(address, how = "replaceState") {
  try {
    history[how](history.state, "", address);
  } catch {
    // then it does not change
  }
}

/** Call this before `place` disappears or is disabled: if the focus is in it, it moves to `next`, and not to the start of the page. */
export function passFocus(place, next = byId("arm")) {
  if (place.contains(document.activeElement)) next.focus({ preventScroll: true });
}

/** Writes text only if it differs, because most readouts rarely change. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** The same for an attribute, including `class`. */
export function setAttribute(element, name, text) {
  if (element.getAttribute(name) !== text) element.setAttribute(name, text);
}

/** A stored choice; null if there is none, or if storage is forbidden. @param {string} key @returns {string | null} */
export function remembered(key) {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

/** Stores a choice. If storage is forbidden, it lasts as long as the page. @param {string} key @param {string} choice */
export function keepChoice(key, choice) {
  try {
    localStorage.setItem(key, choice);
  } catch {
    // then only the page has it
  }
}

const REPEAT_MS = 3000;
let lastText = "";
let lastTime = -Infinity;

function say(id, text) {
  const now = performance.now();
  if (text === lastText && now - lastTime < REPEAT_MS) return; // a drag may be refused many times a second
  lastText = text;
  lastTime = now;
  const region = byId(id);
  // Emptied first, because screen readers do not repeat an unchanged region.
  region.textContent = "";
  requestAnimationFrame(() => {
    region.textContent = text;
  });
}

export function announce(text) {
  say("announce-polite", text);
}

export function warn(text) {
  say("announce-assertive", text);
}
