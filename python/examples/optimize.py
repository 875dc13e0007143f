"""Gains by Optuna with ask and tell: each batch of trials is one `Batch`. Needs `pip install "$(ls
python/target/wheels/*.whl)" optuna`. Prints the largest distance from the setpoint in the second half of a move."""

import numpy as np
import optuna

import pendularm

optuna.logging.set_verbosity(optuna.logging.WARNING)
study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
setpoint, batch = [0.8, -0.5], pendularm.Batch(64)
batch.set_limits(effort_limit=[60.0, 20.0])
for _ in range(10):
    trials = [study.ask() for _ in range(len(batch))]
    kp, kd = ([[one.suggest_float(f"{gain}{joint}", *of, log=True) for joint in "12"] for one in trials]
              for gain, of in [("kp", (10, 1000)), ("kd", (1, 100))])
    batch.set_gains(kp, 0.0 * np.array(kp), kd)
    batch.enable(False)
    batch.reset()
    batch.set_setpoint(setpoint)
    batch.enable()
    batch.step(1000)
    error = np.zeros(len(batch))
    for _ in range(100):
        batch.step(10)
        error = np.maximum(error, np.abs(batch.position - setpoint).max(axis=1))
    for trial, value in zip(trials, np.where(batch.diverged, 1e3, error), strict=True):
        study.tell(trial, value)
print(f"{study.best_value:.4f} rad with {study.best_params}")
