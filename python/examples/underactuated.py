"""Swings up an arm that has one motor, and holds it: energy shaping, then an LQR near the upright pose.

    pip install "$(ls python/target/wheels/*.whl)[gym]"
    python python/examples/underactuated.py [starts]

The motor first drives energy, its joint and the joint's rate to those of the motion that ends upright (Xin and Kaneda,
Analysis of the energy-based swing-up control of the Acrobot, 2007). `pendularm.linearize` gives the linear system near
the upright pose, and so an LQR. The LQR takes over as soon as a simulation shows that it holds the arm, at once or after
up to 0.35 s of constant effort.
"""

import sys

import gymnasium
import numpy as np

import pendularm
import pendularm.envs

STEP = 0.05
PLANS = [(effort, steps) for effort in np.linspace(-1.0, 1.0, 9) for steps in range(1, 8)]
UP = np.array([np.pi / 2, 0.0])
ARM = pendularm.Arm()
# A little more than that of the upright arm.
ENERGY = pendularm.dynamics.potential_energy(ARM, UP) + 1.2

# The driven joint, the largest effort [N m], and the gains of its position, its acceleration and its rate: while energy is
# missing, and near the energy of the upright arm.
TASKS = {
    "PendularmAcrobot-v0": (1, 19.62, (11.3, 18.6, 13.1), (50.5, 15.0, 11.0)),
    "PendularmPendubot-v0": (0, 19.62, (108.3, 122.2, 58.3), (108.3, 122.2, 58.3)),
}
MISSING = 12.0


def lqr(joint):
    """The gains for the upright arm, under an effort that is held for a step."""
    a, b = pendularm.linearize(ARM, UP)
    # The exponential of the matrix, by its series and squaring.
    plant = np.zeros((5, 5))
    plant[:4, :4], plant[:4, 4] = a, b[:, joint]
    term, held = np.eye(5), np.eye(5)
    for order in range(1, 13):
        term = term @ plant * (STEP / 2**6 / order)
        held = held + term
    held = np.linalg.matrix_power(held, 2**6)
    a, b = held[:4, :4], held[:4, 4:]
    cost, q, r = np.eye(4), np.diag([1.0, 1.0, 10.0, 10.0]), 0.01
    for _ in range(2000):
        gain = np.linalg.solve(r + b.T @ cost @ b, b.T @ cost @ a)
        cost = q + a.T @ cost @ (a - b @ gain)
    return gain[0]


class Baseline:
    """A policy for many arms: actions (arms, 1) from observations (arms, 6)."""

    def __init__(self, name):
        self.joint, self.limit, *self.shaping = TASKS[name]
        self.gain, self.motor = lqr(self.joint), np.eye(2)[self.joint]

    def __call__(self, seen):
        q, qd = np.arctan2(seen[:, 2:4], seen[:, :2]), seen[:, 4:].astype(float)
        effort = self.swing(q, qd)
        near = np.flatnonzero(pendularm.end_effector(ARM, q)[:, 1] > 1.0)
        if near.size:
            effort[near] = self.catch(q[near], qd[near], effort[near])
        return np.clip(effort / self.limit, -1.0, 1.0)[:, None].astype(np.float32)

    def balance(self, q, qd):
        away = (q - UP + np.pi) % (2 * np.pi) - np.pi
        return -np.concatenate([away, qd], axis=1) @ self.gain

    def catch(self, q, qd, otherwise):
        """The effort after which the LQR holds an arm, if one is found by simulation: the LQR's, or a constant one."""
        effort = otherwise.copy()
        left = np.arange(len(q))
        for plans in [[(0.0, 0)], PLANS]:
            first, held = self.simulated(q[left], qd[left], plans)
            row = held.argmax(axis=1)
            caught = held.any(axis=1)
            effort[left[caught]] = first[caught, row[caught]]
            left = left[~caught]
            if not left.size:
                break
        return effort

    def simulated(self, q, qd, plans):
        """The first effort of each plan for each arm, and whether the arm is up after 2 s. A plan has an effort, relative
        to the limit, and the number of steps after which the LQR begins."""
        arms = len(q)
        efforts, begins = np.tile(np.array(plans).T, arms)
        ahead = pendularm.Batch(arms * len(plans))
        ahead.set_integrator("rk4", STEP / 4)
        ahead.set_limits(self.motor * self.limit)
        ahead.set_state(np.repeat(q, len(plans), axis=0), np.repeat(qd, len(plans), axis=0))
        for step in range(40):
            effort = np.where(step < begins, efforts * self.limit, self.balance(ahead.position, ahead.velocity))
            first = effort if step == 0 else first
            ahead.step(4, effort[:, None] * self.motor)
        held = (ahead.end_effector[:, 1] > 1.98) & (np.abs(ahead.velocity) < 0.5).all(axis=1)
        return first.reshape(arms, -1), held.reshape(arms, -1)

    def swing(self, q, qd):
        joint = self.joint
        excess = pendularm.dynamics.kinetic_energy(ARM, q, qd) + pendularm.dynamics.potential_energy(ARM, q) - ENERGY
        far, near = self.shaping
        of_position, of_acceleration, of_rate = np.where(excess[:, None] < -MISSING, far, near).T
        free = pendularm.dynamics.forward_dynamics(ARM, q, qd, [0.0, 0.0])[:, joint]
        mobility = pendularm.dynamics.forward_dynamics(ARM, q, qd, self.motor)[:, joint] - free
        # The jump at half a turn is not where the arm starts.
        away = (q[:, joint] - UP[joint] + np.pi + 0.5) % (2 * np.pi) - np.pi - 0.5
        wanted = of_position * away + of_rate * qd[:, joint] + of_acceleration * free
        return -wanted / (excess + of_acceleration * mobility)


def solved(name, starts, policy, seed=0):
    """Whether each start ends with the arm held up for 5 s."""
    env = gymnasium.make_vec(name, starts, autoreset_mode="Disabled")
    seen, _ = env.reset(seed=seed)
    success, failed = np.zeros(starts, bool), np.zeros(starts, bool)
    while not (success | failed).all():
        seen, _, lost, cut, info = env.step(policy(seen))
        success |= info["is_success"] & ~failed
        failed |= (lost | cut) & ~success
        if (lost | cut).any():
            env.reset(options={"reset_mask": lost | cut})
    env.close()
    return success


if __name__ == "__main__":
    starts = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for name in TASKS:
        print(f"{name}: {solved(name, starts, Baseline(name)).sum()} of {starts} starts are held for 5 s")
