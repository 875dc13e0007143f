// The parts of Lichtblick's rosbridge connection, unmodified: its client, its parser, its CDR reader. Then the client that it was forked
// from, which is in the rosbridge connection of Foxglove Studio 1.
import { createRequire } from "node:module";
import { check, connected, run, session, url, within } from "./common.mjs";

const require = createRequire(import.meta.url);
globalThis.WebSocket ??= require("ws");
const { parse } = require("@lichtblick/rosmsg");
const { MessageReader } = require("@lichtblick/rosmsg2-serialization");

async function connection(ROSLIB) {
  const ros = await connected(new ROSLIB.Ros({ url }));
  await session(ROSLIB, ros);
  const all = await within("types", (ok, no) => ros.getTopicsAndRawTypes(ok, no));
  check(all.types.includes("rcl_interfaces/msg/Log"), "what tells it that this is ROS 2");
  const readers = new Map(all.topics.map((topic, index) => {
    const text = all.typedefs_full_text[index];
    check(text !== "", `the definition of ${topic}`);
    return [topic, new MessageReader(parse(text, { ros2: true }))];
  }));
  const read = async (topic) => {
    const one = new ROSLIB.Topic({ ros, name: topic, compression: "cbor-raw" });
    const message = await within(topic, (resolve) => one.subscribe(resolve));
    one.unsubscribe();
    return readers.get(topic).readMessage(new Uint8Array(message.bytes));
  };
  check((await read("/joint_states")).name.join() === "joint1,joint2", "a state");
  check((await read("/diagnostics")).status[0].values.length > 3, "diagnostics");
  check((await read("/tf")).transforms[1].child_frame_id === "link2", "frames");
  check((await read("/robot_description")).data.startsWith("<?xml"), "the description");
  return ros;
}

run("Lichtblick", async () => {
  const ros = await connection(require("@lichtblick/roslibjs"));
  for (const node of await within("nodes", (ok, no) => ros.getNodes(ok, no))) {
    await within(node, (ok, no) => ros.getNodeDetails(node, (...details) => ok(details), no));
  }
  await connection(require("@foxglove/roslibjs"));
});
