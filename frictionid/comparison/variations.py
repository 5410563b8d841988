"""What a sensitivity study varies, as a suite says it, and data sets with that one thing wrong."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from frictionid.arrays import Array, evenly
from frictionid.config import NonEmpty, Positive, Strict
from frictionid.data.plants import Calibration, calibrated_dataset
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal, taken
from frictionid.errors import InputError

FEWEST = 20  # samples of a recording at a lower rate


class Variation(NamedTuple):
    """One thing that is changed, and by how much.

    cause : "nominal", "parameter", "delay", "gain", "tilt", "noise", "rate" or "recordings"
    amount : relative for parameters and gain (0.1: 10 % too large); [s] that the log of the torque
        is late; [deg] of tilt, and standard deviation of the noise added, of a joint that slides
        in units of a 57th of its size; number of samples of which one is kept; share of the
        recordings
    parameter : name of the mechanical parameter
    """

    cause: str
    amount: float = 0.0
    parameter: str = ""

    @property
    def name(self) -> str:
        """What was changed: the parameter, or the cause.

        >>> Variation("parameter", 0.1, "m4").name, Variation("delay", 0.01).name
        ('m4', 'torque delay')
        """
        return self.parameter or _CAUSES[self.cause][0]

    @property
    def text(self) -> str:
        """By how much, with its unit.

        >>> Variation("parameter", 0.1, "m4").text, Variation("delay", -0.01).text
        ('+10 %', '-10 ms')
        """
        _, factor, unit = _CAUSES[self.cause]
        if self.cause == "rate":
            return f"1/{self.amount:g}"
        sign = "" if self.cause in ("nominal", "recordings") else "+"
        return f"{self.amount * factor:{sign}g} {unit}".strip()

    @property
    def label(self) -> str:
        """Name and amount."""
        return self.name if self.cause == "nominal" else f"{self.name} {self.text}"


NOMINAL = Variation("nominal")
# Name of each cause, and factor and unit of its amount in tables.
_CAUSES = {
    "nominal": ("as recorded", 0.0, ""),
    "parameter": ("", 100.0, "%"),
    "delay": ("torque delay", 1e3, "ms"),
    "gain": ("torque gain", 100.0, "%"),
    "tilt": ("tilt of the base", 1.0, "deg"),
    "noise": ("noise of angles", 1.0, "deg"),
    "rate": ("sampling rate", 1.0, ""),
    "recordings": ("recordings", 100.0, "%"),
}


def varied(dataset: Dataset, variation: Variation, seed: int = 0) -> Dataset:
    """The data set of a laboratory that has this thing wrong; its true friction stays.

    seed : of the noise that is added

    Raises
    ------
    InputError
        Where the mechanism lacks the parameter, or the change makes it impossible.
    """
    if variation.cause == "nominal":
        return dataset
    if variation.cause == "noise":
        return _with_noise(dataset, variation.amount, seed)
    return _CHANGES[variation.cause](dataset, variation)


def sensitive_parameters(dataset: Dataset) -> tuple[str, ...]:
    """Physical parameters on which the nominal motion of the mechanism depends, without gravity.

    >>> from frictionid import load_dataset
    >>> sensitive_parameters(load_dataset("acrobot_clean"))[:4]
    ('m1', 'm2', 'm3', 'm4')
    """
    mechanism = dataset.mechanism
    values = mechanism.nominal()
    base = np.asarray(mechanism.base(values))
    return tuple(
        p.name
        for p in mechanism.parameters
        if values[p.name] != 0.0
        and p.unit != "m/s^2"
        and not np.allclose(mechanism.base({**values, p.name: 1.1 * values[p.name]}), base, 1e-6, 0)
    )


def _with_parameter(dataset: Dataset, variation: Variation) -> Dataset:
    """The mechanism, and each recording that has a value of its own, off by the same share."""
    name, factor = variation.parameter, 1.0 + variation.amount
    dataset.mechanism.check_name(name)
    values = {name: factor * dataset.mechanism.nominal()[name]}
    mechanism = dataset.mechanism.with_values(values)
    mechanism.nominal()  # refuses what no machine has
    recordings = tuple(
        replace(r, parameters={**r.parameters, name: factor * r.parameters[name]})
        if name in r.parameters
        else r
        for r in dataset.recordings
    )
    return replace(dataset, mechanism=mechanism, recordings=recordings)


def _with_calibration(dataset: Dataset, variation: Variation) -> Dataset:
    """The torque logged so much later or larger than it was, or angles from a base that is tilted.

    The tilt, or that of a camera, is an offset of the first joint.
    """
    joints, amount = dataset.mechanism.n, variation.amount
    ideal, offset = Calibration.ideal(joints), np.zeros(joints)
    offset[0] = -np.deg2rad(amount)
    if variation.cause == "tilt" and dataset.mechanism.position_units[0] != "rad":
        raise InputError(
            f"data set {dataset.name!r}: joint {dataset.mechanism.joints[0]} slides, a tilt of the "
            "base is no offset of it: leave the tilt out"
        )
    wrong = {
        "delay": replace(ideal, delay=np.array(amount)),
        "gain": replace(ideal, gain=ideal.gain * (1.0 + amount)),
        "tilt": replace(ideal, offset=offset),
    }
    return calibrated_dataset(dataset, wrong[variation.cause])


def _with_noise(dataset: Dataset, amount: float, seed: int) -> Dataset:
    """Independent noise added to the angles; recordings draw from streams of their own."""
    turns = np.array([unit == "rad" for unit in dataset.mechanism.position_units])
    added = np.deg2rad(amount) * np.where(turns, 1.0, dataset.scales.size)

    def noisy(recording: Recording, stream: np.random.SeedSequence) -> Recording:
        angle = recording.angle
        noise = added * np.random.default_rng(stream).standard_normal(angle.value.shape)
        sigma = None if angle.sigma is None else np.hypot(angle.sigma, added)
        return replace(recording, angle=angle._replace(value=angle.value + noise, sigma=sigma))

    streams = np.random.SeedSequence(seed).spawn(len(dataset.recordings))
    recordings = tuple(map(noisy, dataset.recordings, streams))
    return replace(dataset, recordings=recordings)


def _at_lower_rate(dataset: Dataset, variation: Variation) -> Dataset:
    """One of so many samples of the angles; the torque's clock stays."""
    keep = int(variation.amount)

    def thinned(recording: Recording) -> Recording:
        if len(recording.angle.time) < keep * FEWEST:
            raise InputError(
                f"data set {dataset.name!r}: recording {recording.name!r} has "
                f"{len(recording.angle.time)} samples, one of {keep} leaves fewer than {FEWEST}: "
                "leave this rate out"
            )
        return with_samples(recording, lambda signal: np.arange(0, len(signal.time), keep))

    return replace(dataset, recordings=tuple(map(thinned, dataset.recordings)))


