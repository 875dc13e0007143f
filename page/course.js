// The course: eleven steps, each a scene, a chart, a task that ticks itself, and a question with its answer.
// Invariant: a step is data. Its text has at most 40 words. Its view sets the scene on a click only.

import { DEFAULTS } from "./settings.js";

/** @typedef {import("./settings.js").Settings} Settings */
/** @typedef {{text: string, answers: string[], right: number, because: string}} Question */
/** @typedef {ReturnType<typeof nothingSeen>} Seen */
/**
 * @typedef {object} Step
 * @property {string} id
 * @property {string} title
 * @property {string} text
 * @property {(links: number) => Settings} scene
 * @property {number[]} [offset] pose at the start [rad], else stretched out
 * @property {boolean} [paused] whether the arm takes two control steps a second
 * @property {"velocity" | "bars" | "errors" | "map" | "responses" | "energy" | "ladder" | "pictures" | "form"} chart
 * @property {"period" | "timestep" | "damping" | "gains" | null} dial
 * @property {boolean} [methods] whether the methods can be chosen
 * @property {Question} [guess] before the dial is shown
 * @property {{text: string, done: (seen: Seen) => boolean}} task
 * @property {Question} question
 */

/** A period about a quarter beyond the limit: the arm shakes, but its state stays finite [s]. @type {Record<number, number>} */
export const BEYOND = { 2: 0.0055, 3: 0.0038 };
/** A period well below the limit [s]. @type {Record<number, number>} */
const WITHIN = { 2: 0.004, 3: 0.002 };
const FINE = 0.0001; // short enough that the simulation's error is not visible [s]
/** Gains that are soft enough for a visible response, with some integral. @type {Record<number, import("./settings.js").Gains>} */
export const SOFT = {
  2: { kp: [200, 100], ki: [60, 30], kd: [60, 20] },
  3: { kp: [400, 100, 40], ki: [120, 30, 12], kd: [120, 30, 6] },
};
/** Effort limits of that step: little more than the weight needs [N m]. @type {Record<number, number[]>} */
export const WEAK = { 2: [30, 10], 3: [60, 25, 8] };
const ALL = 4; // four methods
const MUCH = 100; // the required reduction of the method's error
const SOME_SCENES = 3;
/** Energy counts as kept if it never differs by more from that of the start [J], for this time [s] and at this timestep [s]. */
export const KEPT = 0.1;
const LONG = 10;
const STRIDE = 0.005;
const FIRST = 0.1; // the first joint state after a reset comes within this time [s]

/** @param {number} links @param {number} period @param {Partial<Settings>} [changed] @returns {Settings} */
function controlled(links, period, changed = {}) {
  return { ...structuredClone(DEFAULTS[links]), integrator: { method: "rk4", timestep: FINE }, period: { period, delay: false }, controller: true, ...changed };
}

