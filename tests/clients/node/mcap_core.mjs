// @mcap/core, unmodified, on records of the built program: `mcap_core.mjs WHOLE KILLED`. One is complete and has its
// index. The other is from a killed program. The first is also truncated in many places.
import { open, readFile } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { check, run } from "./common.mjs";
import { createRequire } from "node:module";

const require = createRequire(import.meta.url);
const { parse } = require("@lichtblick/rosmsg");
const { MessageReader } = require("@lichtblick/rosmsg2-serialization");

const [whole, killed] = process.argv.slice(2);
/** Places in which the record is cut; a prime, so that they lie anywhere in a chunk. */
const CUTS = 97;

/** Reads messages by the definitions in the file. */
function decoder() {
  const schemas = new Map();
  const channels = new Map();
  return (record) => {
    if (record.type === "Schema") schemas.set(record.id, new TextDecoder().decode(record.data));
    if (record.type === "Channel") {
      const text = schemas.get(record.schemaId);
      channels.set(record.id, { topic: record.topic, reader: new MessageReader(parse(text, { ros2: true })) });
    }
    if (record.type !== "Message") return undefined;
    const { topic, reader } = channels.get(record.channelId);
    return { topic, time: record.logTime, message: reader.readMessage(record.data) };
  };
}

/** The messages of a stream of bytes, as far as they go. */
function stream(bytes) {
  const reader = new McapStreamReader();
  reader.append(bytes);
  const decode = decoder();
  const messages = [];
  for (let record = reader.nextRecord(); record; record = reader.nextRecord()) {
    const message = decode(record);
    if (message) messages.push(message);
  }
  return { messages, done: reader.done() };
}

/** The same by the index at the end of the file, in order of time. */
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
  const decode = decoder();
  for (const schema of reader.schemasById.values()) decode(schema);
  for (const channel of reader.channelsById.values()) decode(channel);
  const messages = [];
  for await (const record of reader.readMessages()) messages.push(decode(record));
  await file.close();
  return { messages, count: reader.statistics.messageCount, profile: reader.header.profile };
}

run("@mcap/core", async () => {
  const { messages, count, profile } = await indexed(whole);
  check(profile === "ros2" && BigInt(messages.length) === count && count > 100n, "as many messages as its index says");
  const state = messages.find(({ topic }) => topic === "/joint_states").message;
  check(state.name.join() === "joint1,joint2" && state.position instanceof Float64Array, "a state");
  check(messages.some(({ topic, message }) => topic === "/recorder/inputs" && message.input.startsWith('{"begin"')), "how it began");

  const bytes = await readFile(whole);
  const all = stream(bytes);
  check(all.done && all.messages.length === messages.length, "the same from front to back");
  let longest = 0;
  for (let cut = 1; cut < CUTS; cut += 1) {
    const part = stream(bytes.subarray(0, Math.floor((bytes.length * cut) / CUTS)));
    check(!part.done && part.messages.length >= longest && part.messages.length <= messages.length, `a cut, ${cut} of ${CUTS}`);
    longest = part.messages.length;
  }
  check(longest > messages.length / 2, `most of it, cut near its end: ${longest} of ${messages.length}`);
  const left = stream(await readFile(killed));
  check(left.messages.some(({ topic }) => topic === "/recorder/calls"), "the record of a killed program");
});
