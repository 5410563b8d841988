"""A fit whose base parameters are those of bodies that there can be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.fitting.parameters.parameter_block import free_blocks
from frictionid.fitting.torque_balance.solve import (
    TorqueProblem,
    TorqueSettings,
    TorqueSolution,
    solve,
)
from frictionid.mechanics.rigid_body.rigid_body_tree import RigidBodyTree, nearest_consistent

_HELD = 1e6  # how much better than the data know the others base parameters are held that are fixed


def made_consistent(
    problem: TorqueProblem, solution: TorqueSolution, use: Array, settings: TorqueSettings
) -> TorqueSolution:
    """The solution with consistent base parameters: the nearest by the information of the fit.

    What else is free is fitted once more beside them.

    Raises
    ------
    InputError
        For mechanisms whose bodies are not known.
    """
    mechanism = solution.estimate.mechanism
    own = next((b for b in problem.blocks if b.block.enters == "base"), None)
    if own is None or not own.parameters:
        return solution
    if not isinstance(mechanism, RigidBodyTree):
        raise InputError(
            f"consistent = true needs the bodies of a URDF or MJCF, which {mechanism.kind} does "
            "not have: leave it out; base parameters stay on a path on which M(q) is positive"
        )
    places = [p.place[0] for p in own.parameters]
    metric = _information(problem, solution, places, len(mechanism.base_names))
    wanted = np.asarray(solution.estimate.calibration.base, dtype=float)
    base = nearest_consistent(mechanism, wanted, metric)
    fixed = np.setdiff1d(np.arange(len(base)), places)
    base[fixed] = wanted[fixed]
    held = solution.estimate._replace(calibration=replace(solution.estimate.calibration, base=base))
    others = tuple(b.block for b in problem.blocks if b is not own)
    after = solve(TorqueProblem(problem.balance, free_blocks(others, held), held), use, settings)
    free = np.array(solution.free)
    rest = np.ones(len(free), dtype=bool)
    rest[own.columns] = False
    free[rest] = after.free
    return after._replace(slopes=problem.slopes(after.estimate), free=free)


def _information(
    problem: TorqueProblem, solution: TorqueSolution, places: list[int], count: int
) -> Array:
    """Information (nb, nb) on the base parameters, whatever else is free; fixed ones are held."""
    H = solution.normal_equations()[0]
    H = H + np.diag(problem.prior_precision)
    own = next(b for b in problem.blocks if b.block.enters == "base").columns
    rest = np.ones(len(H), dtype=bool)
    rest[own] = False
    inner = H[own, own]
    if rest.any():
        inner = inner - H[own][:, rest] @ np.linalg.pinv(H[np.ix_(rest, rest)]) @ H[rest][:, own]
    out = np.eye(count) * _HELD * float(np.diag(inner).max())
    out[np.ix_(places, places)] = (inner + inner.T) / 2
    return out
