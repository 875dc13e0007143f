// A rosbridge client over a WebSocket or an object with its interface: calls as promises, and subscriptions that survive a lost connection.
// Invariant: a promise of `call` is always fulfilled, with `result: false` and a reason if there is no answer.

const FIRST_RETRY_MS = 300;
const LAST_RETRY_MS = 4000;
const CALL_TIMEOUT_MS = 15000;
const MOST_CALLS = 256; // most calls that wait for an answer, so that memory is bounded without answers

/** The address of the runtime's WebSocket: the folder of the page, which a proxy may serve under a path. @param {string} page its address */
export function socketAddress(page) {
  const address = new URL(".", page);
  address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
  return address.href;
}

export class Rosbridge {
  /**
   * @param {() => WebSocket | import("./kernel.js").Kernel} dial opens a connection
   * @param {(state: "connecting"|"open"|"lost") => void} onState
   */
  constructor(dial, onState) {
    this.dial = dial;
    this.onState = onState;
    this.handlers = new Map(); // topic -> function
    this.throttles = new Map(); // topic -> least time between messages [ms], if there is one
    this.calls = new Map(); // id -> { settle, timer }
    this.nextId = 1;
    this.retryMs = FIRST_RETRY_MS;
    this.failures = 0; // attempts in a row without a connection
    this.heard = -Infinity; // the time of the last frame [ms]
    /** @type {(text: string) => void} */
    this.onStatus = () => {};
    this.connect();
  }

  get open() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  connect() {
    this.onState("connecting");
    const socket = this.dial();
    this.socket = socket;
    socket.onopen = () => {
      this.retryMs = FIRST_RETRY_MS;
      this.failures = 0;
      this.heard = performance.now();
      // Errors about published messages are shown, but over WebSocket they must be requested. `values`
      // of a refused call are the present values, not the text of `status`.
      this.send({ op: "set_level", level: "error", errors: "object" });
      for (const topic of this.handlers.keys()) this.send(this.subscription(topic));
      this.onState("open");
    };
    socket.onmessage = (event) => this.receive(event.data);
    socket.onclose = () => this.lost();
  }

  lost() {
    for (const id of [...this.calls.keys()]) this.answer(id, failure("the connection was lost"));
    this.failures += 1;
    this.onState("lost");
    const wait = this.retryMs * (0.75 + 0.5 * Math.random()); // many pages must not reconnect at the same time
    this.retryMs = Math.min(2 * this.retryMs, LAST_RETRY_MS);
    setTimeout(() => this.connect(), wait);
  }

  receive(text) {
    this.heard = performance.now();
    let frame;
    try {
      frame = JSON.parse(text);
    } catch {
      return;
    }
    if (frame.op === "publish") {
      const handler = this.handlers.get(frame.topic);
      if (handler) handler(frame.msg);
    } else if (frame.op === "service_response") {
      this.answer(frame.id, frame);
    } else if (frame.op === "status" && frame.level === "error") {
      this.onStatus(String(frame.msg));
    }
  }

  answer(id, { values, result, status }) {
    const call = this.calls.get(id);
    if (!call) return;
    this.calls.delete(id);
    clearTimeout(call.timer);
    call.settle({ values: values ?? {}, result: result === true, status: status ?? "" });
  }

  send(frame) {
    if (this.open) this.socket.send(JSON.stringify(frame));
  }

  subscribe(topic, handler) {
    this.handlers.set(topic, handler);
    this.send(this.subscription(topic));
  }

  subscription(topic) {
    return { op: "subscribe", topic, throttle_rate: this.throttles.get(topic) ?? 0 };
  }

  /** Limits the topic to one message per `ms` from now on. */
  throttle(topic, ms) {
    if ((this.throttles.get(topic) ?? 0) === ms) return;
    this.throttles.set(topic, ms);
    this.send({ op: "unsubscribe", topic });
    this.send(this.subscription(topic));
  }

  publish(topic, msg) {
    this.send({ op: "publish", topic, msg });
  }

  /** @returns {Promise<{values: object, result: boolean, status: string}>} */
  call(service, args = {}, timeoutMs = CALL_TIMEOUT_MS) {
    if (!this.open) return Promise.resolve(failure("not connected"));
    const wrong = notFinite(args);
    if (wrong) return Promise.resolve(failure(`${wrong} must be a number`));
    if (this.calls.size >= MOST_CALLS) return Promise.resolve(failure("too many calls wait for an answer"));
    const id = `page-${this.nextId}`;
    this.nextId += 1;
    return new Promise((settle) => {
      const timer = setTimeout(() => this.answer(id, failure(`${service} did not answer in time`)), timeoutMs);
      this.calls.set(id, { settle, timer });
      this.send({ op: "call_service", service, id, args });
    });
  }
}

/** The path of a member that is no finite number; "" if there is none. JSON writes it as null, which can mean the default. */
function notFinite(args, path = "") {
  for (const [name, value] of Object.entries(args)) {
    const wrong = typeof value === "number" && !Number.isFinite(value) ? path + name : value?.constructor === Object && notFinite(value, `${path}${name}.`);
    if (wrong) return wrong;
  }
  return "";
}

function failure(status) {
  return { values: {}, result: false, status };
}
