// Compares the page's verdict on submissions with the program's, also with one changed digit: `scores.mjs PROGRAM pendularm.html SUBMISSIONS.jsonl`.

import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

const [program, page, list] = process.argv.slice(2).map((name) => resolve(name));
const carried = /id="kernel-module">[^<]*</.exec(readFileSync(page, "utf8"))[0].slice(19, -1);
globalThis.document = { querySelector: () => ({ textContent: carried }) };
const { score } = await import("../../page/kernel.js");

const changed = (digit) => (digit === "0" ? "1" : "0");
const submissions = readFileSync(list, "utf8").trim().split("\n").flatMap((line, k) => {
  const wrong = JSON.parse(line);
  const row = k % wrong.trail.length;
  wrong.trail[row] = wrong.trail[row].slice(0, -1) + changed(wrong.trail[row].at(-1));
  return [line, JSON.stringify(wrong)];
});
const folder = mkdtempSync(join(tmpdir(), "pendularm-scores-"));
const names = submissions.map((text, k) => {
  writeFileSync(join(folder, `${k}.json`), text);
  return `${k}.json`;
});
const { stdout, stderr } = spawnSync(program, ["score", ...names], { cwd: folder, encoding: "utf8", maxBuffer: 1 << 26 });
rmSync(folder, { recursive: true });
const said = new Map(`${stdout}${stderr}`.trim().split("\n").map((line) => line.replace(/^pendularm: /, "").split(/(?<=^\d+\.json): /)));
for (const [k, text] of submissions.entries()) {
  const [words, poses] = await score(new TextEncoder().encode(text).buffer);
  if (words !== said.get(names[k]) || Boolean(poses) !== words.endsWith(": confirmed")) {
    console.error(`${text.slice(0, 80)}: the page says ${words}, the program ${said.get(names[k])}`);
    process.exit(1);
  }
}
console.log(`${submissions.length} submissions, every second one with a changed digit, have the program's verdicts`);
