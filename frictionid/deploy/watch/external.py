"""External torque of each joint with its band, and contacts at a stated rate of false ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.api.fitted import Fit
from frictionid.api.models import DatasetLike, dataset_of, friction_of
from frictionid.arrays import Array
from frictionid.data.calibration import calibrated_plant
from frictionid.data.integrals import averages
from frictionid.data.plants import plant_of, refuse_torques
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import holds
from frictionid.deploy.compensation import friction_in
from frictionid.deploy.watch.members import members_of
from frictionid.deploy.watch.momentum_observer import MomentumObserver, Observed
from frictionid.errors import InputError
from frictionid.fitting.gauss_newton import MAD
from frictionid.friction import Friction

_DELAYS = 2.33  # of the observer's rate, which those of both filters add up to
_BLOCK = 2000  # samples at a time, to spare memory
_TAIL = 0.1  # share of the largest values that shows how fast they become rare
_FEWEST = 20  # values in it


class Band(NamedTuple):
    """What the torque of a machine without contact is off by.

    noise (n,) [N m] by the model's errors on quiet recordings; spread (n,) [N m] by its parameters
    there; factor (n,) times which standard deviation a torque is a contact; rate : of false
    contacts [1/h]; hours : of quiet recordings; response : by which torques lag [s]
    """

    noise: Array
    spread: Array
    factor: Array
    rate: float
    hours: float
    response: float


class Contact(NamedTuple):
    """Where the band excludes zero: recording, begin and end [s], joint, and torque there [N m]."""

    recording: str
    begin: float
    end: float
    joint: str
    torque: float


@dataclass(frozen=True, eq=False, repr=False)
class ExternalTorque:
    """Torque from outside, with its band.

    Attributes
    ----------
    joints : tuple of n str
    band_of : Band
    names : tuple of R str, of the recordings
    time : tuple of R arrays (K,) [s]
    torque, band : tuples of R arrays (K, n) [N m]
        NaN before the filters have settled.
    """

    joints: tuple[str, ...]
    band_of: Band
    names: tuple[str, ...]
    time: tuple[Array, ...]
    torque: tuple[Array, ...]
    band: tuple[Array, ...]

    def __repr__(self) -> str:
        hours = sum(float(np.ptp(t)) for t in self.time) / 3600.0
        contacts = self.contacts
        lines = [
            f"{len(contacts)} contacts in {hours:.3g} h; false ones at {self.band_of.rate:g} an "
            f"hour, by {self.band_of.hours:.3g} h without contact"
        ]
        for c in contacts[:10]:
            lines.append(
                f"{c.recording}: {c.joint}, {c.begin:.3f} to {c.end:.3f} s, {c.torque:+.3g} N m"
            )
        return "\n".join(
            [*lines, *([f"and {len(contacts) - 10} more"] if len(contacts) > 10 else [])]
        )

    @cached_property
    def frame(self) -> pd.DataFrame:
        """Columns recording, time [s], and torquej, bandj [N m] and contactj of each joint j."""
        parts = []
        for name, time, torque, band in zip(
            self.names, self.time, self.torque, self.band, strict=True
        ):
            part = {"recording": name, "time": time}
            for j in range(len(self.joints)):
                part[f"torque{j + 1}"], part[f"band{j + 1}"] = torque[:, j], band[:, j]
                part[f"contact{j + 1}"] = np.abs(torque[:, j]) > band[:, j]
            parts.append(pd.DataFrame(part))
        return pd.concat(parts, ignore_index=True)

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """Stretches in which the band of a joint excludes zero."""
        return tuple(
            contact
            for row in zip(self.names, self.time, self.torque, self.band, strict=True)
            for contact in contacts_in(*row, self.joints, self.band_of.response)
        )


def contacts_in(
    name: str,
    time: Array,
    torque: Array,
    band: Array,
    joints: tuple[str, ...],
    apart: float,
) -> Iterator[Contact]:
    """Contacts of one recording, time (K,), torque and band (K, n); one where closer than apart."""
    for j, joint in enumerate(joints):
        over = np.flatnonzero(np.abs(torque[:, j]) > band[:, j])
        for rows in np.split(over, np.flatnonzero(np.diff(time[over]) > apart) + 1):
            if len(rows):
                most = torque[rows, j][np.abs(torque[rows, j]).argmax()]
                yield Contact(name, float(time[rows[0]]), float(time[rows[-1]]), joint, float(most))


def momentum_observer_of(
    friction: Friction, dataset: Dataset, run: int, response: float
) -> MomentumObserver:
    """MomentumObserver of one recording's machine by a fit's friction and calibration.

    response : total delay of its filters [s]
    """
    if friction.mechanism or friction.theta.ndim != 2:
        raise InputError("external torque: the model must hold one friction with physics")
    if friction.law.uses_load and dataset.mechanism.loads_of_gears:
        raise InputError(
            "external torque: friction that follows a gear's load follows contacts, too: fit a law "
            "without load"
        )
    calibration, mechanism = friction.calibration, dataset.mechanism
    plant = plant_of(dataset) if calibration is None else calibrated_plant(dataset, calibration)
    slow = np.abs(mechanism.friction_map) @ np.array(plant.slow)
    level = np.array([abs(friction.curve(slow[j : j + 1])[0, j]) for j in range(len(slow))])
    members = members_of(friction, mechanism, np.asarray(plant.p[run], dtype=float))
    return MomentumObserver(friction, plant[run], members, _DELAYS / response, slow, level)


def interval_torques(recording: Recording) -> Array:
    """Mean logged torque (K - 1, n) between neighbouring angles; of one clock, sample by sample."""
    torque, time = recording.torque, recording.angle.time
    if not np.array_equal(torque.time, time):
        return averages(torque, time)
    value = np.asarray(torque.value, dtype=float)
    return value[:-1] if holds(torque) else (value[:-1] + value[1:]) / 2


def observed(momentum_observer: MomentumObserver, recording: Recording) -> Iterator[Observed]:
    """What the observer says of a recording, some samples at a time."""
    time, angle = recording.angle.time, np.asarray(recording.angle.value, dtype=float)
    torque = interval_torques(recording)
    state = momentum_observer.start(float(time[0]), angle[0], torque[0])
    for a in range(1, len(time), _BLOCK):
        rows = slice(a, a + _BLOCK)
        state, said = momentum_observer.advance(
            state, time[rows], angle[rows], torque[a - 1 : a - 1 + _BLOCK]
        )
        yield said


def deviation(said: Observed, noise: Array) -> Array:
    """Standard deviation (K, n) of the torque: the model's error, its parameters, and rest."""
    return np.sqrt(noise**2 + _by_parameters(said) + said.stick**2)


