"""The predicted limit of the control period against the first one at which a push grows in MuJoCo itself.

Each model has gravity and no constraints. A law of its own holds it at its first pose: kp and kd give each degree of
freedom, on its effective inertia, 50 rad/s and a damping ratio of 1. A push of 1e-7 rad/s is watched for some thousand periods.

    python mujoco_limits.py [--integrator implicitfast] [--steps 1] [--delay 0] [--periods 3000] FILE.xml ...

Without files: the models of `dm_control` and `robosuite` that are installed.
"""

import argparse
import importlib.util
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import mujoco
import numpy as np

import pendularm.mujoco

def files():
    for package, pattern in (("dm_control", "suite/*.xml"), ("robosuite", "models/assets/robots/*/robot.xml")):
        spec = importlib.util.find_spec(package)
        if spec is not None:
            yield from sorted(Path(spec.submodule_search_locations[0]).glob(pattern))


def grows(model, period, steps, delay, law, periods):
    """Whether the push grows: the largest deviation of the last third is above that of the second."""
    data = mujoco.MjData(model)
    model.opt.timestep = period / steps
    mujoco.mj_forward(model, data)
    pose, holding = data.qpos.copy(), data.qfrc_bias - data.qfrc_passive
    data.qvel[:] = 1e-7 * np.random.default_rng(1).normal(size=model.nv)
    efforts = [holding] * delay
    off, largest = np.zeros(model.nv), []
    for _ in range(periods):
        mujoco.mj_differentiatePos(model, off, 1.0, pose, data.qpos)
        efforts.append(holding - law["kp"] * off - law["kd"] * data.qvel)
        data.qfrc_applied[:] = efforts.pop(0)
        for _ in range(steps):
            mujoco.mj_step(model, data)
        largest.append(max(np.abs(off).max(), period * np.abs(data.qvel).max()))
        if not largest[-1] < 1e-3:
            return True
    second, last = max(largest[periods // 3 : 2 * periods // 3]), max(largest[2 * periods // 3 :])
    return last > max(second, 1e-11)


def measured(model, predicted, *rest):
    low, high = 0.8 * predicted, 1.25 * predicted
    if grows(model, low, *rest) or not grows(model, high, *rest):
        return None
    while high > 1.0001 * low:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if grows(model, middle, *rest) else (middle, high)
    return (low * high) ** 0.5


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--integrator", choices=["Euler", "implicitfast"], default="Euler")
    parser.add_argument("--steps", type=int, default=1)
    parser.add_argument("--delay", type=int, default=0)
    parser.add_argument("--periods", type=int, default=3000)
    options = parser.parse_args()
    names = "mujoco", "dm_control", "robosuite"
    for name in names:
        try:
            print(f"{name} {version(name)}", end="; ")
        except PackageNotFoundError:
            pass
    print(f"{options.integrator}, steps {options.steps}, delay {options.delay}\n")
    print("| model | dofs | predicted (ms) | in MuJoCo (ms) | ratio |\n| --- | --- | --- | --- | --- |")
    worst = 0.0
    for file in options.files or files():
        name = file.parent.name if file.stem == "robot" else file.stem
        try:
            model = mujoco.MjModel.from_xml_path(str(file))
        except ValueError as why:
            print(f"{name}: {why}", file=sys.stderr)
            continue
        if model.nv == 0:
            continue
        flags = mujoco.mjtDisableBit
        model.opt.disableflags |= flags.mjDSBL_CONSTRAINT | flags.mjDSBL_ACTUATION
        model.opt.integrator = getattr(mujoco.mjtIntegrator, "mjINT_" + options.integrator.upper())
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        mass = pendularm.mujoco.matrices(model, data)["M"]
        inertia = 1.0 / np.diag(np.linalg.inv(mass))
        law = {"kp": 2500.0 * inertia, "kd": 100.0 * inertia}
        model.opt.timestep = 1e-3
        try:
            limit = pendularm.mujoco.held_limit(
                model, data, period=1e-3 * options.steps, delay=options.delay, **law
            ).period_limit
        except ValueError as why:
            print(f"{name}: {why}", file=sys.stderr)
            continue
        if limit in (0.0, np.inf):
            print(f"| {name} | {model.nv} | {'none' if limit else 'unstable at every period'} | | |", flush=True)
            continue
        found = measured(model, limit, options.steps, options.delay, law, options.periods)
        ratio = found / limit if found else float("nan")
        worst = max(worst, abs(ratio - 1.0)) if found else worst
        shown = f"{1e3 * found:.4f} | {ratio:.5f}" if found else "none within 25 % | "
        print(f"| {name} | {model.nv} | {1e3 * limit:.4f} | {shown} |", flush=True)
    print(f"\nlargest difference: {100 * worst:.3f} %")


if __name__ == "__main__":
    main()
