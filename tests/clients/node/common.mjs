// Parts that the clients share: the runtime's address, and promises with a limit.
export const address = process.argv[2];
export const url = `ws://${address}`;
const PATIENCE_MS = 30_000;

/** A promise of the result of `begin(resolve, reject)`. It fails with `what` after the limit. */
export function within(what, begin) {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error(`${what} did not come`)), PATIENCE_MS);
    const done = (end) => (value) => {
      clearTimeout(timer);
      end(value);
    };
    begin(done(resolve), done(reject));
  });
}

/** Awaits the connection of a `Ros`, of any version of roslib. */
export async function connected(ros) {
  await within("the connection", (resolve, reject) => {
    ros.on("connection", resolve);
    ros.on("error", reject);
  });
  return ros;
}

/** The values of a call, by any version of roslib. */
export function call(Service, ros, name, request) {
  const service = new Service({ ros, name, serviceType: "x/Y" });
  return within(name, (ok, no) => service.callService(request, ok, no));
}

/** What any version of roslib can do over WebSocket: list topics, subscribe, publish, call, read a parameter. */
export async function session({ Param, Service, Topic }, ros) {
  const { topics, types } = await within("topics", (ok, no) => ros.getTopics(ok, no));
  check(types[topics.indexOf("/joint_states")] === "sensor_msgs/msg/JointState", "the type of /joint_states");
  const gravity = new Param({ ros, name: "gravity" });
  check((await within("a parameter", (ok, no) => gravity.get(ok, no))) === 9.81, "gravity");
  const states = new Topic({ ros, name: "/joint_states", messageType: "sensor_msgs/JointState" });
  check((await within("a state", (resolve) => states.subscribe(resolve))).name.join() === "joint1,joint2", "a state");
  states.unsubscribe();

  check((await call(Service, ros, "/pid_controller/enable", { data: true })).data === true, "enabled");
  const refused = await call(Service, ros, "/ik/solve", { x: 9, y: 9 }).then(() => "", String);
  check(refused.includes("beyond"), `the words of a refusal: ${refused}`);
  const setpoints = () => new Topic({ ros, name: "/joint_trajectory", messageType: "trajectory_msgs/JointTrajectory" });
  const own = within("its own setpoint", (resolve) => setpoints().subscribe(resolve));
  setpoints().publish({ points: [{ positions: [0.2, 0.3] }] });
  check((await own).points[0].positions[1] === 0.3, "the setpoint");
}

export function check(holds, what) {
  if (!holds) throw new Error(`not so: ${what}`);
}

/** Ends the process: with what went wrong, or with the client's name. */
export function run(name, client) {
  client().then(
    () => {
      console.log(`${name}: ok`);
      process.exit(0);
    },
    (error) => {
      console.error(`${name}: ${error?.stack ?? JSON.stringify(error)}`);
      process.exit(1);
    },
  );
}
