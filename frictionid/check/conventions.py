"""Wrong conventions: signs, joints, units and frames, found by trying them out.

Each hypothesis is a linear map of the angles and one of the torques that would put the recordings
right. It is scored by how well the told mechanism then explains them (see `misfit`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows, Speeds, mapped_motion, rows_of, speeds_of
from frictionid.check.misfit import misfit
from frictionid.check.motion import Motion
from frictionid.check.torque_integral import Impulse
from frictionid.mechanics import Mechanism

# A convention is called wrong where another one leaves less than e^-MARGIN of the remainder, and
# explains the data at all. Healthy simulations keep a distance of 2.4 and more.
MARGIN, EXPLAINS = 1.0, np.log(0.25)
# Two maps whose scores are closer than this cannot be told apart (mirror images).
ALIKE = 0.02


class Convention(NamedTuple):
    """A hypothesis: its kind, words for it, and the maps (n, n) that would put the data right."""

    kind: str
    words: str
    angle: Array
    torque: Array


class Scored(NamedTuple):
    """A convention with its score, the mean over the joints of `misfit`: lower fits better."""

    convention: Convention
    score: float


def hypotheses(n: int, driven: Sequence[bool], unit: str = "rad") -> Iterator[Convention]:
    """Conventions that recordings of n joints may follow; the first is the data as given.

    unit : of the positions, "rad", or "m" for prismatic joints
    """
    eye = np.eye(n)
    yield Convention("as_given", "as given", eye, eye)
    for j in range(n):
        flip = np.diag(np.where(np.arange(n) == j, -1.0, 1.0))
        yield Convention("flipped_angle", f"angle {j + 1} has the wrong sign", flip, eye)
        if driven[j]:
            yield Convention("flipped_torque", f"torque {j + 1} has the wrong sign", eye, flip)
    swap = eye[::-1]
    if n == 2:
        yield Convention("swapped_angles", "the angles of the joints are swapped", swap, eye)
        if any(driven):
            yield Convention("swapped_torques", "the torques of the joints are swapped", eye, swap)
            yield Convention(
                "swapped_joints", "the joints are swapped, angles and torques", swap, swap
            )
    if n > 1:
        relative = eye - np.diag(np.ones(n - 1), -1)
        yield Convention(
            "absolute_angle",
            "angles are absolute (against the vertical), not relative",
            relative,
            eye,
        )
    if unit == "m":
        yield Convention("millimetres", "positions are in mm, not m", 1e-3 * eye, eye)
        yield Convention("metres", "positions are in m, not mm", 1e3 * eye, eye)
        return
    turn = np.pi / 180
    yield Convention("degrees", "angles are in degrees, not rad", turn * eye, eye)
    yield Convention("radians", "angles are in rad, not degrees", eye / turn, eye)


def scores(
    mechanism: Mechanism, motions: Sequence[Motion], impulse: Impulse, told: Array
) -> list[Scored]:
    """All conventions with their scores, the data as given first.

    told : array, shape (R, nb) base parameters of each recording
    """
    description = mechanism.description
    trials = list(hypotheses(mechanism.n, description.driven, description.angle_unit))
    maps = list({c.angle.tobytes(): c.angle for c in trials}.values())
    rows = dict(
        zip((m.tobytes() for m in maps), _rows(mechanism, motions, told, maps), strict=True)
    )
    torques = {key: impulse.means(r) for key, r in rows.items()}
    out = []
    for convention in trials:
        key = convention.angle.tobytes()
        each = misfit(rows[key], torques[key] @ convention.torque.T)
        out.append(Scored(convention, float(each.mean())))
    return out


def _rows(
    mechanism: Mechanism, motions: Sequence[Motion], told: Array, maps: Sequence[Array]
) -> Iterator[Rows]:
    """Rows of all recordings under each map, made in one go: as if they were more recordings."""
    R, groups = len(motions), [[mapped_motion(m, map_) for m in motions] for map_ in maps]
    each = [speeds_of(group) for group in groups]
    speeds = Speeds(*(np.repeat(np.array(v), R, axis=0) for v in zip(*each, strict=True)))
    everything = [motion for group in groups for motion in group]
    rows = rows_of(mechanism, everything, np.tile(told, (len(maps), 1))[None], speeds)
    for i in range(len(maps)):
        own = rows.recording // R == i
        part = Rows(*(field[own] for field in rows))
        yield part._replace(recording=part.recording - i * R)


def better(scored: list[Scored], limit: float) -> list[Scored]:
    """Conventions that fit clearly better than a score `limit`, those alike together; or none."""
    best = min(scored, key=lambda s: s.score)
    if best.score > min(limit - MARGIN, EXPLAINS):
        return []
    alike = [s for s in scored if s.score < best.score + ALIKE]
    return sorted(alike, key=lambda s: _order(s.convention))


def mapped(
    motions: Sequence[Motion], impulse: Impulse, convention: Convention
) -> tuple[tuple[Motion, ...], Impulse]:
    """Motions and torques put right."""
    return (
        tuple(mapped_motion(motion, convention.angle) for motion in motions),
        impulse._replace(value=impulse.value @ convention.torque.T),
    )


def _order(convention: Convention) -> float:
    """Simple explanations first: the map of one column before that of several."""
    n = len(convention.angle)
    return float(
        np.abs(convention.angle - np.eye(n)).sum() + np.abs(convention.torque - np.eye(n)).sum()
    )
