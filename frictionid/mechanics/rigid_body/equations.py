"""Equations of motion of a tree at K samples, from its inertial parameters pi.

pi has shape (1, N) or (K, N): ten of each body, then the inertias of the rotors.
"""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array, times
from frictionid.mechanics.rigid_body.base_parameters import BaseParameters
from frictionid.mechanics.rigid_body.crba import mass_matrix
from frictionid.mechanics.rigid_body.regressor import torque_regressor
from frictionid.mechanics.rigid_body.rnea import slopes_of_lagrangian, torques
from frictionid.mechanics.rigid_body.rnea_derivatives import torque_derivatives
from frictionid.mechanics.rigid_body.tree import Motion, Pose, Tree


def inertia(tree: Tree, pi: Array, q: Array) -> Array:
    """Mass matrix M (K, n, n)."""
    return _mass_matrix(tree, pi, tree.pose(q, _bodies(tree, pi)))


def dynamics(tree: Tree, pi: Array, q: Array, w: Array) -> tuple[Array, Array]:
    """M (K, n, n) and h (K, n)."""
    pose = tree.pose(q, _bodies(tree, pi))
    motion = tree.motion(pose.S, w, np.zeros_like(w))
    return _mass_matrix(tree, pi, pose), -_torques(tree, pose, motion)


def terms(tree: Tree, pi: Array, q: Array, w: Array) -> tuple[Array, ...]:
    """M, h, momentum, dL/dq (K, n) and energy (K,) [J]."""
    pose = tree.pose(q, _bodies(tree, pi))
    v, dS, a = motion = tree.motion(pose.S, w, np.zeros_like(w))
    M = _mass_matrix(tree, pi, pose)
    slope, potential = slopes_of_lagrangian(
        tree.parent, tree.gravity, pose.S, v, dS, pose.inertia, pose.carried
    )
    momentum = times(M, w)
    energy = (momentum * w).sum(-1) / 2 + potential
    return M, -_torques(tree, pose, motion), momentum, slope, energy


def partials(
    tree: Tree, base: BaseParameters, pi: Array, q: Array, w: Array, rate: Array
) -> tuple[Array, Array, Array]:
    """Derivatives of M dw/dt - h by q, w (K, n, n) and base parameters (K, n, nb)."""
    pose = tree.pose(q, _bodies(tree, pi))
    v, dS, a = motion = tree.motion(pose.S, w, rate)
    by_q, by_w = torque_derivatives(tree.parent, tree.gravity, pose.S, v, dS, a, pose.inertia)
    bodies = base.leading[base.leading < 10 * tree.n]
    turning = tree.rotors[base.leading[len(bodies) :] - 10 * tree.n]
    by_p = np.empty((*q.shape, len(base.leading)))
    by_p[..., : len(bodies)] = torque_regressor(tree.parent, pose.R, pose.o, pose.S, v, a, bodies)
    by_p[..., len(bodies) :] = turning.T * (rate @ turning.T)[:, None]
    if base.rounded:
        unheard = tree.pose(q, _bodies(tree, base.silent[None]))
        by_p[..., base.carrier] += _torques(tree, unheard, motion)
        by_p[..., base.carrier] += times(_rotors(tree, base.silent[None]), rate)
    return by_q, by_w, by_p


def _bodies(tree: Tree, pi: Array) -> Array:
    return pi[:, : 10 * tree.n].reshape(-1, tree.n, 10)


def _rotors(tree: Tree, pi: Array) -> Array:
    """Share of the rotors in M, (1, n, n) or (K, n, n)."""
    return np.einsum("ri,kr,rj->kij", tree.rotors, pi[:, 10 * tree.n :], tree.rotors)


def _mass_matrix(tree: Tree, pi: Array, pose: Pose) -> Array:
    return mass_matrix(tree.parent, pose.S, pose.carried) + _rotors(tree, pi)


def _torques(tree: Tree, pose: Pose, motion: Motion) -> Array:
    return torques(tree.parent, pose.S, motion.v, motion.a, pose.inertia)
