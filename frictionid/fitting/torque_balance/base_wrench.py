"""Balance of forces and moments on a floating base: six rows that have no friction in them.

With the base's own ten parameters, and with what the joints' torques do not tell of the bodies, the
momentum of all bodies and the known wrench balance over each window,

    Y p + Z b = wrench.

b is eliminated, so that the rows only add to what is known of the base parameters p.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.mechanics.rigid_body.rigid_body_tree import WRENCH, RigidBodyTree

_NOTHING = 1e-9  # of the largest singular value


class BaseWrench(NamedTuple):
    """Rows of K windows: regressor Y (K, 6, nb), nuisance Z (K, 6, B), mean wrench (K, 6).

    Rows are in units of what the bodies usually need, (6,).
    """

    regressor: Array
    nuisance: Array
    wrench: Array

    def left(self, base: Array) -> Array:
        """What base parameters (K, nb) leave of the known wrench, (K, 6)."""
        return np.asarray(self.wrench - np.einsum("kib,kb->ki", self.regressor, base))

    def eliminated(self, use: Array) -> BaseWrench:
        """The rows of windows in use (K,), others are zero, with b eliminated."""
        K = int(use.sum())
        size = np.sqrt((self.regressor[use] ** 2).sum(axis=2).mean(axis=0))[:, None] + 1e-300
        rows = np.concatenate([self.regressor, self.wrench[..., None]], axis=2)[use] / size
        U, s, _ = np.linalg.svd((self.nuisance[use] / size).reshape(6 * K, -1), full_matrices=False)
        Q, flat = U[:, s > _NOTHING * s.max(initial=0.0)], rows.reshape(6 * K, -1)
        out = np.zeros((len(use), 6, rows.shape[2]))
        out[use] = (flat - Q @ (Q.T @ flat)).reshape(rows.shape)
        return BaseWrench(out[..., :-1], self.nuisance[..., :0], out[..., -1])


def base_wrench(mechanism: RigidBodyTree, rows: Array, wrench: Array) -> BaseWrench:
    """Rows of the base, of those by all inertial parameters (K, n + 6, N): `with_free_base`."""
    rows, reduction = rows[:, : len(WRENCH)], mechanism.reduction
    leading = rows[..., 10 + reduction.leading]
    nuisance = rows.copy()
    nuisance[..., 10:] -= leading @ reduction.regrouping
    return BaseWrench(leading, nuisance, wrench)


def joined_wrenches(parts: Sequence[BaseWrench | None]) -> BaseWrench | None:
    """Rows of all recordings; None unless all have them."""
    whole = [part for part in parts if part is not None]
    if len(whole) < len(parts):
        return None
    return BaseWrench(*map(np.concatenate, zip(*whole, strict=True)))
