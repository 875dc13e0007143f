// @mcap/core, unmodified, on records of the built program: `mcap_core.mjs WHOLE KILLED`. One is complete and has its
// index. The other is from a killed program.
import { open, readFile } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { check, run } from "./common.mjs";
import { createRequire } from "node:module";

const require = createRequire(import.meta.url);
const { parse } = require("@lichtblick/rosmsg");
const { MessageReader } = require("@lichtblick/rosmsg2-serialization");

const [whole, killed] = process.argv.slice(2);

/** By the index at the end of the file; the first state is read by the definition in the file. */
async function indexed(path) {
  const file = await open(path);
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const bytes = new Uint8Array(Number(length));
      await file.read(bytes, 0, bytes.length, Number(offset));
      return bytes;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const channel = [...reader.channelsById.values()].find(({ topic }) => topic === "/joint_states");
  const text = new TextDecoder().decode(reader.schemasById.get(channel.schemaId).data);
  const states = new MessageReader(parse(text, { ros2: true }));
  let [count, state] = [0n, undefined];
  for await (const message of reader.readMessages()) {
    count += 1n;
    if (message.channelId === channel.id) state ??= states.readMessage(message.data);
  }
  await file.close();
  check(reader.header.profile === "ros2" && count === reader.statistics.messageCount, "as many messages as its index says");
  check(state.name.join() === "joint1,joint2" && state.position instanceof Float64Array, "a state");
  return count;
}

/** The messages from front to back, as far as they go. */
async function stream(path) {
  const reader = new McapStreamReader();
  reader.append(await readFile(path));
  let count = 0n;
  for (let record = reader.nextRecord(); record; record = reader.nextRecord()) count += record.type === "Message" ? 1n : 0n;
  return { count, done: reader.done() };
}

run("@mcap/core", async () => {
  const all = await stream(whole);
  check(all.done && all.count === (await indexed(whole)), "the same from front to back");
  const left = await stream(killed);
  check(!left.done && left.count > 100n, "the record of a killed program");
});
