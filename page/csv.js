// What was recorded, as a CSV file: one row per joint state, SI units named in the header.
// Invariant: the page's memory is not kept: the text is handed to the browser and let go.

import { EFFORT, ENERGY, LOAD, POSITION, SETPOINT, TIME, VELOCITY, record } from "./recorder.js";
import { el } from "./dom.js";

const COLUMNS = [
  ["position", "rad", POSITION],
  ["setpoint", "rad", SETPOINT],
  ["velocity", "rad/s", VELOCITY],
  ["effort", "N m", EFFORT],
  ["gravity_load", "N m", LOAD],
];

/** The file's text, for an arm with `links` links. */
export function csvText(links) {
  const names = ["time [s]"];
  const offsets = [TIME];
  for (const [name, unit, offset] of COLUMNS) {
    for (let joint = 0; joint < links; joint += 1) {
      names.push(`${name}${joint + 1} [${unit}]`);
      offsets.push(offset + joint);
    }
  }
  names.push("energy [J]");
  offsets.push(ENERGY);
  const lines = [names.join(",")];
  for (let i = 0; i < record.length; i += 1) {
    const row = record.at(i);
    // What is not known, or not finite, is an empty field.
    lines.push(offsets.map((offset) => {
      const value = record.data[row + offset];
      return Number.isFinite(value) ? value : "";
    }).join(","));
  }
  return `${lines.join("\r\n")}\r\n`;
}

export function downloadCsv(links) {
  const url = URL.createObjectURL(new Blob([csvText(links)], { type: "text/csv" }));
  el("a", { href: url, download: "pendularm.csv" }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}
