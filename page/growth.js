// @ts-check
// The loop in force as a linear system, for the pictures of its modes.
// Invariant: it is about the pose that the limit is about.

import { isFree, loopAt, noGains, restPose } from "./loop.js";
import { answerInForce } from "./policy.js";

/** The loop in force about the pose where it rests; null while it is not known. */
export function loopInForce(/** @type {any} */ state) {
  const { links, params, gains, enabled, setpoint } = state;
  if (!params || !gains || enabled == null || gains.kp.length !== links || params.masses.length !== links) return null;
  const acting = enabled ? gains : noGains(links);
  const pose = answerInForce(state)?.equilibrium ?? restPose(params, acting, Array.from(setpoint.subarray(0, links)));
  return { loop: loopAt(params, acting, pose), free: isFree(acting), pose };
}
