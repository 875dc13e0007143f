// roslib 2.x, unmodified, over WebSocket.
import { Action, Param, ROS2TFClient, Ros, Service, TFClient, Topic } from "roslib2";
import { check, connected, run, session, url, within } from "./common.mjs";

run("roslib 2", async () => {
  const ros = new Ros();
  ros.connect(url);
  await connected(ros);
  await session({ Param, Service, Topic }, ros);
  const packed = new Topic({ ros, name: "joint_states", messageType: "sensor_msgs/JointState", compression: "cbor" });
  const dense = await within("a state in CBOR", (resolve) => packed.subscribe(resolve));
  check(dense.position instanceof Float64Array, "a typed array");
  packed.unsubscribe();
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
  const danced = await within("a dance", (ok, no) => dancer.sendGoal({ steps: 3 }, ok, (feedback) => (steps = feedback.step), no));
  check(danced.done === true && steps === 3, "an action of a client");

  const action = new Action({ ros, name: "/ik_action", actionType: "pendularm_interfaces/action/MoveTo" });
  let progress = 0;
  const result = await within("a result", (ok, no) => action.sendGoal({ x: 0.5, y: 1.2 }, ok, () => (progress += 1), no));
  check(result.outcome === "reached" && progress > 0, "reached, with feedback");
  const why = await within("a refusal", (ok, no) => action.sendGoal({ x: 9 }, no, undefined, ok));
  check(String(why).includes("y is required"), why);
});