/** @type {Step[]} */
export const STEPS = [
  {
    id: "hold", title: "A controller holds the arm",
    text: "A thousand times a second the controller measures the joints and sets new torques. Drag the end of the arm, which is called the end "
      + "effector. The controller moves it there. Arcs show the torques.",
    scene: (links) => controlled(links, 0.001),
    chart: "velocity", dial: null,
    task: { text: "Drag the end effector to a new place, and wait until it arrives.", done: ({ reached }) => reached },
    question: {
      text: "What does the controller do between two measurements?",
        answers: ["It holds the torques as they are", "It corrects them all the time", "It sets them to zero"], right: 0,
      because: "A computer measures only at certain times. Between two measurements it holds each torque. This is called a hold.",
    },
  },
  {
    id: "slow", title: "Slow the controller down",
    text: "Now you make the controller measure less often. The time between two measurements is its period. Guess first: when does the arm begin to shake?",
    scene: (links) => controlled(links, 0.001),
    chart: "velocity", dial: "period",
    guess: {
      text: "At which period does it begin to shake?", answers: ["below 1 ms", "at 3 to 5 ms", "about 50 ms"], right: 1,
      because: "The red mark shows the limit. It is 4.3 ms for two links and 3 ms for three.",
    },
    task: { text: "Make the period longer until the arm shakes.", done: ({ shook }) => shook },
    question: {
      text: "Just below the limit, what does the arm do?", answers: ["It shakes a little", "It comes to rest", "It falls"], right: 1,
      because: "Below the limit small deviations die away. Just beyond the limit some of them grow.",
    },
  },
  {
    id: "pid", title: "Three gains, and windup",
    text: "The torque is kp times the error, plus ki times its sum over time, plus kd times the error of the speed. The arm hangs and must come "
      + "up. Each change starts the move again.",
    scene: (links) => controlled(links, 0.001, { integrator: { method: "rk4", timestep: 0.001 }, gains: SOFT[links] }),
    offset: [-Math.PI / 2, 0, 0],
    chart: "responses", dial: "gains",
    task: {
      text: "Show a sag without ki, an overshoot by too much ki, windup at 30 N m, and its cure.",
      done: ({ responses: { sag, overshoot, windup, cure } }) => sag && overshoot && windup && cure,
    },
    question: {
      text: "Why does the arm overshoot with the limit?",
      answers: ["The integral grew while the motor could not give more", "The motor is too strong", "The timestep is too long"], right: 0,
      because: "At its limit the motor cannot follow. The error stays, and the sum of it grows: windup. It falls only beyond the setpoint. A "
        + "cure stops the sum meanwhile.",
    },
  },
  {
    id: "look", title: "Look closely",
    text: "Each bar is the speed of the last joint at one measurement, computed without gravity after a tiny push. The arm itself starts beside "
      + "the pose that the controller holds. It moves in slow motion: two measurements a second.",
    scene: (links) => controlled(links, BEYOND[links]),
    offset: [0, 0.02, 0], paused: true,
    chart: "bars", dial: "period",
    task: { text: "Shorten the period until the bars shrink.", done: ({ shrinks, stable }) => shrinks && stable },
    question: {
      text: "At the first period the last bars pointed up and down in turn. Why?",
        answers: ["Each correction overshoots", "Gravity pulls it back", "The method rounds"], right: 0,
      because: "The torque is held too long. It pushes the joint past the target. At the first period the pushes grew.",
    },
  },
  {
    id: "method", title: "A better method?",
    text: "The method computes the motion between two measurements. Runge–Kutta 4 is far more exact than Euler. Try all four: does the limit of "
      + "the period move?",
    scene: (links) => controlled(links, BEYOND[links]),
    chart: "velocity", dial: "period", methods: true,
    task: { text: "Try all four methods at this period.", done: ({ methods }) => methods.size === ALL },
    question: {
      text: "Why does a better method not help?",
      answers: ["The controller still measures as rarely", "Euler is exact enough", "The controller is too weak"], right: 0,
      because: "This limit comes from the hold between two measurements. A real robot has no method, but such a limit too.",
    },
  },
  {
    id: "timestep", title: "A finer timestep?",
    text: "The simulation has its own clock, the timestep. A shorter one makes the computed motion more exact. The method and the control period "
      + "stay the same. They are named above the chart.",
    scene: (links) => controlled(links, WITHIN[links], { integrator: { method: "midpoint", timestep: WITHIN[links] } }),
    chart: "errors", dial: "timestep",
    task: { text: "Make the error of the method 100 times smaller.", done: ({ gain }) => gain >= MUCH },
    question: {
      text: "Which error hardly changed?", answers: ["That of the hold", "That of the method", "None"], right: 0,
      because: "A finer timestep improves the simulation, not the control. A shorter period would improve the control here.",
    },
  },
  {
    id: "limit", title: "What sets the limit",
    text: "More damping or less mass means that a held torque changes the speed faster. The controller must measure more often. The limit is "
      + "about T = 2 λmin(Kd⁻¹ M), with mass matrix M, damping Kd, smallest eigenvalue λmin.",
    scene: (links) => controlled(links, BEYOND[links]),
    chart: "map", dial: "damping",
    task: { text: "Change damping and mass until this period is stable.", done: ({ stable }) => stable },
    question: {
      text: "You halve the damping. What does the limit do?", answers: ["It halves", "It doubles", "It stays"], right: 1,
      because: "In the formula the damping is in the denominator: half of it gives twice the time. With far too little damping the formula no longer holds.",
    },
  },
  {
    id: "energy", title: "Without a controller",
    text: "Nothing drives this swing, so its energy should stay constant. Euler at 5 ms makes it grow. Each choice starts a new swing. Some "
      + "methods gain energy, others lose it, also where no motion looks wrong.",
    scene: (links) => ({ ...structuredClone(DEFAULTS[links]), integrator: { method: "euler", timestep: 0.005 }, controller: false }),
    chart: "energy", dial: "timestep", methods: true,
    task: {
      text: `At 5 ms, find a method that keeps the energy within ${KEPT} J for ${LONG} s.`,
      done: ({ energy }) => energy.timestep === STRIDE && energy.since < FIRST && energy.until >= LONG && energy.low >= -KEPT && energy.high <= KEPT,
    },
    question: {
      text: "Can Euler keep the energy with a shorter step?",
        answers: ["Yes, below 1 ms", "No, the energy only grows more slowly", "Yes, below 0.1 ms"], right: 1,
      because: "Without damping, Euler makes even a small swing wider, however short the step is. The other methods change it too, but far less: "
        + "this Verlet guesses a velocity, so it is not symplectic.",
    },
  },
  {
    id: "price", title: "The price of accuracy",
    text: "Each dot is one run, with its error and its run time. Solid lines show the error of the method. Dashed lines show the distance from a "
      + "controller without a hold. A cross marks a run that diverged.",
    scene: (links) => controlled(links, WITHIN[links]),
    chart: "ladder", dial: null,
    task: { text: "Measure the four methods.", done: ({ measured }) => measured },
    question: {
      text: "The control period stays the same. What does Runge–Kutta 4 at 0.25 ms improve?", answers: ["The robot", "Nearly nothing", "The limit"], right: 1,
      because: "Here the error of the hold is far larger than the error of the method. Reduce the larger one first.",
    },
  },
  {
    id: "extreme", title: "Stiff and extreme",
    text: "Twelve arms that are hard to simulate: light links, high gains, extreme numbers. Click a picture. Its correct motion is played "
      + "slowly, and beside it a motion with a method or a timestep that fails. The live arm starts too.",
    scene: (links) => structuredClone(DEFAULTS[links]),
    chart: "pictures", dial: null,
    task: { text: "Start three of them.", done: ({ scenes }) => scenes.size >= SOME_SCENES },
    question: {
      text: "Why does a last link of one milligram need short steps?", answers: ["It is hard to see", "It reacts very fast", "It stores much energy"], right: 1,
      because: "The same gain moves less mass faster, and a fast motion needs a short step.",
    },
  },
  {
    id: "own", title: "Your own arm",
    text: "Fill in your arm and the gains of its controller. The sheet shows the largest period and timestep that they allow, the reason, and "
      + "the benefit of a better method.",
    scene: (links) => controlled(links, 0.001),
    chart: "form", dial: null,
    task: { text: "Make the sheet of your arm.", done: ({ sheet }) => sheet },
    question: {
      text: "Your period is too long. What helps?", answers: ["A better method", "A faster controller or other gains", "A shorter timestep"], right: 1,
      because: "The gains and the arm set that limit. It belongs to a real robot too, which has no method and no timestep.",
    },
  },
];

