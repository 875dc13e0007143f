// Makes elements from code, and says aloud to screen readers what others see happen: goals reached, refusals, a lost connection.
// Text is always text, never markup, whatever the runtime sends.
// Invariant: neither `innerHTML` nor a style attribute; the page's policy forbids what they would need. Only events are said aloud:
// values that change all the time are in texts that are read when asked for.

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

/** Fills a table: a row of heads, then rows that begin with a head of their own; a head is its text, or its text and its class. */
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

/** Gives the page this address; within another page it may have none of its own. @param {string | URL} address */
export function setAddress(address) {
  try {
    history.replaceState(history.state, "", address);
  } catch {
    // then it stays as it is
  }
}

/** Writes text only where it differs: most readouts stay as they are from one time to the next. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** The same for an attribute, `class` among them. */
export function setAttribute(element, name, text) {
  if (element.getAttribute(name) !== text) element.setAttribute(name, text);
}

/** A choice that outlives the page; null where there is none, or where storage is forbidden. @param {string} key @returns {string | null} */
export function remembered(key) {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

/** Keeps a choice; where storage is forbidden it lasts as long as the page. @param {string} key @param {string} choice */
export function keepChoice(key, choice) {
  try {
    localStorage.setItem(key, choice);
  } catch {
    // then the page alone knows it
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
  // Emptied first, since a region that does not change is not read again.
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
