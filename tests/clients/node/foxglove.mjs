// @foxglove/roslibjs, unmodified: the client in the rosbridge connection of Foxglove Studio 1.
import { createRequire } from "node:module";
import { check, run, url, within } from "./common.mjs";

const require = createRequire(import.meta.url);
globalThis.WebSocket ??= require("ws");
const ROSLIB = require("@foxglove/roslibjs");
const { parse } = require("@lichtblick/rosmsg");
const { MessageReader } = require("@lichtblick/rosmsg2-serialization");

run("@foxglove/roslibjs", async () => {
  const ros = new ROSLIB.Ros({ url });
  await within("the connection", (resolve, reject) => {
    ros.on("connection", resolve);
    ros.on("error", reject);
  });
  const all = await within("types", (ok, no) => ros.getTopicsAndRawTypes(ok, no));
  const text = all.typedefs_full_text[all.topics.indexOf("/joint_states")];
  const reader = new MessageReader(parse(text, { ros2: true }));
  const states = new ROSLIB.Topic({ ros, name: "/joint_states", messageType: "sensor_msgs/msg/JointState", compression: "cbor-raw" });
  let count = 0;
  const last = await within("thirty states", (resolve) => {
    states.subscribe((message) => {
      count += 1;
      if (count === 30) resolve(reader.readMessage(new Uint8Array(message.bytes)));
    });
  });
  states.unsubscribe();
  check(last.name.join() === "joint1,joint2" && last.position.length === 2, "a state");

  const call = (name, request) => {
    const service = new ROSLIB.Service({ ros, name, serviceType: "" });
    return within(name, (ok, no) => service.callService(request, ok, no));
  };
  check((await call("/pid_controller/enable", { data: true })).data === true, "the controller is on");
  const why = await call("/ik/solve", { x: 9, y: 9 }).catch((error) => error);
  check(String(why).includes("beyond"), `the words of a refusal: ${why}`);
  const gravity = new ROSLIB.Param({ ros, name: "gravity" });
  check((await within("a parameter", (resolve) => gravity.get(resolve))) === 9.81, "gravity");
  const setpoints = new ROSLIB.Topic({ ros, name: "/joint_trajectory", messageType: "trajectory_msgs/msg/JointTrajectory" });
  const seen = new ROSLIB.Topic({ ros, name: "/joint_trajectory", messageType: "trajectory_msgs/msg/JointTrajectory" });
  const own = within("its own setpoint", (resolve) => seen.subscribe(resolve));
  setpoints.publish({ points: [{ positions: [0.2, 0.3] }] });
  check((await own).points[0].positions[1] === 0.3, "the setpoint");
});
