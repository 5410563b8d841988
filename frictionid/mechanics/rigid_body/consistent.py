"""Base parameters that bodies can have: with masses that are distributed in space.

The moments of a body are those of a distribution of mass where its pseudo-inertia

    J = [[tr(I)/2 1 - I, m c], [(m c)', m]]    (4, 4)

is positive semidefinite [Wensing2018]. Base parameters are consistent where some such bodies, and
rotors of no negative inertia, have them; then M(q) is positive for all q.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from frictionid.arrays import Array
from frictionid.mechanics.rigid_body.rigid_body_tree import RigidBodyTree

_LOWER = np.tril_indices(4)
_LEAST = 1e-6  # of a typical body, which every body has
_WEAK = 1e-4  # [standard errors] pull to the nominal bodies, where the data tell none apart


def pseudo_inertia(moments: Array) -> Array:
    """J (..., 4, 4) of moments (..., 10) about the origin of the body's frame, as of a `Tree`.

    >>> pseudo_inertia(np.array([2.0, 0.2, 0, 0, 0.01, 0, 0, 0.04, 0, 0.04])).diagonal()
    array([0.035, 0.005, 0.005, 2.   ])
    """
    mass, first, second = moments[..., 0], moments[..., 1:4], moments[..., 4:]
    turning = second[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    half = np.trace(turning, axis1=-2, axis2=-1)[..., None, None] / 2
    J = np.empty((*moments.shape[:-1], 4, 4))
    J[..., :3, :3] = half * np.eye(3) - turning
    J[..., :3, 3] = J[..., 3, :3] = first
    J[..., 3, 3] = mass
    return J


def moments_of(J: Array) -> Array:
    """Moments (..., 10) of pseudo-inertias (..., 4, 4), the inverse of `pseudo_inertia`."""
    S = J[..., :3, :3]
    turning = np.trace(S, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - S
    second = turning[..., [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    return np.concatenate([J[..., 3:, 3], J[..., :3, 3], second], axis=-1)


def nearest_consistent(mechanism: RigidBodyTree, wanted: Array, metric: Array) -> Array:
    """Consistent base parameters p (nb,) with the least (p - wanted)' metric (p - wanted).

    wanted : (nb,) ; metric : (nb, nb), such as the information of a fit

    Cholesky factors of the pseudo-inertias, and roots of the rotors' inertias, are free: what they
    make is consistent by itself [Rucker2022].
    """
    tree, regrouping = mechanism.tree, mechanism.reduction.regrouping
    own = np.array([mechanism.nominal()[name] for name in tree.rotor_names])
    J = pseudo_inertia(tree.inertia)
    size = np.maximum(np.trace(J, axis1=1, axis2=2), 1e-12)
    typical = np.median(size)
    floor = _LEAST * typical * np.eye(4)
    scale = np.sqrt(np.maximum(size, 1e-3 * typical))
    values, vectors = np.linalg.eigh(J - floor)
    positive = (vectors * np.maximum(values, floor[0, 0])[:, None]) @ np.swapaxes(vectors, 1, 2)
    most = max(float(np.abs(own).max(initial=0.0)), 1e-3 * typical)
    start = np.concatenate(
        [
            (np.linalg.cholesky(positive) / scale[:, None, None])[:, *_LOWER].ravel(),
            np.sqrt(np.maximum(own / most, 1e-3)),
        ]
    )
    spread, axes = np.linalg.eigh(metric)
    root = axes * np.sqrt(np.maximum(spread, 0.0))

    def base(free: Array) -> Array:
        factors = np.zeros((tree.n, 4, 4))
        factors[:, *_LOWER] = free[: 10 * tree.n].reshape(tree.n, 10) * scale[:, None]
        bodies = moments_of(factors @ np.swapaxes(factors, 1, 2) + floor)
        return np.asarray(regrouping @ np.append(bodies, most * free[10 * tree.n :] ** 2))

    def residual(free: Array) -> Array:
        return np.append((base(free) - wanted) @ root, _WEAK * (free - start))

    found = least_squares(residual, start, xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=300)
    return base(found.x)
