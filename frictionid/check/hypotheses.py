"""Signs, order of joints, units and frames that data may have: maps that would correct them."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.readers.column_toml import Gears

TORQUE_UNITS = {"mN m": 1000, "N cm": 100}  # kinds of which the torques are so many times too large
SHIFTED, ABSOLUTE = "shifted_angle", "absolute_angle"  # what [motor] of a dataset.toml mends
NO_TORQUE = "no_torque"  # what those are judged against
UNIT_OF_ONE = "unit_of_torque"  # of a single joint's
SIZES = ("degrees", "radians", "motor_angles")  # one recording in them may hide all others


class Convention(NamedTuple):
    """A hypothesis: its kind, words for it, and the maps (n, n) that would correct the data.

    zero : (n,) [rad], angles that the map of the angles leaves as they are; shift : (n,) [rad] to
    add to the angles then
    """

    kind: str
    words: str
    angle: Array
    torque: Array
    zero: Array | float = 0.0
    shift: Array | float = 0.0

    @property
    def offset(self) -> Array:
        """What the map of the angles adds (n,) [rad]: q becomes A q + offset."""
        zero = np.broadcast_to(self.zero, len(self.angle))
        return zero - self.angle @ zero + self.shift


def hypotheses(
    driven: Sequence[bool] | Array, position_units: Sequence[str], gears: Gears | None = None
) -> Iterator[Convention]:
    """Conventions that recordings of n joints may follow; the first is the data as given.

    driven, position_units : of each joint; "rad", or "m" where it slides
    gears : between the motors that columns are of and the joints
    """
    n, slides = len(driven), np.array([unit == "m" for unit in position_units])
    eye = np.eye(n)
    yield Convention("as_given", "as given", eye, eye)
    yield from _signs(driven, gears)
    swap = eye[::-1]
    if n == 2 and len(set(slides)) == 1:
        yield Convention("swapped_angles", "the angles of the joints are swapped", swap, eye)
        if any(driven):
            yield Convention("swapped_torques", "the torques of the joints are swapped", eye, swap)
            words = "the joints are swapped, angles and torques"
            yield Convention("swapped_joints", words, swap, swap)
    if n > 1 and not slides.any():
        relative = eye - np.diag(np.ones(n - 1), -1)
        words = "angles are absolute (against the vertical), not relative"
        yield Convention(ABSOLUTE, words, relative, eye)
    for kind, words, unit, joints in (
        ("millimetres", "positions are in mm, not m", 1e-3, slides),
        ("metres", "positions are in m, not mm", 1e3, slides),
        ("degrees", "angles are in degrees, not rad", np.pi / 180, ~slides),
        ("radians", "angles are in rad, not degrees", 180 / np.pi, ~slides),
    ):
        if joints.any():
            yield Convention(kind, words, np.diag(np.where(joints, unit, 1.0)), eye)
    if gears is not None and not gears.angles and not np.array_equal(gears.turns, eye):
        words = 'angles are those of the motors, not of the joints (motor.angle = "motor")'
        yield Convention("motor_angles", words, np.linalg.inv(gears.turns), eye)
    yield Convention(NO_TORQUE, "no torque acts", eye, 0.0 * eye)
    for name, large in TORQUE_UNITS.items() if any(driven & ~slides) else ():
        size = np.where(slides, 1.0, large)
        words = f"torques are {large} times too large ({name}, not N m; or a constant of the motor)"
        yield Convention(name, words, eye, eye / size)
        words = f"torques are {large} times too small (N m, not {name}; or a constant of the motor)"
        yield Convention(f"not {name}", words, eye, eye * size)


def _signs(driven: Sequence[bool] | Array, gears: Gears | None) -> Iterator[Convention]:
    """Wrong signs of angles, of torques, of both, and of gears."""
    n, of_gear = len(driven), "" if gears is None else " (that of its gear, or of its column)"
    eye = np.eye(n)
    if sum(driven) > 1:  # those of the load, as some robots log them
        yield Convention("flipped_torque", "all torques have the wrong sign", eye, -eye)
    for j in range(n):
        flip = np.diag(np.where(np.arange(n) == j, -1.0, 1.0))
        yield Convention("flipped_angle", f"angle {j + 1} has the wrong sign", flip, eye)
        if not driven[j]:
            continue
        words = f"torque {j + 1} has the wrong sign"
        yield Convention("flipped_torque", words + of_gear, eye, flip)
        if n > 1 and gears is not None and gears.angles:
            C = gears.turns
            torque = C.T @ flip @ np.linalg.inv(C.T) if gears.torques else eye
            words = f"the gear of motor {j + 1} has the wrong sign"
            angle = np.linalg.solve(C, flip @ C)
            yield Convention("flipped_gear", words, angle, torque, gears.zero)
            if np.array_equal(angle, flip) and not gears.zero[j]:
                continue
        if n > 1:
            words = f"joint {j + 1} turns the other way round (sign of its gear, or of its axis)"
            yield Convention("flipped_joint", words, flip, flip)


def of_columns(wrong: Sequence[int], acting: Array) -> Iterator[Convention]:
    """Torques of single joints of an arm in another unit, and columns of two that are exchanged.

    wrong : joints (from 0) whose balances do not hold ; acting (n,) : those with a motor
    """
    n, eye = len(acting), np.eye(len(acting))
    for j in (j for j in wrong if acting[j]):
        for name, large in TORQUE_UNITS.items():
            for size, words in ((1 / large, f"in {name}, not N m"), (large, f"in N m, not {name}")):
                map_ = np.diag(np.where(np.arange(n) == j, size, 1.0))
                yield Convention(UNIT_OF_ONE, f"torque {j + 1} is {words}", eye, map_)
    for i, j in combinations(wrong, 2):
        order = np.arange(n)
        order[[i, j]] = j, i
        swap, joints = eye[order], f"{i + 1} and {j + 1}"
        yield Convention("pair_of_angles", f"angles {joints} are swapped", swap, eye)
        yield Convention("pair_of_torques", f"torques {joints} are swapped", eye, swap)
        yield Convention("pair_of_joints", f"joints {joints} are swapped", swap, swap)
