// @ts-check
// Draws a comparison: all arms with their trails over one another, their error, energy and a joint's angle over time, and an
// instant to scrub.
// Invariant: all are shown at the same instant; a run that ends early is drawn as far as it goes, its last pose as a ghost.

import { byId, setText } from "./dom.js";
import { significant } from "./format.js";
import { onFrame, wake } from "./frames.js";
import { Axis } from "./axis.js";
import { joints, reach } from "./mechanics.js";
import { resample } from "./resample.js";
import { LogScale } from "./scale.js";
import { MOST_LINKS, state, watch } from "./store.js";
import { Surface } from "./surface.js";
import { colors, onTheme } from "./theme.js";

const x = new Float64Array(MOST_LINKS + 1);
const y = new Float64Array(MOST_LINKS + 1);
/** Errors smaller than this are rounding [rad]. */
const SMALLEST = 1e-13;
const LEFT = 50;
const RIGHT = 8;
const BOTTOM = 16;
const TOP = 6;

export class CompareView {
  constructor() {
    this.runs = [];
    this.times = [];
    this.at = 0;
    this.playing = false;
    this.began = 0;
    this.stale = false;
    this.scrub = byId("compare-scrub");
    this.play = byId("compare-play");
    const redraw = () => { this.stale = true; wake(); };
    this.redraw = redraw;
    this.arm = new Surface(byId("compare-arm"), redraw);
    this.error = new Surface(byId("compare-chart"), redraw);
    this.energy = new Surface(byId("compare-energy"), redraw);
    this.angle = new Surface(byId("compare-angle"), redraw);
    onTheme(redraw);
    watch("joint", redraw);
    watch("tab", redraw);
    this.scrub.addEventListener("input", () => {
      this.stop();
      this.at = Number(this.scrub.value);
      redraw();
    });
    this.play.addEventListener("click", () => (this.playing ? this.stop() : this.start()));
    onFrame((now) => this.frame(now));
  }

  /** Takes the runs, how far each is from the reference at the reference's instants, and the reference. */
  show(runs, away, reference, lengths, links, seconds) {
    this.lengths = lengths;
    this.links = links;
    this.seconds = seconds;
    this.times = reference.times;
    this.runs = [...runs, reference].map((run, i) => ({
      energy: { times: run.times, values: run.energy },
      away: away[i],
      poses: resample(run, this.times),
      isReference: i === runs.length,
    }));
    for (const run of this.runs) {
      run.trail = run.poses.map((q) => {
        if (!q) return null;
        joints(links, q, lengths, x, y);
        return [x[links], y[links]];
      });
      run.last = run.poses.findLastIndex((q) => q !== null);
    }
    this.scrub.max = String(this.times.length - 1);
    this.at = 0;
    this.start();
  }

  start() {
    if (this.times.length < 2) return;
    if (this.at >= this.times.length - 1) this.at = 0;
    this.playing = true;
    this.began = performance.now() - 1000 * this.times[this.at];
    setText(this.play, "Pause");
    this.redraw();
  }

  stop() {
    this.playing = false;
    setText(this.play, "Play");
  }

  /** Gives whether it plays on. */
  frame(now) {
    if (this.times.length === 0 || state.tab !== "compare") return false;
    if (this.playing) {
      const time = (now - this.began) / 1000;
      while (this.at < this.times.length - 1 && this.times[this.at] < time) this.at += 1;
      this.scrub.value = String(this.at);
      this.stale = true;
      if (this.at >= this.times.length - 1) this.stop();
    }
    if (this.stale) {
      this.stale = false;
      this.draw();
    }
    return this.playing;
  }

  draw() {
    this.drawArms();
    this.drawError();
    this.drawLines(this.energy, (run) => run.energy.times, (run) => run.energy.values, 5000);
    setText(byId("compare-joint"), String(state.joint + 1));
    this.drawLines(this.angle, () => this.times, (run) => run.poses.map((q) => (q ? q[state.joint] : null)), 300);
    const words = this.runs.filter(({ isReference }) => !isReference).map(({ away }) => (away[this.at] === null ? "ended" : `${significant(away[this.at], 3)} rad`));
    this.scrub.setAttribute("aria-valuetext", `${significant(this.times[this.at], 3)} s, errors ${words.join(", ")}`);
  }

  color(k) {
    return this.runs[k].isReference ? colors.muted : colors.runs[k];
  }

