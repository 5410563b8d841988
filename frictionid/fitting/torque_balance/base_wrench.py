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
from frictionid.mechanics.rigid_body.free_base import WRENCH
from frictionid.mechanics.rigid_body.rigid_body_tree import RigidBodyTree

_NOTHING = 1e-9  # of the largest singular value


class BaseWrench(NamedTuple):
    """Rows of K windows: regressor Y (K, 6, nb), others Z (K, 6, B), known (K, 6) mean wrench.

    Rows are in units of what the bodies usually need, (6,).
    """

    regressor: Array
    others: Array
    known: Array

    def left(self, base: Array) -> Array:
        """What base parameters (K, nb) leave of the known wrench, (K, 6)."""
        return np.asarray(self.known - np.einsum("kib,kb->ki", self.regressor, base))

    def eliminated(self, use: Array) -> BaseWrench:
        """The rows of windows in use (K,), others are zero, with b eliminated."""
        K = int(use.sum())
        size = np.sqrt((self.regressor[use] ** 2).sum(axis=2).mean(axis=0))[:, None] + 1e-300
        rows = np.concatenate([self.regressor, self.known[..., None]], axis=2)[use] / size
        U, s, _ = np.linalg.svd((self.others[use] / size).reshape(6 * K, -1), full_matrices=False)
        Q, flat = U[:, s > _NOTHING * s.max(initial=0.0)], rows.reshape(6 * K, -1)
        out = np.zeros((len(use), 6, rows.shape[2]))
        out[use] = (flat - Q @ (Q.T @ flat)).reshape(rows.shape)
        return BaseWrench(out[..., :-1], self.others[..., :0], out[..., -1])


def base_wrench(mechanism: RigidBodyTree, rows: Array, known: Array) -> BaseWrench:
    """Rows of the base, of those by all inertial parameters (K, n + 6, N): `with_free_base`."""
    rows, reduction = rows[:, : len(WRENCH)], mechanism.reduction
    leading = rows[..., 10 + reduction.leading]
    others = rows.copy()
    others[..., 10:] -= leading @ reduction.regrouping
    return BaseWrench(leading, others, known)


def joined_wrenches(parts: Sequence[BaseWrench | None]) -> BaseWrench | None:
    """Rows of all recordings; None unless all have them."""
    whole = [part for part in parts if part is not None]
    if len(whole) < len(parts):
        return None
    return BaseWrench(*map(np.concatenate, zip(*whole, strict=True)))
