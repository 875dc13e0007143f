// Numbers for people: few digits, a true minus, powers of ten for very large and very small numbers.
// Invariant: a value that is not finite is shown as a dash.

const MINUS = "\u2212";
const MOST_DIGITS = 5; // most digits of a number in a caption

/** @param {number} value @param {number} digits */
export function fixed(value, digits) {
  if (!Number.isFinite(value)) return "–";
  if (Math.abs(value) >= 1e6) return significant(value, 3);
  const text = value.toFixed(digits);
  return text.startsWith("-") ? (Number(text) === 0 ? text.slice(1) : MINUS + text.slice(1)) : text;
}

/** These digits after the point, or fewer if space is small. @param {number} value @param {number} digits */
export function short(value, digits) {
  const before = Math.max(1, Math.floor(Math.log10(Math.abs(value))) + 1);
  return fixed(value, Number.isFinite(before) ? Math.max(0, Math.min(digits, MOST_DIGITS - before)) : digits);
}

/** @param {number} value @param {number} digits */
export function significant(value, digits) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) {
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
    return `${Number(mantissa)}e${Number(exponent)}`.replace(/-/g, MINUS);
  }
  return String(Number(value.toPrecision(digits))).replace("-", MINUS);
}

/** Seconds in the unit that suits them: 500 µs, 4.2 ms, 1 s. @param {number} seconds */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const size = Math.abs(seconds);
  if (size === 0 || size >= 1) return `${significant(seconds, 3)} s`;
  if (size >= 1e-3) return `${significant(seconds * 1e3, 3)} ms`;
  if (size >= 1e-6) return `${significant(seconds * 1e6, 3)} µs`;
  if (size < 1e-10) return "less than 0.1 ns";
  return `${significant(seconds * 1e9, 3)} ns`;
}

/** @type {Record<string, string>} */
const SINGULAR = { masses: "mass", lengths: "length" };
/** Fields with another name on the page. @type {Record<string, string>} */
const SHOWN = { data: "controller", effort: "torque", epsilon: "tolerance", period: "control period", phi: "orientation", success_hold: "hold",
  mass_matrix: "M" };

/** A refusal with the page's names: "mass 1 must be a number", not "params.masses[0] must be a number, got null". @param {string} status */
export function inPageNames(status) {
  return status.replace(/\b(?:gains|params)\./g, "").replace(/\[(\d+)\]\[(\d+)\]/g, (_, i, j) => ` at row ${Number(i) + 1}, column ${Number(j) + 1}`)
    .replace(/\b(\w+)\[(\d+)\]/g, (_, name, i) => `${SINGULAR[name] ?? name} ${Number(i) + 1}`)
    .replace(/(^|; )(\w+)/g, (_, before, name) => before + (SHOWN[name] ?? name))
    .replace(/must be true or false/g, "must be on or off").replace(/, got null(?=;|$)/g, "");
}

/** A number for an input field: four digits, with an integer exponent. @param {number} value */
export function plain(value) {
  return Number.isFinite(value) ? String(Number(value.toPrecision(4))) : "";
}

/** A time near `value` that divides `whole`. Refused values are left to the runtime. @param {number} value @param {number} whole */
export function partOf(whole, value) {
  return value > 0 && whole > 0 ? Number((whole / Math.max(1, Math.round(whole / value))).toPrecision(9)) : value;
}

/** The multiple of `unit` nearest to `value`, at least one. @param {number} value @param {number} unit */
export function multipleOf(unit, value) {
  return value > 0 && unit > 0 ? Number((unit * Math.max(1, Math.round(value / unit))).toPrecision(9)) : value;
}

/** Milliseconds as seconds, without rounding digits of the division. @param {number} ms */
export function seconds(ms) {
  return Number((ms / 1e3).toPrecision(15));
}

/** A number with all its digits, for links and files; empty if it is not finite. @param {number} value */
export function exact(value) {
  return Number.isFinite(value) ? String(value) : "";
}

/** The integrators in the order of their keys: name, full name, order as a Runge-Kutta method; Verlet is none. @type {[string, string, number?][]} */
export const METHODS = [["euler", "Euler", 1], ["midpoint", "Midpoint", 2], ["verlet", "Verlet"], ["rk4", "Runge–Kutta 4", 4]];

/** The short name, for small spaces. @param {string | undefined} method */
export function shortName(method) {
  return methodName(method).replace("Runge–Kutta 4", "RK 4");
}

/** @param {string | undefined} method */
export function methodName(method) {
  return METHODS.find(([name]) => name === method)?.[1] ?? method ?? "–";
}
