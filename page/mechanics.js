// The arm's geometry, gravity load and energy from its state, only for drawing: the runtime computes the motion. Angles are in
// rad, each relative to the previous link. Link i has length l[i] and mass m[i], with its centre in the middle.
// Invariant: what is needed for a picture allocates nothing. Its results are written to the caller's arrays.

/** Ends of each link into `x`, `y`: entry 0 is the base, entry i the end of link i. */
export function joints(n, q, l, x, y) {
  let phi = 0;
  x[0] = 0;
  y[0] = 0;
  for (let i = 0; i < n; i += 1) {
    phi += q[i];
    x[i + 1] = x[i] + l[i] * Math.cos(phi);
    y[i + 1] = y[i] + l[i] * Math.sin(phi);
  }
}

/** Gravity load G(q) [N m] into `load` from index `at`: the effort that holds the arm still. */
export function gravityLoad(n, q, arm, load, at = 0) {
  const { gravity, masses, lengths } = arm;
  let phi = 0;
  for (let i = 0; i < n; i += 1) phi += q[i];
  let beyond = 0; // mass beyond link k
  let sum = 0;
  for (let k = n - 1; k >= 0; k -= 1) {
    sum += (masses[k] / 2 + beyond) * lengths[k] * Math.cos(phi);
    load[at + k] = gravity * sum;
    beyond += masses[k];
    phi -= q[k];
  }
}

/** The mass matrix [kg m²] and the gradient of the gravity load [N m/rad] in a pose, by rows. @param {number[]} q @param {import("./question.js").Arm} arm */
export function linearised(q, { gravity, masses, lengths }) {
  const angles = q.map((_, k) => reach(q.slice(0, k + 1)));
  const beyond = masses.map((_, k) => reach(masses.slice(k + 1)));
  /** Inertia that couples the turning of two links. */
  const between = (/** @type {number} */ k, /** @type {number} */ l) => {
    const outer = Math.max(k, l);
    return lengths[k] * lengths[l] * (masses[outer] / (k === l ? 3 : 2) + beyond[outer]) * Math.cos(angles[k] - angles[l]);
  };
  const lift = (/** @type {number} */ k) => -gravity * lengths[k] * (masses[k] / 2 + beyond[k]) * Math.sin(angles[k]);
  const rows = (/** @type {(i: number, j: number) => number} */ entry) => q.map((_, i) => q.map((__, j) => entry(i, j)));
  // A joint turns its own link and all links beyond it.
  const turned = (/** @type {number} */ i) => q.map((_, k) => k).slice(i);
  return {
    mass: rows((i, j) => reach(turned(i).flatMap((k) => turned(j).map((l) => between(k, l))))),
    stiffness: rows((i, j) => reach(turned(Math.max(i, j)).map(lift))),
  };
}

/** Kinetic and potential energy [J]. The latter is 0 in the starting pose, stretched along x. */
export function energies(n, q, qd, { gravity, masses, lengths }) {
  let [phi, omega, y, kinetic, potential] = [0, 0, 0, 0, 0];
  let [vx, vy] = [0, 0]; // velocity of the joint before the link
  for (let i = 0; i < n; i += 1) {
    phi += q[i];
    omega += qd[i];
    const c = (lengths[i] * Math.cos(phi)) / 2;
    const s = (lengths[i] * Math.sin(phi)) / 2;
    const spin = (lengths[i] * lengths[i] * omega * omega) / 12;
    kinetic += (masses[i] * ((vx - s * omega) ** 2 + (vy + c * omega) ** 2 + spin)) / 2;
    potential += masses[i] * gravity * (y + s);
    vx -= 2 * s * omega;
    vy += 2 * c * omega;
    y += 2 * s;
  }
  return { kinetic, potential };
}

/** The sum of the lengths, or of other numbers. @param {number[]} lengths */
export function reach(lengths) {
  return lengths.reduce((sum, one) => sum + one, 0);
}

/** Radius of the disc around the base that the end effector cannot enter; 0 if there is none. */
export function innerReach(lengths) {
  return Math.max(0, 2 * Math.max(...lengths) - reach(lengths));
}

/** The reachable position of the end effector nearest to the given one [m]. `lengths` are those of the links. */
export function nearestInReach({ x, y }, lengths) {
  const distance = Math.hypot(x, y);
  const near = Math.min(reach(lengths), Math.max(innerReach(lengths), distance));
  if (near === distance) return { x, y };
  // From the base itself all directions are equally near.
  return distance > 0 ? { x: x * (near / distance), y: y * (near / distance) } : { x: near, y: 0 };
}

/** `angle` shifted by whole turns to within pi of `near`. */
export function nearestTurn(angle, near) {
  return angle + 2 * Math.PI * Math.round((near - angle) / (2 * Math.PI));
}
