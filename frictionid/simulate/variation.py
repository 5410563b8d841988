"""How the true friction of a simulated rig varies from recording to recording.

    friction of recording i = scatter_i * warmth_i * (wear_i * level(w) sgn(w) + viscous w)

`scatter` differs for each joint and recording, `warmth` follows the temperature, and `wear` raises
the levels from some recording on.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from frictionid.config import check_settings
from frictionid.data.signals import Array
from frictionid.errors import InputError
from frictionid.simulate.true_friction import Curve, Stribeck, TrueFriction, level_of

_LEVELS = ("coulomb_positive", "coulomb_negative", "peak_positive", "peak_negative")


@dataclass(frozen=True)
class Variation:
    """Variation of friction between recordings.

    Parameters
    ----------
    scatter : float
        Relative standard deviation of each joint's friction between recordings.
    temperature : tuple of float [deg C]
        One for each recording; logged beside the angles. (): none.
    per_kelvin : float
        Relative change of all friction with each kelvin above the first recording's temperature.
    wear : tuple of float
        Relative change of each joint's levels, reached step by step by the last recording.
    worn_from : int
        First recording with wear, from 0; where `sudden`, all of it begins there.
    sudden : bool
    """

    scatter: Annotated[float, Field(ge=0, lt=0.3)] = 0.0
    temperature: tuple[float, ...] = ()
    per_kelvin: float = 0.0
    wear: tuple[float, ...] = ()
    worn_from: Annotated[int, Field(ge=0)] = 0
    sudden: bool = False

    def __post_init__(self) -> None:
        check_settings(self)

    def check(self, joints: int, recordings: int) -> None:
        """Raise InputError where a list does not fit the numbers of joints and recordings."""
        for name, wanted in (("wear", joints), ("temperature", recordings)):
            values = getattr(self, name)
            if values and len(values) != wanted:
                raise InputError(
                    f"variation: {name} has {len(values)} numbers; it needs {wanted}, or none"
                )

    def factors(self, names: Sequence[str], joints: int, seed: int) -> tuple[Array, Array]:
        """Factors (R, n) of all friction, and (R, n) of the levels alone, of named recordings."""
        count = len(names)
        draws = [
            np.random.default_rng([seed, zlib.crc32(f"{name} friction".encode())]) for name in names
        ]
        scatter = 1.0 + self.scatter * np.stack([rng.standard_normal(joints) for rng in draws])
        warm = np.array(self.temperature or (0.0,) * count)
        warmth = 1.0 + self.per_kelvin * (warm - warm[0])
        since = np.arange(count) - self.worn_from
        last = max(1, count - 1 - self.worn_from)
        share = (since >= 0) * (1.0 if self.sudden else np.clip(since / last, 0.0, 1.0))
        wear = 1.0 + share[:, None] * np.array(self.wear or (0.0,) * joints)
        return np.maximum(scatter * warmth[:, None], 0.0), wear


@dataclass(frozen=True)
class RecordingFriction(TrueFriction):
    """Memory-free friction with a curve of its own in each recording.

    The memory of a joint is the number of its recording: the integrator picks recordings, and their
    curves with them.
    """

    curve: Curve
    curves: tuple[Curve, ...]

    @cached_property
    def _arrays(self) -> tuple[Array, ...]:
        """Each field of the curves, (R, n)."""
        return tuple(
            np.array([getattr(curve, field.name) for curve in self.curves])
            for field in fields(Curve)
        )

    def start(self, w: Array) -> Array:
        return np.broadcast_to(np.arange(len(self.curves), dtype=float)[:, None], w.shape)

    def torque(self, w: Array, z: Array, mode: Array) -> Array:
        recording = z[..., 0].astype(int)
        numbers = [values[recording] for values in self._arrays]
        return mode * level_of(numbers, w, mode) + numbers[2] * w

    def table(self) -> dict[str, Any]:
        return Stribeck(self.curve).table()


def varied(
    friction: Any, variation: Variation, names: Sequence[str], seed: int
) -> RecordingFriction:
    """Friction of each recording.

    >>> from frictionid.simulate.true_friction import Curve, Stribeck
    >>> tf = Stribeck(Curve((0.1,), (0.1,), (0.0,)))
    >>> worn = varied(tf, Variation(wear=(0.2,), worn_from=1, sudden=True), ("a", "b"), 0)
    >>> [round(curve.coulomb_positive[0], 3) for curve in worn.curves]
    [0.1, 0.12]
    """
    every, levels = variation.factors(names, friction.curve.n, seed)
    curves = []
    for factors, worn in zip(every, levels, strict=True):
        factor = {name: factors * worn for name in _LEVELS} | {"viscous": factors}
        new = {name: f * getattr(friction.curve, name) for name, f in factor.items()}
        numbers = {name: tuple(values.tolist()) for name, values in new.items()}
        curves.append(replace(friction.curve, **numbers))
    return RecordingFriction(friction.curve, tuple(curves))