def with_samples(recording: Recording, chosen: Callable[[Signal], Array]) -> Recording:
    """The recording with some samples of angles and velocities; the torque's clock stays.

    chosen : mask, or increasing indices, of the samples of a signal
    """
    velocity = recording.velocity and taken(recording.velocity, chosen(recording.velocity))
    angle = taken(recording.angle, chosen(recording.angle))
    return replace(recording, angle=angle, velocity=velocity)


def _with_fewer(dataset: Dataset, variation: Variation) -> Dataset:
    """A share of the recordings, spread evenly over their order."""
    count = max(1, round(variation.amount * len(dataset.recordings)))
    chosen = evenly(len(dataset.recordings), count)
    return replace(dataset, recordings=tuple(dataset.recordings[i] for i in chosen))


_CHANGES: Mapping[str, Callable[[Dataset, Variation], Dataset]] = {
    "parameter": _with_parameter,
    **dict.fromkeys(("delay", "gain", "tilt"), _with_calibration),
    "rate": _at_lower_rate,
    "recordings": _with_fewer,
}


Share = Annotated[float, Field(gt=-1.0, lt=10.0)]


class SensitivitySettings(Strict):
    """What is wrong on purpose, and by how much; an empty list leaves a cause out.

    parameters : of the mechanism; all that its motion depends on if not given
    levels : relative errors of each; gain : of the torque
    delay : [s] that the torque is logged late
    tilt : [deg] of the base, where the first joint turns
    noise : [deg] standard deviations added to the angles; rate : one sample of so many is kept
    recordings : shares of the recordings that are fitted
    identifiers, recipes : names of those that are fitted; if not given, the first law that draws no
        random numbers, and all its recipes
    horizon : [s] of the rollout error
    """

    parameters: list[str] | None = None
    levels: list[Share] = [-0.1, 0.1]
    gain: list[Share] = [-0.1, 0.1]
    delay: list[float] = [-0.005, 0.005]
    tilt: list[float] = [-1.0, 1.0]
    noise: list[Positive] = [0.1, 0.3]
    rate: list[Annotated[int, Field(ge=2)]] = [2]
    recordings: list[Annotated[float, Field(gt=0.0, lt=1.0)]] = [0.25, 0.5]
    identifiers: NonEmpty[str] | None = None
    recipes: NonEmpty[str] | None = None
    horizon: Positive = 0.5

    @model_validator(mode="after")
    def _each_once(self) -> "SensitivitySettings":
        for name, values in self:
            if isinstance(values, list) and len(set(values)) < len(values):
                raise ValueError(f"{name} must differ, they are {values}")
        return self


def variations_of(dataset: Dataset, settings: SensitivitySettings) -> tuple[Variation, ...]:
    """Variations of a data set, the nominal one first.

    A tilt is left out where the first joint slides, delay and gain where there is no torque, fewer
    recordings where there is one only.
    """
    names = settings.parameters
    names = list(sensitive_parameters(dataset)) if names is None else names
    for name in names:
        dataset.mechanism.check_name(name)
    driven = bool(dataset.actuated.any())
    offered = {
        "delay": driven,
        "gain": driven,
        "tilt": dataset.mechanism.position_units[0] == "rad",
        "noise": True,
        "rate": True,
        "recordings": len(dataset.recordings) > 1,
    }
    return (
        NOMINAL,
        *(Variation("parameter", level, name) for name in names for level in settings.levels),
        *(
            Variation(cause, float(amount))
            for cause, applies in offered.items()
            for amount in getattr(settings, cause)
            if applies
        ),
    )
