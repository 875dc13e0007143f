// Compares 16 runs of the kernel in the page and 14 answers of it with native ones, to the bit: `runs.mjs NATIVE.txt pendularm.html`.

import { readFileSync } from "node:fs";

import { unpack } from "../../page/packed.js";

const [native, page] = process.argv.slice(2).map((name) => readFileSync(name, "utf8"));
const carried = /id="kernel-module">([^<]*)</.exec(page)[1];
const environment = { env: { milliseconds: () => performance.now() } };
const { instance } = await WebAssembly.instantiate(await unpack(carried), environment);
const { memory, compare, output } = instance.exports;
const length = compare();
const ours = Buffer.from(memory.buffer, output(), length).toString();
const lines = native.trim().split("\n").length;
if (lines !== 30 || ours !== native) {
  console.error(`${lines} native lines:\n${native}\nthe kernel's:\n${ours}`);
  process.exit(1);
}
console.log("16 runs and 14 answers of the kernel have the bits of the native ones");
