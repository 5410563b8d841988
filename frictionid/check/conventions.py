"""Tests of conventions: signs, order of the joints, units and frames.

Each hypothesis is a linear map of the angles and one of the torques that would correct the
recordings. Its score says how much of the torque the nominal mechanism then leaves unexplained,
whatever the friction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows, rows_of
from frictionid.check.motion import Measured, Speeds, mapped_motion, speeds_of

# A convention is rejected where another one leaves less than e^-MARGIN of the squared residual, and
# explains the data at all. Healthy simulations keep a distance of 2.4 and more.
MARGIN, EXPLAINS = 1.0, np.log(0.25)
# Two maps whose scores are closer than this cannot be distinguished (mirror images).
ALIKE = 0.02
# Below this share of its terms a balance is good; smaller differences mean nothing.
FLOOR = 0.02
# A hypothesis that makes the mechanism's terms smaller than this share of the torque explains
# nothing: free friction alone would take all of it.
MATTERS = 0.3


class Convention(NamedTuple):
    """A hypothesis: its kind, words for it, and the maps (n, n) that would correct the data."""

    kind: str
    words: str
    angle: Array
    torque: Array


class Scored(NamedTuple):
    """A convention with its score, the joints' mean of `log_unexplained`: lower fits better."""

    convention: Convention
    score: float


def hypotheses(
    n: int, driven: Sequence[bool], position_units: Sequence[str] = ()
) -> Iterator[Convention]:
    """Conventions that recordings of n joints may follow; the first is the data as given.

    position_units : of each joint, "rad", or "m" where it slides; all "rad" where there are none
    """
    slides = np.array([unit == "m" for unit in position_units or ("rad",) * n])
    eye = np.eye(n)
    yield Convention("as_given", "as given", eye, eye)
    for j in range(n):
        flip = np.diag(np.where(np.arange(n) == j, -1.0, 1.0))
        yield Convention("flipped_angle", f"angle {j + 1} has the wrong sign", flip, eye)
        if driven[j]:
            yield Convention("flipped_torque", f"torque {j + 1} has the wrong sign", eye, flip)
    swap = eye[::-1]
    if n == 2 and len(set(slides)) == 1:
        yield Convention("swapped_angles", "the angles of the joints are swapped", swap, eye)
        if any(driven):
            yield Convention("swapped_torques", "the torques of the joints are swapped", eye, swap)
            yield Convention(
                "swapped_joints", "the joints are swapped, angles and torques", swap, swap
            )
    if n > 1 and not slides.any():
        relative = eye - np.diag(np.ones(n - 1), -1)
        yield Convention(
            "absolute_angle",
            "angles are absolute (against the vertical), not relative",
            relative,
            eye,
        )
    if slides.any():
        scale = np.diag(np.where(slides, 1e3, 1.0))
        yield Convention("millimetres", "positions are in mm, not m", np.linalg.inv(scale), eye)
        yield Convention("metres", "positions are in m, not mm", scale, eye)
    if not slides.all():
        turn = np.diag(np.where(slides, 1.0, np.pi / 180))
        yield Convention("degrees", "angles are in degrees, not rad", turn, eye)
        yield Convention("radians", "angles are in rad, not degrees", np.linalg.inv(turn), eye)


def scores(measured: Measured) -> list[Scored]:
    """All conventions with their scores, the data as given first."""
    acting = [
        bool(any(r.torque.value[:, j].any() for r in measured.dataset.recordings))
        for j in range(measured.mechanism.n)
    ]
    candidates = list(hypotheses(measured.mechanism.n, acting, measured.mechanism.position_units))
    maps = list({c.angle.tobytes(): c.angle for c in candidates}.values())
    rows = dict(zip((m.tobytes() for m in maps), _rows(measured, maps), strict=True))
    torques = {key: r.means(measured.torque) for key, r in rows.items()}
    out = []
    for convention in candidates:
        key = convention.angle.tobytes()
        each = log_unexplained(rows[key], torques[key] @ convention.torque.T)
        out.append(Scored(convention, float(each.mean())))
    return out


def _rows(measured: Measured, maps: Sequence[Array]) -> Iterator[Rows]:
    """Rows of all recordings under each map, made in one go: as if they were more recordings."""
    groups = [[mapped_motion(m, map_) for m in measured.motions] for map_ in maps]
    R = len(measured.motions)
    each = [speeds_of(group) for group in groups]
    speeds = Speeds(*(np.repeat(np.array(v), R, axis=0) for v in zip(*each, strict=True)))
    nominal = np.tile(measured.nominal, (len(maps), 1))[None]
    rows = rows_of(measured.mechanism, [m for group in groups for m in group], nominal, speeds)
    for i in range(len(maps)):
        part = rows.where(rows.recording // R == i)
        yield part._replace(recording=part.recording - i * R)


def log_unexplained(rows: Rows, torque: Array) -> Array:
    """Mean log of the squared share of each joint's torque that stays unexplained, (n,).

    Mechanism and torque are given; friction may be anything of the shapes in `rows` that opposes
    motion (non-negative least squares). What remains, over the sum of squares of the terms of the
    balance, lies between 0 and about 1 whatever the units of a hypothesis. 0 where nothing fits.

    Parameters
    ----------
    rows : Rows, K windows, with the nominal parameters as first vector
    torque : array, shape (K, n) [N m]
    """
    inertia, gravity = rows.inertia[..., 0], rows.gravity[..., 0]
    out = np.zeros(torque.shape[1])
    for j in range(len(out)):
        use = rows.moving[:, j]
        if use.sum() < 10:
            continue
        terms = np.stack([inertia[use, j], gravity[use, j], torque[use, j]])
        if (terms[:2] ** 2).sum() < MATTERS**2 * (terms[2] ** 2).sum():
            continue
        target = terms[2] - terms[0] - terms[1]
        left = _residual_squares(rows.friction[use, j], target)
        out[j] = np.log(left / max((terms**2).sum(), 1e-300) + FLOOR**2)
    return out


def _residual_squares(shapes: Array, target: Array) -> float:
    """Sum of squares that no friction opposing the motion explains."""
    columns = np.column_stack([shapes, -shapes[:, 2]])  # an offset may have either sign
    size = np.sqrt((columns**2).sum(0))
    Q, R = np.linalg.qr(columns / np.where(size > 0, size, 1.0))
    b = Q.T @ target
    distance = nnls(R, b)[1]
    return float(distance**2 + max(target @ target - b @ b, 0.0))


def better(scored: list[Scored], limit: float) -> list[Scored]:
    """Conventions that fit clearly better than `limit`, equivalent ones together; or none."""
    best = min(scored, key=lambda s: s.score)
    if best.score > min(limit - MARGIN, EXPLAINS):
        return []
    alike = [s for s in scored if s.score < best.score + ALIKE]
    return sorted(alike, key=lambda s: _order(s.convention))


def _order(convention: Convention) -> float:
    """Size of the maps: a change of one column comes before one of several."""
    n = len(convention.angle)
    return float(
        np.abs(convention.angle - np.eye(n)).sum() + np.abs(convention.torque - np.eye(n)).sum()
    )
