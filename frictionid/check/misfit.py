"""How badly a balance with the told mechanism fails, whatever the friction: a hypothesis' score.

For each joint, told mechanism and torques are given and friction may be anything of the shapes in
`rows` that opposes motion (non-negative least squares). What remains, over the sum of squares of
the terms of the balance, lies between 0 and about 1 whatever the units of a hypothesis.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows

# Below this share of the terms a balance is good; smaller differences mean nothing.
FLOOR = 0.02
# A reading that makes the mechanism's terms smaller than this share of the torque explains nothing:
# free friction alone would take all of it.
MATTERS = 0.3


def misfit(rows: Rows, torque: Array) -> Array:
    """Mean log of the squared relative remainder of each joint, (n,); 0 where nothing fits.

    Parameters
    ----------
    rows : Rows, K windows, made with the told parameters as first vector
    torque : array, shape (K, n) [N m]
    """
    inertia, gravity = rows.inertia[..., 0], rows.gravity[..., 0]
    out = np.zeros(torque.shape[1])
    for j in range(len(out)):
        use = rows.free[:, j]
        if use.sum() < 10:
            continue
        terms = np.stack([inertia[use, j], gravity[use, j], torque[use, j]])
        if (terms[:2] ** 2).sum() < MATTERS**2 * (terms[2] ** 2).sum():
            continue
        target = terms[2] - terms[0] - terms[1]
        share = _remainder(rows.friction[use, j], target) / max((terms**2).sum(), 1e-300)
        out[j] = np.log(share + FLOOR**2)
    return out


def _remainder(shapes: Array, target: Array) -> float:
    """Sum of squares that no friction opposing the motion explains."""
    columns = np.column_stack([shapes, -shapes[:, 2]])  # an offset may have either sign
    size = np.sqrt((columns**2).sum(0))
    Q, R = np.linalg.qr(columns / np.where(size > 0, size, 1.0))
    b = Q.T @ target
    rest = nnls(R, b)[1]
    return float(rest**2 + max(target @ target - b @ b, 0.0))