  drawArms() {
    const { context, width, height } = this.arm;
    const scale = Math.min(width, height) / (2.2 * reach(this.lengths));
    const px = (metres) => width / 2 + metres * scale;
    const py = (metres) => height / 2 - metres * scale;
    this.arm.clear();
    context.lineCap = "round";
    context.lineJoin = "round";
    context.strokeStyle = colors.line;
    context.lineWidth = 1;
    context.beginPath();
    context.arc(px(0), py(0), reach(this.lengths) * scale, 0, 2 * Math.PI);
    context.stroke();
    this.runs.forEach(({ trail }, k) => {
      context.strokeStyle = this.color(k);
      context.globalAlpha = 0.4;
      context.lineWidth = 1.25;
      context.beginPath();
      for (let i = 0, down = false; i <= this.at; i += 1) {
        const place = trail[i];
        if (place && down) context.lineTo(px(place[0]), py(place[1]));
        else if (place) context.moveTo(px(place[0]), py(place[1]));
        down = place !== null;
      }
      context.stroke();
    });
    this.runs.forEach(({ poses, last }, k) => {
      const ended = this.at > last;
      const q = poses[ended ? last : this.at];
      if (!q) return;
      joints(this.links, q, this.lengths, x, y);
      context.globalAlpha = ended ? 0.25 : 0.85;
      context.strokeStyle = this.color(k);
      context.lineWidth = 3 + 2 * (this.runs.length - k); // where they agree, all are seen
      context.beginPath();
      context.moveTo(px(0), py(0));
      for (let i = 1; i <= this.links; i += 1) context.lineTo(px(x[i]), py(y[i]));
      context.stroke();
    });
    context.globalAlpha = 1;
  }

  across(surface, time) {
    return LEFT + (time / this.seconds) * (surface.width - LEFT - RIGHT);
  }

  begin(surface) {
    const { context } = surface;
    surface.clear();
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = colors.muted;
    context.strokeStyle = colors.grid;
    context.lineWidth = 1;
    context.textAlign = "right";
    context.textBaseline = "middle";
  }

  tick({ context, width }, at, text) {
    context.beginPath();
    context.moveTo(LEFT, at);
    context.lineTo(width - RIGHT, at);
    context.stroke();
    context.fillText(text, LEFT - 6, at);
  }

  drawError() {
    const surface = this.error;
    const { height } = surface;
    const values = this.runs.flatMap(({ away }) => away ?? []).filter((one) => one !== null && one > SMALLEST);
    const high = 10 ** Math.ceil(Math.log10(Math.max(1e-9, ...values)));
    const low = Math.max(SMALLEST, Math.min(high / 100, 10 ** Math.floor(Math.log10(Math.min(1, ...values)))));
    const scale = new LogScale(low, high);
    const place = (value) => height - BOTTOM - scale.place(Math.max(value, low)) * (height - BOTTOM - TOP);
    this.begin(surface);
    for (const tick of scale.ticks(6)) this.tick(surface, place(tick), significant(tick, 1));
    this.runs.forEach(({ away }, k) => { if (away) this.line(surface, this.times, away, place, k); });
    this.finish(surface);
  }

  drawLines(surface, timesOf, valuesOf, sane) {
    const { height } = surface;
    const axis = new Axis(3, 0.1, sane);
    for (const run of this.runs) for (const value of valuesOf(run)) if (value !== null) axis.offer(value);
    axis.end();
    const place = (value) => height - BOTTOM - axis.place(value) * (height - BOTTOM - TOP);
    this.begin(surface);
    for (let i = 0; i < axis.count; i += 1) this.tick(surface, place(axis.values[i]), axis.labels[i]);
    this.runs.forEach((run, k) => this.line(surface, timesOf(run), valuesOf(run), place, k));
    this.finish(surface);
  }

  line(surface, times, values, place, k) {
    const { context, width } = surface;
    context.save();
    context.beginPath();
    context.rect(LEFT, 0, width - LEFT - RIGHT, surface.height - BOTTOM);
    context.clip();
    context.strokeStyle = this.color(k);
    context.lineWidth = 1.5;
    context.beginPath();
    values.forEach((value, i) => { if (Number.isFinite(value) && value !== null) context.lineTo(this.across(surface, times[i]), place(value)); });
    context.stroke();
    context.restore();
  }

  /** The instant, and times along the bottom. */
  finish(surface) {
    const { context, height } = surface;
    context.strokeStyle = colors.accent;
    context.beginPath();
    context.moveTo(this.across(surface, this.times[this.at]), 0);
    context.lineTo(this.across(surface, this.times[this.at]), height - BOTTOM);
    context.stroke();
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    for (const part of [0, 0.25, 0.5, 0.75, 1]) {
      context.fillText(`${significant(part * this.seconds, 3)} s`, Math.min(surface.width - 16, this.across(surface, part * this.seconds)), height - 3);
    }
  }
}
