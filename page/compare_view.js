// Draws a comparison: two arms with their trails on one canvas, their distance on a logarithmic chart, and a time to scrub.
// Invariant: both are shown at the same instant; a run that ends early is drawn as far as it goes.

import { significant } from "./format.js";
import { joints, reach } from "./mechanics.js";
import { resample } from "./resample.js";
import { MOST_LINKS } from "./store.js";
import { Surface } from "./surface.js";
import { colors, onTheme } from "./theme.js";

const x = new Float64Array(MOST_LINKS + 1);
const y = new Float64Array(MOST_LINKS + 1);
/** Tips closer than this are drawn as together: it is where rounding begins [m]. */
const TOGETHER = 1e-12;
const LEFT = 46;
const BOTTOM = 16;

export class CompareView {
  constructor(arm, chart, scrub, play) {
    this.poses = []; // of each run, at each of `times`; null where it has none
    this.times = [];
    this.at = 0;
    this.playing = false;
    this.scrub = scrub;
    this.play = play;
    this.arm = new Surface(arm, () => this.draw());
    this.chart = new Surface(chart, () => this.draw());
    onTheme(() => this.draw());
    scrub.addEventListener("input", () => {
      this.stop();
      this.at = Number(scrub.value);
      this.draw();
    });
    play.addEventListener("click", () => (this.playing ? this.stop() : this.start()));
  }

  /** Takes two runs, and gives the distance between their tips at each instant [m]; NaN where one has ended. */
  show(runs, lengths, links) {
    this.lengths = lengths;
    this.links = links;
    this.times = runs.reduce((longest, { times }) => (times.at(-1) > longest.at(-1) ? times : longest), runs[0].times);
    this.poses = runs.map((run) => resample(run, this.times));
    this.tips = this.poses.map((poses) => poses.map((q) => {
      if (!q) return null;
      joints(links, q, lengths, x, y);
      return [x[links], y[links]];
    }));
    this.apart = this.times.map((_, k) => {
      const [a, b] = [this.tips[0][k], this.tips[1][k]];
      return a && b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : NaN;
    });
    this.scrub.max = String(this.times.length - 1);
    this.at = 0;
    this.start();
    return this.apart;
  }

  start() {
    const { times } = this;
    if (times.length < 2) return;
    if (this.at >= times.length - 1) this.at = 0;
    this.playing = true;
    this.play.textContent = "Pause";
    const began = performance.now() - 1000 * times[this.at];
    const frame = (now) => {
      if (!this.playing) return;
      const time = (now - began) / 1000;
      while (this.at < times.length - 1 && times[this.at] < time) this.at += 1;
      this.scrub.value = String(this.at);
      this.draw();
      if (this.at >= times.length - 1) this.stop();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  stop() {
    this.playing = false;
    this.play.textContent = "Play";
  }

  draw() {
    if (this.times.length === 0) return;
    this.drawArms();
    this.drawApart();
    this.scrub.setAttribute("aria-valuetext", `${significant(this.times[this.at], 3)} s, ${significant(this.apart[this.at], 3)} m apart`);
  }

  drawArms() {
    const { context, width, height } = this.arm;
    const scale = Math.min(width, height) / (2.2 * reach(this.lengths));
    const px = (metres) => width / 2 + metres * scale;
    const py = (metres) => height / 2 - metres * scale;
    context.clearRect(0, 0, width, height);
    context.lineCap = "round";
    context.lineJoin = "round";
    context.strokeStyle = colors.line;
    context.lineWidth = 1;
    context.beginPath();
    context.arc(px(0), py(0), reach(this.lengths) * scale, 0, 2 * Math.PI);
    context.stroke();
    const both = [colors.first, colors.second];
    this.tips.forEach((tips, side) => {
      context.strokeStyle = both[side];
      context.globalAlpha = 0.55;
      context.lineWidth = 1.5;
      context.beginPath();
      for (let k = 0, down = false; k <= this.at; k += 1) {
        const tip = tips[k];
        if (tip && down) context.lineTo(px(tip[0]), py(tip[1]));
        else if (tip) context.moveTo(px(tip[0]), py(tip[1]));
        down = tip !== null;
      }
      context.stroke();
    });
    context.globalAlpha = 1;
    this.poses.forEach((poses, side) => {
      const q = poses[this.at];
      if (!q) return;
      joints(this.links, q, this.lengths, x, y);
      context.strokeStyle = both[side];
      context.lineWidth = side === 0 ? 8 : 4; // where they agree, both are seen
      context.beginPath();
      context.moveTo(px(0), py(0));
      for (let i = 1; i <= this.links; i += 1) context.lineTo(px(x[i]), py(y[i]));
      context.stroke();
    });
  }

  /** Distance between the tips, a line per power of ten or so. */
  drawApart() {
    const { context, width, height } = this.chart;
    const values = this.apart.filter((one) => one > TOGETHER);
    const top = Math.ceil(Math.log10(Math.max(1e-9, ...values)));
    const bottom = Math.max(Math.log10(TOGETHER), Math.min(top - 2, Math.floor(Math.log10(Math.min(1, ...values)))));
    const place = (value) => 6 + ((top - Math.log10(Math.max(value, TOGETHER))) / (top - bottom)) * (height - BOTTOM - 6);
    const across = (k) => LEFT + (k / Math.max(1, Number(this.scrub.max))) * (width - LEFT - 8);
    context.clearRect(0, 0, width, height);
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = colors.muted;
    context.strokeStyle = colors.grid;
    context.lineWidth = 1;
    context.textAlign = "right";
    context.textBaseline = "middle";
    const every = Math.max(1, Math.ceil((top - bottom) / 5));
    for (let power = top; power >= bottom; power -= every) {
      const at = place(10 ** power);
      context.beginPath();
      context.moveTo(LEFT, at);
      context.lineTo(width - 8, at);
      context.stroke();
      context.fillText(`1e${power}`.replace("-", "\u2212"), LEFT - 6, at);
    }
    context.save();
    context.beginPath();
    context.rect(LEFT, 0, width - LEFT, height - BOTTOM);
    context.clip();
    context.strokeStyle = colors.ink;
    context.lineWidth = 1.75;
    context.beginPath();
    this.apart.forEach((one, k) => {
      if (Number.isFinite(one)) context.lineTo(across(k), place(one));
    });
    context.stroke();
    context.strokeStyle = colors.accent;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(across(this.at), 0);
    context.lineTo(across(this.at), height);
    context.stroke();
    context.restore();
    this.drawTimes(across);
  }

  drawTimes(across) {
    const { context, height } = this.chart;
    const { times } = this;
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    for (const part of [0, 0.25, 0.5, 0.75]) {
      const k = Math.floor(part * (times.length - 1));
      context.fillText(`${significant(times[k], 3)} s`, across(k) + (part === 0 ? 10 : 0), height - 3);
    }
  }
}
