"""The arm of pendularm: one (`Simulation`), many at once (`Batch`), its equation of motion (`dynamics`) and its study.

All units are SI. Angles are in rad, counter-clockwise, each relative to the previous link. Names are those of the
services of the live runtime. The command `pendularm`, or `python -m pendularm`, starts this runtime.

A wrong value raises a `ValueError` that names its field.
"""

from importlib.metadata import version as _version

from . import dynamics
from ._native import Arm, Batch, Divergence, Simulation, default_gains, end_effector, inverse_kinematics, linearize
from ._page import Page, page
from ._ray import RayExecutor
from .held import HeldLimit, HeldMode, held_limit
from .method import Method, MethodAnalysis
from .report import read_report
from .scores import score, submission
from .study import Critical, OwnPlan, Plan, Rollout, Stability, SuggestedGains, plan, rollout, stability, suggest_gains
from .sweep import Run, Sweep, sweep

__version__ = _version("pendularm")

__all__ = [
    "Arm",
    "Batch",
    "Critical",
    "Divergence",
    "HeldLimit",
    "HeldMode",
    "Method",
    "MethodAnalysis",
    "OwnPlan",
    "Page",
    "Plan",
    "RayExecutor",
    "Rollout",
    "Run",
    "Simulation",
    "Stability",
    "SuggestedGains",
    "Sweep",
    "default_gains",
    "dynamics",
    "end_effector",
    "held_limit",
    "inverse_kinematics",
    "linearize",
    "page",
    "plan",
    "read_report",
    "rollout",
    "score",
    "stability",
    "submission",
    "suggest_gains",
    "sweep",
]
