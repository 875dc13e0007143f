"""Closes a control loop over the wire at 100 Hz of simulation time: closed_loop.py [pd|lqr HOST PORT].

The arm is paused. It moves only by `/arm_sim/step`, one control period per call, with the effort of the call.
No clock takes part, so every run gives the same bits. For `lqr`, one period is linearised at the goal by central
differences of `pendularm.Simulation`, and the discrete Riccati equation is iterated. Prints time, position and velocity
after 4 s.
"""

import json
import socket
import sys

import numpy as np

import pendularm

law, host, port = sys.argv[1:] or ["lqr", "127.0.0.1", "9095"]
if law not in ("pd", "lqr"):
    sys.exit(f"the law must be pd or lqr, got {law}")
wire = socket.create_connection((host, port), timeout=60).makefile("rw")


def call(service: str, **args: object) -> dict:
    print(json.dumps({"op": "call_service", "service": service, "args": args}), file=wire, flush=True)
    return json.loads(next(wire))["values"]


call("/arm_sim/pause", data=True)
settings, params = call("/arm_sim/set_integrator"), call("/arm_sim/set_params")
arm = pendularm.Arm(len(params["lengths"]), **params)
goal, steps = np.array([0.8, -0.6, 0.4])[: arm.links], round(0.01 / settings["timestep"])
load = pendularm.dynamics.gravity_load(arm, goal)

# Maps the state error to the effort, (links, 2 links): a PD controller.
gains = np.hstack([np.diag([200, 100, 40][: arm.links]), np.diag([30, 12, 4][: arm.links])])
if law == "lqr":
    model = pendularm.Simulation(arm, **settings)

    def after_period(start: np.ndarray) -> np.ndarray:
        position, velocity, effort = np.split(start, 3)
        model.set_state(position, velocity)
        model.step(steps, effort)
        return np.concatenate([model.position, model.velocity])

    start, small = np.concatenate([goal, 0 * goal, load]), 1e-5 * np.eye(3 * arm.links)
    slopes = np.array([after_period(start + way) - after_period(start - way) for way in small]).T / 2e-5
    a, b = slopes[:, : 2 * arm.links], slopes[:, 2 * arm.links :]
    cost = of_state = np.diag([1000] * arm.links + [10] * arm.links)
    for _ in range(2000):
        gains = np.linalg.solve(0.01 * np.eye(arm.links) + b.T @ cost @ b, b.T @ cost @ a)
        cost = of_state + a.T @ cost @ (a - b @ gains)

now = {**call("/arm_sim/reset"), "time": 0.0}
while now["time"] < 4:
    error = np.concatenate([goal - now["position"], np.negative(now["velocity"])])
    now = call("/arm_sim/step", steps=steps, effort=(load + gains @ error).tolist())
print(json.dumps([now["time"], now["position"], now["velocity"]]))
