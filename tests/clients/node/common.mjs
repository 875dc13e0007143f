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
