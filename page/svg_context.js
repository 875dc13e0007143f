// @ts-check
// The part of a canvas's context that the plots use, written down as an SVG file.
// Invariant: a drawing is text of ours and numbers; texts are escaped.

const ESCAPES = /** @type {Record<string, string>} */ ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" });

/** @param {string} text */
function escaped(text) {
  return text.replace(/[&<>"]/g, (one) => ESCAPES[one]);
}

/** @param {number} value */
function short(value) {
  return String(Math.round(value * 100) / 100);
}

export class SvgContext {
  /** @param {number} width @param {number} height @param {string} background */
  constructor(width, height, background) {
    this.width = width;
    this.height = height;
    /** @type {string[]} */
    this.parts = [`<rect width="${short(width)}" height="${short(height)}" fill="${background}"/>`];
    this.strokeStyle = "#000";
    this.fillStyle = "#000";
    this.lineWidth = 1;
    this.globalAlpha = 1;
    this.font = "11px sans-serif";
    this.textAlign = "left";
    this.textBaseline = "alphabetic";
    this.lineJoin = "miter";
    this.lineCap = "butt";
    /** @type {number[]} */
    this.dash = [];
    this.path = "";
    /** @type {number[]} groups that were open at each save */
    this.saves = [];
    this.open = 0;
    this.clips = 0;
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
    this.group(`transform="translate(${short(x)} ${short(y)})"`);
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
    this.path += `M${short(x)} ${short(y)}`;
  }

  /** @param {number} x @param {number} y */
  lineTo(x, y) {
    this.path += `L${short(x)} ${short(y)}`;
  }

  /** @param {number} a @param {number} b @param {number} c @param {number} d @param {number} x @param {number} y */
  bezierCurveTo(a, b, c, d, x, y) {
    this.path += `C${[a, b, c, d, x, y].map(short).join(" ")}`;
  }

  /** @param {number} x @param {number} y @param {number} width @param {number} height */
  rect(x, y, width, height) {
    this.path += `M${short(x)} ${short(y)}h${short(width)}v${short(height)}h${short(-width)}Z`;
  }

  /** A whole circle; the plots draw no others. @param {number} x @param {number} y @param {number} radius */
  arc(x, y, radius) {
    const r = short(radius);
    this.path += `M${short(x - radius)} ${short(y)}a${r} ${r} 0 1 0 ${short(2 * radius)} 0a${r} ${r} 0 1 0 ${short(-2 * radius)} 0Z`;
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
    this.parts.push(`<text x="${short(x)}" y="${short(y + lift)}" text-anchor="${anchor}" fill="${this.fillStyle}" style="font:${this.font}">${escaped(text)}</text>`);
  }

  /** The file. */
  toString() {
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${short(this.width)}" height="${short(this.height)}">${this.parts.join("")}</svg>\n`;
  }
}
