// @ts-check
// The recording as a CSV file: the settings in lines that begin with #, then one row per joint state, SI units named in
// the header.
// Invariant: a value that is unknown or not finite is an empty field.

import { EFFORT, ENERGY, KINETIC, LOAD, POSITION, POTENTIAL, SETPOINT, TIME, VELOCITY, record } from "./history.js";
import { toFragment } from "./settings.js";

/** @typedef {import("./settings.js").Settings} Settings */

const COLUMNS = /** @type {[string, string, number][]} */ ([
  ["position", "rad", POSITION],
  ["setpoint", "rad", SETPOINT],
  ["velocity", "rad/s", VELOCITY],
  ["effort", "N m", EFFORT],
  ["gravity_load", "N m", LOAD],
]);

/** The file's text, for an arm with `links` links. @param {number} links @param {Settings | null} settings those in force now */
export function csvText(links, settings) {
  const names = ["time [s]"];
  const offsets = [TIME];
  for (const [name, unit, offset] of COLUMNS) {
    for (let joint = 0; joint < links; joint += 1) {
      names.push(`${name}${joint + 1} [${unit}]`);
      offsets.push(offset + joint);
    }
  }
  names.push("kinetic [J]", "potential [J]", "energy [J]");
  offsets.push(KINETIC, POTENTIAL, ENERGY);
  const about = settings ? toFragment(settings, links).split("&").map((one) => `# ${one}`) : [];
  const lines = ["# pendularm; settings as they were when this was saved", ...about, names.join(",")];
  for (let i = 0; i < record.length; i += 1) {
    const row = record.at(i);
    lines.push(offsets.map((offset) => {
      const value = record.data[row + offset];
      return Number.isFinite(value) ? value : "";
    }).join(","));
  }
  return `${lines.join("\r\n")}\r\n`;
}
