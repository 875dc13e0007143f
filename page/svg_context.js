// @ts-check
// The part of a canvas's context that the plots use, written down as an SVG file.
// Invariant: a drawing is text of ours and numbers; texts are escaped.

const ESCAPES = /** @type {Record<string, string>} */ ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" });

/** @param {...number} values */
function short(...values) {
  return values.map((value) => String(Math.round(value * 100) / 100)).join(" ");
}

export class SvgContext {
  strokeStyle = "#000";
  fillStyle = "#000";
  lineWidth = 1;
  globalAlpha = 1;
  font = "11px sans-serif";
  textAlign = "left";
  textBaseline = "alphabetic";
  lineJoin = "miter";
  dash = /** @type {number[]} */ ([]);
  path = "";
  parts = /** @type {string[]} */ ([]);
  /** Groups that were open at each save. @type {number[]} */
  saves = [];
  open = 0;
  clips = 0;

  /** @param {number} width @param {number} height @param {string} background */
  constructor(width, height, background) {
    this.size = `width="${short(width)}" height="${short(height)}"`;
    this.parts.push(`<rect ${this.size} fill="${background}"/>`);
  }

  save() {
    this.saves.push(this.open);
  }

  restore() {
    const open = this.saves.pop() ?? 0;
    for (; this.open > open; this.open -= 1) this.parts.push("</g>");
  }

  /** @param {string} attributes */
  group(attributes) {
    this.parts.push(`<g ${attributes}>`);
    this.open += 1;
  }

  /** @param {number} x @param {number} y */
  translate(x, y) {
    this.group(`transform="translate(${short(x, y)})"`);
  }

  clip() {
    this.clips += 1;
    this.parts.push(`<clipPath id="clip${this.clips}"><path d="${this.path}"/></clipPath>`);
    this.group(`clip-path="url(#clip${this.clips})"`);
  }

  /** @param {number[]} dash */
  setLineDash(dash) {
    this.dash = dash;
  }

  beginPath() {
    this.path = "";
  }

  /** @param {number} x @param {number} y */
  moveTo(x, y) {
    this.path += `M${short(x, y)}`;
  }

  /** As a canvas does, it begins a path where there is none. @param {number} x @param {number} y */
  lineTo(x, y) {
    this.path += `${this.path ? "L" : "M"}${short(x, y)}`;
  }

  /** @param {number} x @param {number} y @param {number} width @param {number} height */
  rect(x, y, width, height) {
    this.path += `M${short(x, y)}h${short(width)}v${short(height)}h${short(-width)}Z`;
  }

  /** A whole circle; the plots draw no others. @param {number} x @param {number} y @param {number} radius */
  arc(x, y, radius) {
    this.path += `M${short(x - radius, y)}a${short(radius, radius)} 0 1 0 ${short(2 * radius)} 0a${short(radius, radius)} 0 1 0 ${short(-2 * radius)} 0Z`;
  }

  stroke() {
    const dash = this.dash.length > 0 ? ` stroke-dasharray="${this.dash.join(" ")}"` : "";
    this.parts.push(`<path d="${this.path}" fill="none" stroke="${this.strokeStyle}" stroke-width="${this.lineWidth}" opacity="${this.globalAlpha}"${dash}/>`);
  }

  fill() {
    this.parts.push(`<path d="${this.path}" fill="${this.fillStyle}" opacity="${this.globalAlpha}"/>`);
  }

  /** @param {string} text @param {number} x @param {number} y */
  fillText(text, x, y) {
    const anchor = { center: "middle", right: "end" }[this.textAlign] ?? "start";
    const lift = this.textBaseline === "middle" ? 4 : 0;
    const escaped = text.replace(/[&<>"]/g, (one) => ESCAPES[one]);
    this.parts.push(`<text x="${short(x)}" y="${short(y + lift)}" text-anchor="${anchor}" fill="${this.fillStyle}" style="font:${this.font}">${escaped}</text>`);
  }

  /** The file. */
  toString() {
    return `<svg xmlns="http://www.w3.org/2000/svg" ${this.size}>${this.parts.join("")}</svg>\n`;
  }
}
