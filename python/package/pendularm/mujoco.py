"""The largest stable control period of a MuJoCo model. It needs `mujoco`: ``pip install pendularm[mujoco]``."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import mujoco

from ._fields import Floats
from .held import Between, HeldLimit, held_limit as _held_limit

__all__ = ["held_limit", "matrices"]

_EPSILON = 1e-6


def matrices(model: Any, data: Any) -> dict[str, Floats]:
    """The matrices of a model at the pose of `data`, at rest and under its controls, by MuJoCo's own functions.

    `M` is the mass matrix with the armatures. `stiffness` and `damping` are those of gravity, springs and passive
    dampers, and `kp` and `kd` those of the actuators. They are central differences of MuJoCo's forces. Contacts and
    other constraints have no part in them.
    """
    if model.nv == 0:
        raise ValueError("model must have a degree of freedom")
    at = mujoco.MjData(model)
    mujoco.mj_copyData(at, model, data)
    at.qvel[:] = 0.0
    at.qfrc_applied[:] = 0.0
    pose, dofs = at.qpos.copy(), model.nv

    def forces(joint: int, turned: float, speed: float) -> tuple[Floats, Floats]:
        unit = np.zeros(dofs)
        unit[joint] = 1.0
        at.qpos[:] = pose
        mujoco.mj_integratePos(model, at.qpos, unit, turned)
        at.qvel[:] = speed * unit
        mujoco.mj_fwdPosition(model, at)
        mujoco.mj_fwdVelocity(model, at)
        mujoco.mj_fwdActuation(model, at)
        return at.qfrc_passive - at.qfrc_bias, at.qfrc_actuator.copy()

    found = {name: np.zeros((dofs, dofs)) for name in ("M", "stiffness", "kp", "damping", "kd")}
    for joint in range(dofs):
        for turned, speed, names in ((_EPSILON, 0.0, ("stiffness", "kp")), (0.0, _EPSILON, ("damping", "kd"))):
            more, less = forces(joint, turned, speed), forces(joint, -turned, -speed)
            for name, above, below in zip(names, more, less, strict=True):
                found[name][:, joint] = (below - above) / (2.0 * _EPSILON)
    forces(0, 0.0, 0.0)
    mujoco.mj_fullM(model, at, found["M"])
    return found


def held_limit(
    model: Any,
    data: Any,
    *,
    kp: ArrayLike | None = None,
    kd: ArrayLike | None = None,
    ki: ArrayLike | None = None,
    period: float | None = None,
    delay: int = 0,
) -> HeldLimit:
    """As `pendularm.held_limit`, for a model at the pose of `data`, with the model's integrator.

    Without gains the law is that of the model's actuators, which run in every timestep. With `kp`, `kd` or `ki`, one
    number for all degrees of freedom, one for each, or n×n, it is a law of your own that sets `qfrc_applied`, or the
    torques of motors, once a `period` [s] (default: one timestep). Contacts, limits and other constraints are left out.
    """
    of, opt = matrices(model, data), model.opt
    kinds = mujoco.mjtIntegrator
    damping, own_kp, own_kd = of["damping"], of["kp"], of["kd"]
    length = opt.timestep if period is None else period
    steps = max(1, round(length / opt.timestep)) if np.ndim(length) == 0 and length > 0 else 1
    stiffness = of["stiffness"] + own_kp
    between: Between = "implicit"
    law: dict[str, Any] = {"kp": kp, "kd": kd, "ki": ki}
    if opt.integrator == kinds.mjINT_EULER:
        # Only the damping of joints is implicit, and the actuators' is not.
        if opt.disableflags & mujoco.mjtDisableBit.mjDSBL_EULERDAMP:
            between, damping = "semi_implicit", damping + own_kd
        elif own_kd.any():
            if steps > 1 or delay:
                raise ValueError("kd of actuators must be 0 with Euler if your own law is slower: use implicitfast")
            extra = np.zeros(model.nv) if kd is None else np.asarray(kd, dtype=float)
            law["kd"] = own_kd + (extra if extra.ndim == 2 else np.diag(np.broadcast_to(extra, model.nv)))
    elif opt.integrator in (kinds.mjINT_IMPLICIT, kinds.mjINT_IMPLICITFAST):
        damping = damping + own_kd
    elif opt.integrator == kinds.mjINT_RK4:
        between, damping = "rk4", damping + own_kd
    else:
        raise ValueError(f"the integrator must be Euler, implicit, implicitfast or RK4, got {opt.integrator}")
    return _held_limit(
        of["M"], damping=damping, stiffness=stiffness, period=length, delay=delay, between=between, steps=steps, **law
    )
