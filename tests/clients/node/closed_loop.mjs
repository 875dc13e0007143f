// The JavaScript of docs/protocol.md that closes a loop of its own, unchanged except for the address. Two runs give the
// same bits.
import { readFile } from "node:fs/promises";
import { WebSocket } from "ws";
import { check, run, url } from "./common.mjs";

// Node has one of its own from version 22 on.
globalThis.WebSocket ??= WebSocket;

async function printed(code) {
  const [log, lines] = [console.log, []];
  console.log = (line) => lines.push(line);
  try {
    await import(`data:text/javascript,${encodeURIComponent(code)}`);
  } finally {
    console.log = log;
  }
  return lines.join("\n");
}

run("a loop of one's own", async () => {
  const manual = await readFile(new URL("../../../docs/protocol.md", import.meta.url), "utf8");
  const [, block] = /```js\n(.*?)```/s.exec(manual);
  const code = block.replace("ws://127.0.0.1:9095", url);
  check(code !== block, "the address is in the code");
  const first = await printed(code);
  const [time, position] = JSON.parse(first);
  check(time === 4, `4 s: ${first}`);
  check(Math.hypot(position[0] - 0.8, position[1] + 0.6) < 1e-3, `the arm is there: ${first}`);
  // A module is run once per address.
  check((await printed(`${code}\n`)) === first, "the same bits");
});
