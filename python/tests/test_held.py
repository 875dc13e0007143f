"""`held_limit`, and that of a MuJoCo model against MuJoCo itself."""

import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

import pendularm

ROOT = Path(__file__).parents[2]


def test_pd_control_is_stable_up_to_twice_the_least_time_constant():
    rng = np.random.default_rng(3)
    for joints in (1, 3, 7, 12):
        root = rng.normal(size=(joints, joints))
        mass = root @ root.T + 0.1 * np.eye(joints)
        kd = rng.uniform(1, 10, joints)
        # The eigenvalues of L⁻¹ Kd L⁻ᵀ, where M = L Lᵀ.
        half = np.linalg.inv(np.linalg.cholesky(mass))
        expected = 2 / np.linalg.eigvalsh(half @ np.diag(kd) @ half.T).max()
        for gains in (kd, np.diag(kd), kd.tolist()):
            found = pendularm.held_limit(mass, kd=gains)
            assert found.period_limit == pytest.approx(expected, rel=1e-9)
            assert found.critical.reverses and found.stable is None
        np.testing.assert_allclose(found.effective_inertia, 1 / np.diag(np.linalg.inv(mass)), rtol=1e-9)


def test_an_answer_has_the_members_of_the_service():
    answer = pendularm.held_limit(np.diag([0.1, 0.0004]), kp=20, kd=0.5, period=0.004)
    page = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"^\| `/study/held_limit` \|.*\| (.*) \|$", page, re.MULTILINE)
    assert list(asdict(answer)) == re.findall(r"`(\w+)`", row)
    assert answer.stable is False and answer.armature == pytest.approx(0.0006)
    assert "joint[1]: kd 0.5 N m s/rad needs an effective inertia of at least 0.001 kg m^2" in answer.explanation


def test_a_timestep_is_a_part_of_the_period():
    steps = pendularm.held_limit([[1.0]], kp=100, kd=10, between="euler", period=0.02, steps=4)
    given = pendularm.held_limit([[1.0]], kp=100, kd=10, between="euler", period=0.02, timestep=0.005)
    assert given.period_limit == steps.period_limit
    with pytest.raises(ValueError, match="^period must be a whole number of timesteps, got 0.02 and 0.003$"):
        pendularm.held_limit([[1.0]], period=0.02, timestep=0.003)


ARM = """<mujoco><option timestep="0.002" integrator="{integrator}"/><worldbody><body>
  <joint name="one" axis="0 1 0" damping="0.2" stiffness="3"/><geom type="capsule" size=".03" fromto="0 0 0 .4 0 0"/>
  <body pos=".4 0 0"><joint name="two" axis="0 1 0" armature="0.001"/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/>
  </body></body></worldbody>
  <actuator><position joint="one" kp="{kp}" kv="{kv}"/><position joint="two" kp="{kp}" kv="{kv}"/></actuator></mujoco>"""


def grows(mujoco, model, period, steps, delay, gains):
    """Whether a small push grows, with a law of one's own or with the actuators of the model."""
    data = mujoco.MjData(model)
    model.opt.timestep = period / steps
    data.qpos[:] = pose = 0.3, -0.5
    data.ctrl[:] = pose
    mujoco.mj_forward(model, data)
    holding = data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator
    data.qvel[:] = 1e-7, -2e-7
    late, largest = [holding] * delay, []
    for _ in range(2000):
        law = -gains[0] * (data.qpos - pose) - gains[1] * data.qvel if gains else 0.0
        late.append(holding + law)
        data.qfrc_applied[:] = late.pop(0)
        for _ in range(steps):
            mujoco.mj_step(model, data)
        largest.append(np.abs(data.qpos - pose).max() + period * np.abs(data.qvel).max())
        if not largest[-1] < 1e-2:
            return True
    return max(largest[1500:]) > max(max(largest[1000:1500]), 1e-11)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
@pytest.mark.parametrize(("own", "steps", "delay"), [(True, 1, 0), (True, 4, 0), (True, 1, 1), (True, 3, 2), (False, 1, 0)])
def test_a_push_grows_in_mujoco_just_beyond_the_limit(integrator, own, steps, delay):
    mujoco = pytest.importorskip("mujoco")
    import pendularm.mujoco

    if integrator == "RK4" and not own:
        return  # Its actuators run in every stage, which is no held law.
    kp, kv = (0, 0) if own else (40, 1)
    model = mujoco.MjModel.from_xml_string(ARM.format(integrator=integrator, kp=kp, kv=kv))
    data = mujoco.MjData(model)
    data.qpos[:] = data.ctrl[:] = 0.3, -0.5
    gains = (20.0, 1.0) if own else None
    law = {"kp": gains[0], "kd": gains[1]} if own else {}
    found = pendularm.mujoco.held_limit(model, data, period=steps * 0.002, delay=delay, **law)
    limit = found.period_limit
    assert not grows(mujoco, model, 0.998 * limit, steps, delay, gains), limit
    assert grows(mujoco, model, 1.002 * limit, steps, delay, gains), limit


def test_an_integrator_or_a_law_that_has_no_prediction_is_refused():
    mujoco = pytest.importorskip("mujoco")
    import pendularm.mujoco

    model = mujoco.MjModel.from_xml_string(ARM.format(integrator="Euler", kp=40, kv=1))
    with pytest.raises(ValueError, match="^kd of actuators must be 0 with Euler"):
        pendularm.mujoco.held_limit(model, mujoco.MjData(model), kp=1.0, period=0.01)
    with pytest.raises(ValueError, match="^period must be"):
        pendularm.mujoco.held_limit(model, mujoco.MjData(model), kp=1.0, period=-1.0)
