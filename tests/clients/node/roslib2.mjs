// roslib 2.x, unmodified, over WebSocket.
import { Action, Param, ROS2TFClient, Ros, Service, TFClient, Topic } from "roslib2";
import { check, run, url, within } from "./common.mjs";

run("roslib 2", async () => {
  const ros = new Ros();
  await within("the connection", (resolve, reject) => {
    ros.on("connection", resolve);
    ros.on("error", reject);
    ros.connect(url);
  });
  const { topics, types } = await within("topics", (ok, no) => ros.getTopics(ok, no));
  check(types[topics.indexOf("/joint_states")] === "sensor_msgs/msg/JointState", "the type of /joint_states");
  const services = await within("services", (ok, no) => ros.getServices(ok, no));
  check(services.includes("/arm_sim/set_params"), "services");
  const nodes = await within("nodes", (ok, no) => ros.getNodes(ok, no));
  check(nodes.includes("/arm_sim"), "nodes");
  const details = await within("details", (ok, no) => ros.getMessageDetails("sensor_msgs/msg/JointState", ok, no));
  check(ros.decodeTypeDefs(details).header !== undefined, "decoded details");

  const gravity = new Param({ ros, name: "gravity" });
  check((await within("a parameter", (ok, no) => gravity.get(ok, no))) === 9.81, "gravity");
  await within("setting it", (ok, no) => gravity.set(9.5, ok, no));

  const states = new Topic({ ros, name: "/joint_states", messageType: "sensor_msgs/JointState" });
  const state = await within("a state", (resolve) => states.subscribe(resolve));
  check(state.name.length === 2, "two joints");
  states.unsubscribe();
  const packed = new Topic({ ros, name: "joint_states", messageType: "sensor_msgs/JointState", compression: "cbor" });
  const dense = await within("a state in CBOR", (resolve) => packed.subscribe(resolve));
  check(dense.position instanceof Float64Array, "a typed array");
  packed.unsubscribe();

  const enable = new Service({ ros, name: "/pid_controller/enable", serviceType: "pendularm_interfaces/srv/Enable" });
  check((await within("enabling", (ok, no) => enable.callService({ data: true }, ok, no))).data, "enabled");
  const solve = new Service({ ros, name: "/ik/solve", serviceType: "pendularm_interfaces/srv/Solve" });
  const refused = await within("a refusal", (ok, no) => solve.callService({ x: 9, y: 9 }, no, ok));
  check(String(refused).includes("beyond"), `the words of a refusal: ${refused}`);
  const trajectory = new Topic({ ros, name: "/joint_trajectory", messageType: "trajectory_msgs/JointTrajectory" });
  trajectory.publish({ points: [{ positions: [0.2, 0.3] }] });

  for (const Client of [TFClient, ROS2TFClient]) {
    const tf = new Client({ ros, fixedFrame: "world", rate: 30 });
    const hand = await within("the hand", (resolve) => tf.subscribe("hand", resolve));
    check(Number.isFinite(hand.translation.x), `where the hand is, by ${Client.name}`);
    tf.dispose();
  }

  const dance = new Action({ ros, name: "/dance", actionType: "demo/action/Dance" });
  dance.advertise(
    (goal, id) => {
      dance.sendFeedback(id, { step: goal.steps });
      dance.setSucceeded(id, { done: true });
    },
    () => {},
  );
  const dancer = new Action({ ros, name: "/dance", actionType: "demo/action/Dance" });
  let steps = 0;
  const danced = await within("a dance", (ok, no) =>
    dancer.sendGoal({ steps: 3 }, ok, (feedback) => (steps = feedback.step), no),
  );
  check(danced.done === true && steps === 3, "an action of a client");

  const action = new Action({ ros, name: "/ik_action", actionType: "pendularm_interfaces/action/MoveTo" });
  let progress = 0;
  const result = await within("a result", (ok, no) =>
    action.sendGoal({ x: 0.5, y: 1.2 }, ok, () => (progress += 1), no),
  );
  check(result.outcome === "reached" && progress > 0, "reached, with feedback");
  const why = await within("a refusal", (ok, no) => action.sendGoal({ x: 9 }, no, undefined, ok));
  check(String(why).includes("y is required"), why);
});
