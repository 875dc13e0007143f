// @ts-check
// Two rollouts on one clock: sample counts at which both are on the same instants, and a cubic in between where they are not.
// The cubic matches positions and velocities at both ends (Hermite), so between samples it is off by the fourth power of their distance.
// Invariant: where a run has a sample at the very instant, that sample is taken as it is.

/** Enough for a smooth trail, few enough to draw at once. */
const MOST = 601;
const LEAST = 61;
const SAME = 1e-6; // of a timestep

/** How many samples, so that their distance is a whole number of both timesteps; `MOST` where no number will do. */
export function commonSamples(duration, timesteps) {
  const whole = (ratio) => Math.round(ratio) >= 1 && Math.abs(ratio - Math.round(ratio)) < SAME * Math.max(1, ratio);
  for (let count = MOST; count >= LEAST; count -= 1) {
    if (timesteps.every((timestep) => whole(duration / (count - 1) / timestep))) return count;
  }
  return MOST;
}

/** Joint positions of `run` at each of `times`; `null` past its end and where it is not finite. */
export function resample({ times, positions, velocities }, wanted) {
  const usable = (k) => positions[k]?.every(Number.isFinite) && velocities[k]?.every(Number.isFinite);
  let k = 0;
  return wanted.map((time) => {
    const near = 1e-9 * Math.max(1, time);
    while (k + 1 < times.length && times[k + 1] <= time + near) k += 1;
    if (!usable(k)) return null;
    if (Math.abs(times[k] - time) <= near) return positions[k];
    if (k + 1 >= times.length || !usable(k + 1)) return null;
    const h = times[k + 1] - times[k];
    const s = (time - times[k]) / h;
    return positions[k].map((q, i) => {
      const change = positions[k + 1][i] - q;
      const [v, w] = [h * velocities[k][i], h * velocities[k + 1][i]];
      return q + s * (v + s * (3 * change - 2 * v - w + s * (v + w - 2 * change)));
    });
  });
}
