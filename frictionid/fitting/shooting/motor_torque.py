"""Motor torque of many intervals, and how it changes with what is free."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array


class MotorTorque(NamedTuple):
    """Motor torque of K intervals in S equal pieces, and its derivatives in E directions.

    u (S, K, n) [N m], by (S, E, K, n); moment (S, K, n) [N m s^2], that of the torque about the end
    of each piece beyond what its mean has, and moment_by (S, E, K, n). finer(rows, piece, parts):
    the torque of some intervals in parts of a piece. Without these the torque is u throughout.
    """

    u: Array
    by: Array
    moment: Array | None = None
    moment_by: Array | None = None
    finer: Callable[[Array, int, int], MotorTorque] | None = None

    def of(self, rows: Array, piece: int, parts: int) -> MotorTorque:
        """That of some intervals in equal parts of a piece."""
        if parts > 1 and self.finer is not None:
            return self.finer(rows, piece, parts)
        at = np.repeat(piece, parts)
        u, by = self.u[at][:, rows], self.by[at][:, :, rows]
        if parts > 1 or self.moment is None or self.moment_by is None:
            return MotorTorque(u, by)
        return MotorTorque(u, by, self.moment[at][:, rows], self.moment_by[at][:, :, rows])
