"""Equations of motion of arms of n joints against Pinocchio, sample by sample: see `bench.py`.

The loop calls Pinocchio's crba and nonLinearEffects (extra `engines`) and keeps nothing of what
they return; ours gives M and h of all samples. `over_samples` is the same algorithm in NumPy, with
every statement over all samples.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.mechanics import RigidBodyTree, urdf

JOINTS = (2, 3, 4, 5, 6, 7)
SAMPLES = (10, 100, 1_000, 10_000, 100_000)


def rows() -> list[tuple[str, str]]:
    """Rows of the table of `bench.py`: how many times faster than the loop."""
    try:
        import pinocchio  # noqa: F401
    except ImportError:
        return [("arms of n joints against Pinocchio", "not installed: pip install pin")]
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for n in JOINTS:
            mechanism = arm(Path(folder), n)
            ratios = [ratio(mechanism, K) for K in SAMPLES]
            text = ", ".join(f"{r:.1f}" for r in ratios)
            out.append((f"M and h of {n} joints, Pinocchio's loop / ours, {_SIZES}", text))
        out += parts(mechanism)
    return out


_SIZES = "of " + ", ".join(f"{K:g}" for K in SAMPLES) + " samples"


def arm(folder: Path, n: int) -> RigidBodyTree:
    """A serial arm of n revolute joints with random places and bodies."""
    rng = np.random.default_rng(n)

    def three(low: float, high: float) -> str:
        return " ".join(f"{x:.6f}" for x in rng.uniform(low, high, 3))

    lines = ['<robot name="arm"><link name="link_0"/>']
    for i in range(1, n + 1):
        lines.append(
            f'<link name="link_{i}"><inertial><origin xyz="{three(-0.1, 0.1)}"/><mass value="2"/>'
            '<inertia ixx="0.02" ixy="0.001" ixz="0.002" iyy="0.03" iyz="0.003" izz="0.025"/>'
            f'</inertial></link><joint name="joint_{i}" type="revolute">'
            f'<origin xyz="{three(-0.3, 0.3)}" rpy="{three(-1.5, 1.5)}"/>'
            f'<parent link="link_{i - 1}"/><child link="link_{i}"/><axis xyz="0 0 1"/>'
            '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>'
        )
    path = folder / f"arm_{n}.urdf"
    path.write_text("\n".join([*lines, "</robot>"]))
    return urdf(path)


def ratio(mechanism: RigidBodyTree, samples: int) -> float:
    """Time of Pinocchio's loop over that of ours, best of a few of each, taken in turn."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(mechanism.options["urdf"]))
    data, p = model.createData(), mechanism.base({})
    q, w = np.random.default_rng(0).uniform(-2, 2, (2, samples, mechanism.n))

    def loop() -> None:
        for angle, velocity in zip(q, w, strict=True):
            pin.crba(model, data, angle)
            pin.nonLinearEffects(model, data, angle, velocity)

    times = [(timed(loop), timed(lambda: mechanism.dynamics(p, q, w))) for _ in range(5)]
    theirs, ours = np.min(times, axis=0)
    return float(theirs / ours)


def parts(mechanism: RigidBodyTree, samples: int = 10_000) -> list[tuple[str, str]]:
    """Times per sample of each method, and of the same algorithm in NumPy."""
    p, n = mechanism.base({}), mechanism.n
    q, w, a = np.random.default_rng(0).uniform(-2, 2, (3, samples, n))
    M, h = over_samples(mechanism, q, w)
    for ours, theirs in zip(mechanism.dynamics(p, q, w), (M, h), strict=True):
        assert np.allclose(ours, theirs, atol=1e-9)
    calls: dict[str, Callable[[], Any]] = {
        "M and h": lambda: mechanism.dynamics(p, q, w),
        "all terms": lambda: mechanism.terms(p, q, w),
        "derivatives for shooting": lambda: mechanism.partials(p, q, w, a),
        "M and h in NumPy": lambda: over_samples(mechanism, q, w),
    }
    return [
        (
            f"{name} of {n} joints, a sample",
            f"{min(timed(f) for _ in range(5)) / samples * 1e6:.2f} us",
        )
        for name, f in calls.items()
    ]


def timed(call: Callable[[], Any]) -> float:
    """Time [s] of a call."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


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


if __name__ == "__main__":
    for row in rows():
        print(*row, sep=": ")
