// Sends the newest of many values: at most one pending call, and at most one call per `intervalMs`.
// Invariant: the last value is always sent. Values in between may be skipped.

export function latestOnly(send, intervalMs) {
  let waiting = null;
  let busy = false;
  let last = -Infinity;

  async function run() {
    if (busy) return;
    busy = true;
    while (waiting) {
      const rest = last + intervalMs - performance.now();
      if (rest > 0) await new Promise((done) => setTimeout(done, rest));
      const { value } = waiting;
      waiting = null;
      last = performance.now();
      await send(value);
    }
    busy = false;
  }

  return (value) => {
    waiting = { value };
    run();
  };
}
