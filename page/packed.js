// Text that carries a file in the page in one file: gzip in base 85, which is a sixteenth shorter than base64.
// Invariant: `scripts/page.py` writes it. Its digits are the characters from "(" to "}" without "<", so it ends no script.

/** @param {string} text @returns {Promise<ArrayBuffer>} the file */
export async function unpack(text) {
  const digit = (/** @type {number} */ code) => (Number.isNaN(code) ? 84 : code - 40 - Number(code > 60)); // beyond the end the largest one
  const words = new DataView(new ArrayBuffer(4 * Math.ceil(text.length / 5)));
  for (let word = 0; 5 * word < text.length; word += 1) {
    let value = 0;
    for (let k = 0; k < 5; k += 1) value = 85 * value + digit(text.charCodeAt(5 * word + k));
    words.setUint32(4 * word, value);
  }
  const packed = new Uint8Array(words.buffer, 0, Math.floor((4 * text.length) / 5));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}
