"""Is the told mechanism right? One suspected change at a time: gears, rotors, base parameters.

Each suspect is fitted alone, with friction left open. The one that leaves the least is named if it
is large and explains much; suspects that do nearly as well are named beside it, for the data then
cannot tell them apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows
from frictionid.check.partial_regression import effect, stack_of
from frictionid.mechanics import Mechanism

# Told numbers of real machines are rarely better than this share.
LARGE = 0.1
# Another gear or torque constant stays within these factors; beyond them something else is wrong.
GAINS = (0.2, 5.0)
# A suspect is named where it takes away this share of the sum of squares ...
EXPLAINS = 0.3
# ... and others are named beside it that leave less than this much more than it.
ALIKE = 1.1


class Suspect(NamedTuple):
    """A change that would put the told mechanism right.

    kind, words ; size and error in `unit`; share: relative to what is told (gain - 1, or the
    largest change of a base parameter); left: sum of squares over the one without any change
    """

    kind: str
    words: str
    size: float
    error: float
    unit: str
    share: float
    left: float


def suspects(
    mechanism: Mechanism, parameters: dict[str, float], rows: Rows, torque: Array, told: Array
) -> list[Suspect]:
    """All suspects, the one that explains most first.

    parameters : physical ones ; rows : of unit vectors ; torque (K, n) [N m] ; told (R, nb)
    """
    stack = stack_of(rows, torque, told, loose=False)
    target = torque - (rows.phi * told[rows.recording][:, None]).sum(-1)
    clean = stack.clean(target)
    none = max(float(clean @ clean), 1e-300)
    found = []
    for kind, words, column, unit, share in _columns(mechanism, parameters, rows, torque, told[0]):
        size, error, left = effect(stack, target, column)
        if np.isfinite(error):
            at = Suspect(kind, words, size, error, unit, size * share, left / none)
            found.append(_as_gain(at) if kind == "gain" else at)
    return sorted(found, key=lambda s: s.left)


def wrong(found: list[Suspect]) -> list[Suspect]:
    """The suspects to be named, those that the data cannot tell apart side by side; or none."""
    good = [s for s in found if s.kind != "rotor" or s.size > 0]
    if not good or 1 - good[0].left < EXPLAINS:
        return []
    best = good[0]
    if best.kind == "gain" and not GAINS[0] < best.size < GAINS[1]:
        return []
    if abs(best.share) < LARGE or abs(best.size - (best.kind == "gain")) < 4 * best.error:
        return []
    return [s for s in good if s.left <= ALIKE * best.left]


def freed(rows: Rows, torque: Array, told: Array) -> float:
    """Sum of squares with all base parameters free, over the one with the told ones."""
    stack = stack_of(rows, torque, told, loose=False)
    clean = stack.clean(torque - (rows.phi * told[rows.recording][:, None]).sum(-1))
    columns = stack.clean(np.moveaxis(rows.phi, -1, 0)).T
    size = np.sqrt((columns**2).sum(0))
    if not np.abs(torque).any():  # only ratios show: hold the largest
        size[np.argmax(size * np.abs(told[0]))] = 0.0
    columns = columns[:, size > 0] / size[size > 0]
    left = clean - columns @ np.linalg.lstsq(columns, clean, rcond=1e-7)[0]
    return float(left @ left) / max(float(clean @ clean), 1e-300)


def _as_gain(s: Suspect) -> Suspect:
    """Torque minus c times torque fits: the joint feels 1 - c of what is logged."""
    return s._replace(size=1.0 - s.size, share=-s.size)


def _columns(
    mechanism: Mechanism, parameters: dict[str, float], rows: Rows, torque: Array, told: Array
) -> Iterator[tuple[str, str, Array, str, float]]:
    """Kind, words, column [N m per unit], unit and relative size of one unit, of each suspect."""
    motors = [j for j, driven in enumerate(mechanism.description.driven) if driven]
    if len(motors) > 1:
        yield "gain", "gain of all torques", torque, "", 1.0
    for j in motors:
        own = torque * (np.arange(torque.shape[1]) == j)
        yield "gain", f"gain of torque {j + 1}", own, "", 1.0
    for name in _rotors(mechanism):
        # base parameters are linear in a rotor inertia
        change = mechanism.base({**parameters, name: parameters[name] + 1.0}) - mechanism.base(
            parameters
        )
        share = float(np.max(np.abs(change) / np.maximum(np.abs(told), 1e-12)))
        yield "rotor", f"rotor inertia missing ({name})", rows.phi @ change, "kg m^2", share
    for i, base in enumerate(mechanism.description.base):
        if told[i]:
            yield "base", base.name, rows.phi[..., i], base.unit, 1 / abs(float(told[i]))


def _rotors(mechanism: Mechanism) -> list[str]:
    symbols: set[Any] = set()
    for inertia, _ in mechanism.description.rotors:
        symbols |= inertia.free_symbols
    names = {str(s) for s in symbols}
    return [name for name in mechanism.defaults if name in names]
