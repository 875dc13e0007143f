// roslib 1.x, unmodified: over WebSocket, and over its raw TCP, there with calls one at a time.
import ROSLIB from "roslib1";
import { address, check, run, url, within } from "./common.mjs";

function connect(options) {
  const ros = new ROSLIB.Ros(options);
  return within("the connection", (resolve, reject) => {
    ros.on("connection", () => resolve(ros));
    ros.on("error", reject);
  });
}

function call(ros, name, request) {
  const service = new ROSLIB.Service({ ros, name, serviceType: "x/Y" });
  return within(name, (ok, no) => service.callService(new ROSLIB.ServiceRequest(request), ok, no));
}

async function overWebSocket() {
  const ros = await connect({ url });
  const { topics, types } = await within("topics", (ok, no) => ros.getTopics(ok, no));
  check(types[topics.indexOf("/joint_states")] === "sensor_msgs/msg/JointState", "the type of /joint_states");
  const details = await within("details", (ok, no) => ros.getMessageDetails("sensor_msgs/JointState", ok, no));
  check(ros.decodeTypeDefs(details).header !== undefined, "decoded details");
  const urdf = new ROSLIB.Param({ ros, name: "robot_description" });
  check((await within("the description", (ok) => urdf.get(ok))).startsWith("<?xml"), "URDF");
  const none = new ROSLIB.Param({ ros, name: "/none" });
  check((await within("no parameter", (ok) => none.get(ok))) === "", "an absent parameter is empty");

  const states = new ROSLIB.Topic({ ros, name: "/joint_states", messageType: "sensor_msgs/JointState" });
  const state = await within("a state", (resolve) => states.subscribe(resolve));
  check(state.name.length === 2, "two joints");
  states.unsubscribe();
  const packed = new ROSLIB.Topic({ ros, name: "/clock", messageType: "rosgraph_msgs/Clock", compression: "cbor" });
  check((await within("CBOR", (resolve) => packed.subscribe(resolve))).clock.sec >= 0, "the clock in CBOR");
  packed.unsubscribe();

  check((await call(ros, "/pid_controller/enable", { data: true })).data, "enabled");
  const refused = await call(ros, "/ik/solve", { x: 9, y: 9 }).then(() => "", String);
  check(refused.includes("beyond"), `the words of a refusal: ${refused}`);
  const trajectory = new ROSLIB.Topic({ ros, name: "/joint_trajectory", messageType: "trajectory_msgs/JointTrajectory" });
  trajectory.publish(new ROSLIB.Message({ points: [{ positions: [0.2, 0.3] }] }));
  const results = new ROSLIB.Topic({ ros, name: "/ik_action/result", messageType: "pendularm_interfaces/IkResult" });
  const result = within("a result", (resolve) => results.subscribe(resolve));
  const { goal_id } = await call(ros, "/ik_action/send_goal", { x: 0.5, y: 1.2 });
  const end = await result;
  check(end.goal_id === goal_id && end.outcome === "reached", "reached");
}

/** The frames by which ros3d shows an arm: as roslib has it by default, and by the service. */
async function viewer(options) {
  const ros = await connect({ url, ...options });
  const tf = new ROSLIB.TFClient({ ros, fixedFrame: "/world", rate: 30 });
  const hand = await within("the hand", (resolve) => tf.subscribe("hand", resolve));
  check(Math.hypot(hand.translation.x, hand.translation.y) > 0.1, "where the hand is");
  tf.dispose();
  ros.close();
}

async function overTcp() {
  const port = address.split(":").pop();
  const ros = await connect({ host: "127.0.0.1", port: Number(port), encoding: "utf8" });
  for (let gravity = 1; gravity <= 20; gravity += 1) {
    check((await call(ros, "/arm_sim/set_params", { gravity })).gravity === gravity, "what was set");
  }
  const { topics } = await within("topics", (ok, no) => ros.getTopics(ok, no));
  check(topics.includes("/joint_states"), "topics");
}

run("roslib 1", async () => {
  await overWebSocket();
  await viewer({});
  await viewer({ groovyCompatibility: false });
  await overTcp();
});
