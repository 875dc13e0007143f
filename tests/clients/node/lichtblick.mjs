// The parts of Lichtblick's rosbridge connection, unmodified: its client, its parser, its CDR reader.
import { createRequire } from "node:module";
import { check, run, url, within } from "./common.mjs";

const require = createRequire(import.meta.url);
globalThis.WebSocket ??= require("ws");
const ROSLIB = require("@lichtblick/roslibjs");
const { parse } = require("@lichtblick/rosmsg");
const { MessageReader } = require("@lichtblick/rosmsg2-serialization");

function call(ros, name, request) {
  const service = new ROSLIB.Service({ ros, name, serviceType: "" });
  return within(name, (ok, no) => service.callService(request, ok, no));
}

run("Lichtblick", async () => {
  const ros = new ROSLIB.Ros({ url });
  await within("the connection", (resolve, reject) => {
    ros.on("connection", resolve);
    ros.on("error", reject);
  });
  const all = await within("types", (ok, no) => ros.getTopicsAndRawTypes(ok, no));
  check(all.types.includes("rcl_interfaces/msg/Log"), "what tells it that this is ROS 2");
  const readers = new Map();
  all.topics.forEach((topic, index) => {
    const text = all.typedefs_full_text[index];
    check(text !== "", `the definition of ${topic}`);
    readers.set(topic, new MessageReader(parse(text, { ros2: true })));
  });
  for (const node of await within("nodes", (ok, no) => ros.getNodes(ok, no))) {
    await within(node, (ok, no) => ros.getNodeDetails(node, (...details) => ok(details), no));
  }

  await call(ros, "/arm_sim/pause", { data: true });
  const read = async (topic) => {
    const one = new ROSLIB.Topic({ ros, name: topic, compression: "cbor-raw" });
    const message = await within(topic, (resolve) => one.subscribe(resolve));
    one.unsubscribe();
    return readers.get(topic).readMessage(new Uint8Array(message.bytes));
  };
  const state = await read("/joint_states");
  check(state.name.join() === "joint1,joint2" && state.position.length === 2, "a state");
  check(state.header.frame_id === "world", "its frame");
  const health = await read("/diagnostics");
  check(health.status[0].message === "paused" && health.status[0].values.length > 3, "diagnostics");
  const frames = await read("/tf");
  check(frames.transforms[1].child_frame_id === "link2", "frames");
  check((await read("/tf_static")).transforms[0].child_frame_id === "hand", "the fixed frame");
  check((await read("/robot_description")).data.startsWith("<?xml"), "the description");
  check((await read("/clock")).clock !== undefined, "the clock");

  await call(ros, "/arm_sim/pause", { data: false });
  await call(ros, "/pid_controller/enable", { data: true });
  const publisher = new ROSLIB.Topic({ ros, name: "/joint_trajectory", messageType: "trajectory_msgs/msg/JointTrajectory" });
  publisher.publish({ points: [{ positions: [0.2, 0.3] }] });
  const result = read("/ik_action/result");
  const { goal_id } = await call(ros, "/ik_action/send_goal", { x: 0.5, y: 1.2 });
  const end = await result;
  check(end.goal_id === goal_id && end.outcome === "reached", "reached");
});