def _by_parameters(said: Observed) -> Array:
    """Variance (K, n) of the torque by the parameters."""
    return np.asarray(((said.torque[:, 1:] - said.torque[:, :1]) ** 2).sum(axis=1))


def band_of(friction: Friction, quiet: Dataset, response: float, rate: float) -> Band:
    """Band by recordings without contact.

    The factor is where the largest ratios of torque and deviation, one of each response time, are
    as rare as asked for: the largest tenth falls off exponentially beyond its threshold, as most
    distributions do [Pickands1975].

    Raises
    ------
    InputError
        Where they are too short.
    """
    said = [
        list(observed(momentum_observer_of(friction, quiet, r, response), x))
        for r, x in enumerate(quiet.recordings)
    ]
    torque = np.concatenate([s.torque[s.settled, 0] for run in said for s in run])
    if len(torque) < _FEWEST / _TAIL:
        raise InputError(
            f"data set {quiet.name!r}: {len(torque)} samples without contact are too few for a "
            "band: give longer recordings"
        )
    moving = np.concatenate([s.stick[s.settled] for run in said for s in run])
    slides = moving < np.median(moving, axis=0) + 1e-12
    noise = np.array(
        [MAD * np.median(np.abs(t[m])) for t, m in zip(torque.T, slides.T, strict=True)]
    )
    noise = np.maximum(noise, 1e-9)
    peaks, hours = [], 0.0
    for run in said:
        ratio = np.concatenate([np.abs(s.torque[:, 0]) / deviation(s, noise) for s in run])
        time, settled = (np.concatenate([getattr(s, k) for s in run]) for k in ("time", "settled"))
        if settled.any():
            time, ratio = time[settled], ratio[settled]
            edges = np.flatnonzero(np.diff(np.floor((time - time[0]) / response))) + 1
            peaks.append(np.maximum.reduceat(ratio, np.concatenate([[0], edges])))
            hours += float(np.ptp(time)) / 3600.0
    largest = np.concatenate(peaks)
    each = rate / largest.shape[1]
    factor = np.array([_factor(x, hours, each) for x in largest.T])
    spread = np.sqrt(np.mean([_by_parameters(s).mean(axis=0) for run in said for s in run], axis=0))
    return Band(noise, spread, factor, rate, hours, response)


