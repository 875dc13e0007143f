"""The equation of motion, ``M(q) qdd + C(q, qd) qd + G(q) = effort``: the functions that step the live arm.

Each takes an arm and one state, (links,), or many, (n, links). A single row, (links,) or (1, links), is combined with
every row of the others. Values that are not finite are refused. The interpreter's lock is released for many states.
"""

from ._native import (
    coriolis,
    forward_dynamics,
    gravity_load,
    inverse_dynamics,
    kinetic_energy,
    mass_matrix,
    potential_energy,
)

__all__ = [
    "coriolis",
    "forward_dynamics",
    "gravity_load",
    "inverse_dynamics",
    "kinetic_energy",
    "mass_matrix",
    "potential_energy",
]
