// roslib 1.x, unmodified: over WebSocket, and over its raw TCP, there with calls one at a time.
import ROSLIB from "roslib1";
import { address, call, check, connected, run, session, url, within } from "./common.mjs";

const connect = (options) => connected(new ROSLIB.Ros(options));

async function overWebSocket() {
  const ros = await connect({ url });
  await session(ROSLIB, ros);
  const details = await within("details", (ok, no) => ros.getMessageDetails("sensor_msgs/JointState", ok, no));
  check(ros.decodeTypeDefs(details).header !== undefined, "decoded details");
  const none = new ROSLIB.Param({ ros, name: "/none" });
  check((await within("no parameter", (ok) => none.get(ok))) === "", "an absent parameter is empty");
  const packed = new ROSLIB.Topic({ ros, name: "/clock", messageType: "rosgraph_msgs/Clock", compression: "cbor" });
  check((await within("CBOR", (resolve) => packed.subscribe(resolve))).clock.sec >= 0, "the clock in CBOR");
  packed.unsubscribe();
  const results = new ROSLIB.Topic({ ros, name: "/ik_action/result", messageType: "pendularm_interfaces/IkResult" });
  const result = within("a result", (resolve) => results.subscribe(resolve));
  const { goal_id } = await call(ROSLIB.Service, ros, "/ik_action/send_goal", { x: 0.5, y: 1.2 });
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
    check((await call(ROSLIB.Service, ros, "/arm_sim/set_params", { gravity })).gravity === gravity, "what was set");
  }
}

run("roslib 1", async () => {
  await overWebSocket();
  await viewer({});
  await viewer({ groovyCompatibility: false });
  await overTcp();
});
