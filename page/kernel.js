// The arm in this page: its kernel runs in a worker, behind the interface of a WebSocket. If workers are forbidden, it runs in the page's own thread.
// Invariant: for its callers it behaves like a WebSocket to the runtime.

import { unpack } from "./packed.js";

/** The packed kernel in the page in one file. A server's page has none. */
const carried = document.querySelector("#kernel-module");
/** Whether the arm is in this page. */
export const isAlone = carried !== null;

/** Numbers of links allowed in the address. The default is two. */
const LINKS = /(?:^|[?#&])links=([23])(?:&|$)/;

/** @param {string} part of an address @returns {number | null} its number of links */
export function linksIn(part) {
  const found = LINKS.exec(part);
  return found && Number(found[1]);
}

/**
 * Recomputes a submission of an episode, apart from the running kernel: the verdict in words and, if it agrees, the poses [rad] after
 * each step and the target [m]. @param {ArrayBuffer} submission @returns {Promise<[string, number[][]?, number[]?]>}
 */
export async function score(submission) {
  const { instance } = await WebAssembly.instantiate(await unpack(carried?.textContent ?? ""), { env: { milliseconds: () => 0 } });
  const kernel = /** @type {any} */ (instance.exports);
  const place = kernel.input(submission.byteLength);
  new Uint8Array(kernel.memory.buffer, place, submission.byteLength).set(new Uint8Array(submission));
  const length = kernel.score();
  return JSON.parse(new TextDecoder().decode(new Uint8Array(kernel.memory.buffer, kernel.output(), length)));
}

/**
 * Starts the kernel, and returns the function that takes frames. Its text is also the worker's script, so it uses nothing outside. @param {BufferSource} bytes
 * @param {number} links @param {number} seed @param {(frame: string) => void} tell
 */
async function run(bytes, links, seed, tell) {
  const TICK_MS = 1000 / 60;
  const SLICE_MS = 4; // computations take turns with ticks
  const environment = { env: { milliseconds: () => performance.now() } };
  const { instance } = await WebAssembly.instantiate(bytes, environment);
  const kernel = /** @type {any} */ (instance.exports);
  const encoder = new TextEncoder();
  const decoder = new TextDecoder();
  const turns = new MessageChannel();
  let computing = false;
  let due = performance.now();
  let timer = 0;

  function give() {
    const length = kernel.collect();
    const text = decoder.decode(new Uint8Array(kernel.memory.buffer, kernel.output(), length));
    for (const line of text.split("\n")) if (line) tell(line);
  }
  function compute() {
    computing = kernel.compute(SLICE_MS) !== 0;
    give();
    if (computing) turns.port2.postMessage(0);
  }
  function tick() {
    const now = performance.now();
    due = due + TICK_MS > now ? due + TICK_MS : now + TICK_MS; // missed ticks are skipped
    timer = /** @type {any} */ (setTimeout(tick, due - now));
    kernel.tick();
    give();
  }
  function take(frame) {
    const text = encoder.encode(frame);
    const place = kernel.input(text.length);
    new Uint8Array(kernel.memory.buffer, place, text.length).set(text);
    kernel.receive();
    give();
    if (!computing) compute();
  }
  function stop() {
    clearTimeout(timer);
    turns.port1.close();
  }
  turns.port1.onmessage = compute;
  kernel.start(links, seed);
  tick();
  return { take, stop };
}

const SCRIPT = `${run}
let take;
onmessage = async ({ data }) => {
  if (take) return take(data);
  const { bytes, links, seed } = data;
  take = (await run(bytes, links, seed, (frame) => postMessage(frame))).take;
  postMessage("");
};`;

export class Kernel {
  /** The running kernel, for a script around the page, which may also send and receive frames. @type {Kernel | null} */
  static current = null;

  constructor() {
    Kernel.current = this;
    this.readyState = /** @type {number} */ (WebSocket.CONNECTING);
    this.send = (/** @type {string} */ _frame) => {};
    this.stop = () => {};
    this.onopen = () => {};
    this.onmessage = (/** @type {{data: string}} */ _event) => {};
    this.onclose = () => {};
    this.begin().catch(() => this.close());
  }

  async begin() {
    const bytes = await unpack(carried?.textContent ?? "");
    const links = linksIn(location.search) ?? linksIn(location.hash) ?? 2;
    const start = { bytes, links, seed: Math.random() };
    try {
      await this.beginWorker(start);
    } catch {
      const { take, stop } = await run(bytes, links, start.seed, (frame) => this.onmessage({ data: frame }));
      // It answers later, like a socket.
      this.send = (frame) => setTimeout(() => this.readyState === WebSocket.OPEN && take(frame));
      this.stop = stop;
    }
    this.readyState = WebSocket.OPEN;
    this.onopen();
  }

  /** Fulfilled once the worker runs; rejected if workers are forbidden. */
  beginWorker(start) {
    const address = URL.createObjectURL(new Blob([SCRIPT], { type: "text/javascript" }));
    const worker = new Worker(address);
    this.stop = () => worker.terminate();
    return new Promise((done, fail) => {
      worker.onerror = (event) => {
        event.preventDefault();
        worker.terminate();
        if (this.readyState === WebSocket.OPEN) this.close();
        else fail(event);
      };
      worker.onmessage = () => {
        URL.revokeObjectURL(address);
        this.send = (frame) => worker.postMessage(frame);
        worker.onmessage = (event) => this.onmessage(event);
        done(undefined);
      };
      worker.postMessage(start);
    });
  }

  close() {
    if (this.readyState === WebSocket.CLOSED) return;
    this.readyState = WebSocket.CLOSED;
    this.stop();
    this.onclose();
  }
}
