"""Equations of motion of a tree of joints in NumPy: every statement over all samples."""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.mechanics import RigidBodyTree


def over_samples(mechanism: RigidBodyTree, q: Any, w: Any) -> tuple[Any, Any]:
    """M (K, n, n) and h (K, n) with every statement over all samples, joints one after another."""
    tree, K = mechanism.tree, len(q)
    R, o = np.zeros((tree.n, K, 3, 3)), np.zeros((tree.n, K, 3))
    S, v, a = (np.zeros((tree.n, K, 6)) for _ in range(3))
    inertia, force = np.zeros((tree.n, K, 6, 6)), np.zeros((tree.n, K, 6))
    for i, p in enumerate(tree.parent):
        c, s = np.cos(q[:, i]), np.sin(q[:, i])
        turn = np.zeros((K, 3, 3))
        turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1] = c, -s, s, c
        turn[:, 2, 2] = 1.0
        before, origin = (R[p], o[p]) if p >= 0 else (np.eye(3), 0.0)
        R[i] = before @ tree.turn[i] @ turn
        o[i] = origin + before @ tree.shift[i]
        S[i, :, :3] = R[i, :, :, 2]
        S[i, :, 3:] = np.cross(o[i], S[i, :, :3])
        moving, lifted = (v[p], a[p]) if p >= 0 else (0 * v[i], np.r_[0, 0, 0, -tree.gravity])
        v[i] = moving + S[i] * w[:, [i]]
        a[i] = lifted + _cross(moving, S[i]) * w[:, [i]]
        inertia[i] = _inertia(tree.inertia[i], R[i], o[i])
        momentum = np.einsum("kij,kj->ki", inertia[i], v[i])
        force[i] = np.einsum("kij,kj->ki", inertia[i], a[i]) + _cross_force(v[i], momentum)
    M, h = np.zeros((K, tree.n, tree.n)), np.zeros((K, tree.n))
    for i in range(tree.n - 1, -1, -1):
        h[:, i] = -(S[i] * force[i]).sum(-1)
        own = np.einsum("kij,kj->ki", inertia[i], S[i])
        j = i
        while j >= 0:
            M[:, i, j] = M[:, j, i] = (S[j] * own).sum(-1)
            j = tree.parent[j]
        if tree.parent[i] >= 0:
            inertia[tree.parent[i]] += inertia[i]
            force[tree.parent[i]] += force[i]
    return M, h


def _cross(v: Any, x: Any) -> Any:
    w = np.cross(v[:, :3], x[:, :3])
    return np.concatenate([w, np.cross(v[:, :3], x[:, 3:]) + np.cross(v[:, 3:], x[:, :3])], -1)


def _cross_force(v: Any, f: Any) -> Any:
    moment = np.cross(v[:, :3], f[:, :3]) + np.cross(v[:, 3:], f[:, 3:])
    return np.concatenate([moment, np.cross(v[:, :3], f[:, 3:])], -1)


def _skew(x: Any) -> Any:
    out = np.zeros((*x.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -x[..., 2], x[..., 1], -x[..., 0]
    return out - np.swapaxes(out, -1, -2)


def _inertia(pi: Any, R: Any, o: Any) -> Any:
    """Inertia (K, 6, 6) about the base's origin."""
    m, h = pi[0], R @ pi[1:4]
    xx, xy, xz, yy, yz, zz = pi[4:]
    own = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ np.swapaxes(R, -1, -2)
    at, H = _skew(o), _skew(h)
    first = H + m * at
    out = np.empty((len(o), 6, 6))
    out[:, :3, :3] = own - at @ H - H @ at - m * at @ at
    out[:, :3, 3:], out[:, 3:, :3], out[:, 3:, 3:] = first, -first, m * np.eye(3)
    return out