/** Actions of the student in the present step. A task checks them. */
export function nothingSeen() {
  return {
    methods: /** @type {Set<string>} */ (new Set()), // methods used
    reached: false, // whether a goal was reached
    shook: false, // whether the arm shook beyond the limit
    shrinks: false, // whether the bars shrink
    gain: 1, // factor by which the method's error has decreased
    stable: false, // whether the active loop is stable
    measured: false, // whether the ladder is complete
    scenes: /** @type {Set<string>} */ (new Set()), // started scenes
    energy: { of: "", timestep: 0, since: Infinity, until: 0, low: 0, high: 0 }, // of the free swing; see `followEnergy`
    responses: { sag: false, overshoot: false, windup: false, cure: false }, // what they have shown
    sheet: false, // whether a sheet was made
  };
}

/**
 * The range of the energy [J] since a time [s]. The energy is 0 in the starting pose at rest. The range begins again with other settings
 * `of` the arm, and after a reset.
 * @param {Seen["energy"]} range @param {string} of @param {number} timestep @param {number} time @param {number} total
 */
export function followEnergy({ of: before, since, until, low, high }, of, timestep, time, total) {
  return of === before && time >= until
    ? { of, timestep, since, until: time, low: Math.min(low, total), high: Math.max(high, total) }
    : { of, timestep, since: time, until: time, low: total, high: total };
}

/** The ids of steps in a text, such as the ticks that the browser keeps or a link carries. @param {string | null} text @returns {string[]} */
export function stepsIn(text) {
  return (text ?? "").split(",").filter((id) => STEPS.some((one) => one.id === id));
}

/** Whether a deviation decays: its last bars compared with its first ones. @param {number[]} bars */
export function shrinks(bars) {
  const largest = (/** @type {number[]} */ some) => Math.max(...some.map(Math.abs));
  const third = Math.floor(bars.length / 3);
  return third > 0 && largest(bars.slice(-third)) < largest(bars.slice(0, third));
}

/** "5.5 of 4.3 ms": a time and its limit. @param {number} time [ms] @param {number} limit [ms] */
export function ofLimit(time, limit) {
  const short = (/** @type {number} */ ms) => String(Number(ms.toPrecision(2)));
  if (!(time >= 0)) return "–";
  if (Number.isNaN(limit) || limit === Infinity) return `${short(time)} ms`;
  return limit === 0 ? `${short(time)} ms, none known as stable` : `${short(time)} of ${short(limit)} ms`;
}

/** The steps by the numbers of older links. */
const NUMBERED = ["hold", "slow", "look", "method", "timestep", "limit", "energy", "price", "extreme", "own"];

/** The step that a link names, from 0; -1 if it names none. @param {string} hash */
export function stepIn(hash) {
  const named = new URLSearchParams(hash.replace(/^#/, "")).get("step") ?? "";
  return STEPS.findIndex(({ id }) => id === (NUMBERED[Number(named) - 1] ?? named));
}
