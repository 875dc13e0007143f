// Shows the arm's joint positions as they come.
const state = document.querySelector("#state");
const socket = new WebSocket(`ws://${location.host}/`);
socket.onopen = () => socket.send(JSON.stringify({ op: "subscribe", topic: "/joint_states", throttle_rate: 100 }));
socket.onmessage = (event) => {
  const { msg } = JSON.parse(event.data);
  state.textContent = msg.position.map((q) => `${q.toFixed(3)} rad`).join(", ");
};
socket.onclose = () => {
  state.textContent = "the connection has ended";
};