def _factor(peaks: Array, hours: float, rate: float) -> float:
    """Value that peaks exceed `rate` times an hour, by their exponential tail.

    >>> peaks = np.random.default_rng(0).exponential(size=10_000)
    >>> round(_factor(peaks, 1.0, 1.0), 1)  # ln 10000 = 9.2
    9.2
    """
    count = max(int(_TAIL * len(peaks)), min(_FEWEST, len(peaks) - 1))
    ordered = np.sort(peaks)[::-1]
    threshold, scale = ordered[count], float((ordered[:count] - ordered[count]).mean())
    return float(max(threshold + scale * np.log(count / (hours * rate)), 1.0))


def external_torque(
    fit: Any,
    data: DatasetLike,
    *,
    quiet: DatasetLike | None = None,
    response: float = 0.1,
    rate: float = 1.0,
) -> ExternalTorque:
    """Torque that acts on each joint from outside, with its band, and contacts.

    The momentum observer [DeLuca2003] with the fit's friction, inertia and sensors. The band is by
    their covariance, by the model's errors on recordings without contact, and by friction, which
    may be anything up to its level while a joint rests.

    Parameters
    ----------
    fit : Fit, Friction or path of a model file
    data : data set
        Of the same machine.
    quiet : data set, optional
        Recordings without contact, best such as were not fitted; those of the fit.
    response : float [s]
        By which the torque lags; the shorter, the noisier.
    rate : float [1/h]
        Of false contacts, over all joints.

    Raises
    ------
    InputError
        Where the model holds no friction with physics, or nothing without contact is at hand.

    Examples
    --------
    >>> import frictionid as fid
    >>> fit = fid.fit("acrobot_clean", "stribeck")
    >>> torque = external_torque(fit, "acrobot_clean")
    >>> torque.joints, len(torque.contacts) < 3
    (('joint 1', 'joint 2'), True)
    """
    friction = friction_in(friction_of(fit))
    for name, value in (("response", response), ("rate", rate)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} = {value} must be a positive number")
    without = quiet if quiet is not None else fit.data if isinstance(fit, Fit) else None
    if without is None:
        raise InputError("external torque: name recordings without contact: quiet = a data set")
    dataset = dataset_of(data)
    refuse_torques(dataset)
    band = band_of(friction, dataset_of(without), response, rate)
    rows = [
        _judged(momentum_observer_of(friction, dataset, r, response), x, band)
        for r, x in enumerate(dataset.recordings)
    ]
    time, torque, bands = zip(*rows, strict=True)
    names = tuple(r.name for r in dataset.recordings)
    return ExternalTorque(dataset.mechanism.joints, band, names, time, torque, bands)


def with_band(said: Observed, band: Band) -> tuple[Array, Array]:
    """Torque and half the band's width (K, n) [N m]; NaN before the filters have settled."""
    valid = np.where(said.settled, 1.0, np.nan)[:, None]
    return valid * said.torque[:, 0], valid * band.factor * deviation(said, band.noise)


def _judged(
    momentum_observer: MomentumObserver, recording: Recording, band: Band
) -> tuple[Array, Array, Array]:
    """Time (K,), torque and band (K, n) of a recording, from its second sample on."""
    time, pairs = [], []
    for said in observed(momentum_observer, recording):
        time.append(said.time)
        pairs.append(with_band(said, band))
    torque, bands = (np.concatenate(x) for x in zip(*pairs, strict=True))
    return np.concatenate(time), torque, bands
