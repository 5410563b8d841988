"""External torque of each joint with its band, and contacts at a stated rate of false ones."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import nnls
from scipy.special import log_ndtr, ndtri_exp

from frictionid.api.fit import fit as fit_again
from frictionid.api.fitted import Fit
from frictionid.api.models import DatasetLike, dataset_of, friction_of
from frictionid.arrays import MAD, Array, joined, picked, rms
from frictionid.data.integrals import averages
from frictionid.data.plants import calibrated_plant, plant_of, refuse_torques, with_calibrated_servo
from frictionid.data.readers.dataset import within
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Signal, holds
from frictionid.errors import InputError
from frictionid.evaluation.predicted_motion import check_joints
from frictionid.friction import Friction

from .compensation import friction_in
from .momentum_observer import SETTLING, MomentumObserver, Observed, members_of

_DELAYS = 2.33  # of the observer's rate, which those of both filters add up to
_BLOCK = 2000  # samples at a time, to spare memory
_TAIL = 0.1  # share of the largest values that shows how fast they become rare
_FEWEST = 20  # values, and those in it
_FOLDS = 3
_ROUNDS, _CLIP = 4, 3.0  # of the fit of noises, and standard deviations beyond which none counts


class Band(NamedTuple):
    """What the torque of a machine without contact is off by.

    noise (n,) [N m] by the model's errors on quiet recordings; shake (n,) [rad/s^2] by the angles'
    noise, which M makes a torque; spread (n,) [N m] by the parameters there; factor (n,) times
    which standard deviation a torque is a contact; rate : of false contacts [1/h]; hours : of quiet
    recordings; response : by which torques lag [s]
    """

    noise: Array
    shake: Array
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
        if len(contacts) > 10:
            lines.append(f"and {len(contacts) - 10} more")
        return "\n".join(lines)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """Columns recording, time [s], and torquej, bandj [N m] and contactj of each joint j."""
        parts = []
        for name, time, torque, band in self._recordings:
            part = {"recording": name, "time": time}
            for j in range(len(self.joints)):
                part[f"torque{j + 1}"], part[f"band{j + 1}"] = torque[:, j], band[:, j]
                part[f"contact{j + 1}"] = np.abs(torque[:, j]) > band[:, j]
            parts.append(pd.DataFrame(part))
        return pd.concat(parts, ignore_index=True)

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """Stretches in which the band of a joint excludes zero.

        Those that are closer than the response are one.
        """
        contacts = []
        for name, time, torque, band in self._recordings:
            for j, joint in enumerate(self.joints):
                size = np.abs(torque[:, j])
                over = np.flatnonzero(size > band[:, j])
                new = np.diff(time[over]) > self.band_of.response
                for rows in np.split(over, np.flatnonzero(new) + 1):
                    if len(rows):
                        begin, end = time[rows[[0, -1]]].tolist()
                        most = float(torque[rows[size[rows].argmax()], j])
                        contacts.append(Contact(name, begin, end, joint, most))
        return tuple(contacts)

    @property
    def _recordings(self) -> Iterator[tuple[str, Array, Array, Array]]:
        """Name, time, torque and band of each recording."""
        return zip(self.names, self.time, self.torque, self.band, strict=True)


def momentum_observer_of(
    friction: Friction, dataset: Dataset, run: int, response: float
) -> MomentumObserver:
    """MomentumObserver of one recording's machine by a fit's friction and calibration.

    response : total delay of its filters [s]
    """
    if friction.mechanism or friction.theta.ndim != 2:
        raise InputError("external torque: the model must hold one friction with physics")
    check_joints(friction, dataset)
    if friction.law.uses_load and dataset.mechanism.loads_of_gears:
        raise InputError(
            "external torque: friction that follows a gear's load follows contacts, too: fit a law "
            "without load"
        )
    calibration, mechanism = friction.calibration, dataset.mechanism
    if mechanism.floating:
        raise InputError("external torque: it is found on machines whose base stands still")
    plant = plant_of(dataset) if calibration is None else calibrated_plant(dataset, calibration)
    slow = np.abs(mechanism.friction_map) @ np.array(plant.slow)
    level = np.abs(friction.curve(slow[None])[0])
    members = members_of(friction, mechanism, np.asarray(plant.p[run], dtype=float))
    return MomentumObserver(friction, plant[run], members, _DELAYS / response, slow, level)


def interval_torques(torque: Signal, time: Array) -> Array:
    """Mean logged torque (K - 1, n) between neighbouring angles; of one clock, sample by sample."""
    if not np.array_equal(torque.time, time):
        return averages(torque, time)
    value = np.asarray(torque.value, dtype=float)
    return value[:-1] if holds(torque) else (value[:-1] + value[1:]) / 2


def observed(friction: Friction, dataset: Dataset, run: int, response: float) -> Iterator[Observed]:
    """What the observer says of one recording, some samples at a time."""
    momentum_observer = momentum_observer_of(friction, dataset, run, response)
    recording = with_calibrated_servo(dataset.recordings[run], friction.calibration)
    time, angle = recording.angle.time, np.asarray(recording.angle.value, dtype=float)
    torque = interval_torques(recording.torque, time)
    state = momentum_observer.start(float(time[0]), angle[0], torque[0])
    for a in range(1, len(time), _BLOCK):
        rows = slice(a, a + _BLOCK)
        state, said = momentum_observer.advance(
            state, time[rows], angle[rows], torque[a - 1 : a - 1 + _BLOCK]
        )
        yield said


def deviation(said: Observed, noise: Array, shake: Array) -> Array:
    """Standard deviation (K, n) of the torque: errors of model, angles, parameters, and rest."""
    return np.sqrt(noise**2 + said.M**2 @ shake**2 + said.spread**2 + said.stick**2)


def settled(several: Iterable[Observed]) -> Observed:
    """What was said of some samples after the other, where the filters have settled."""
    both = joined(several)
    return picked(both, both.settled)


def noises(said: Observed) -> tuple[Array, Array]:
    """Noise and shake (n,) of independent samples, by the squares of torques of joints that slide.

    Nonnegative least squares in units of what they explain, robust against single contacts.
    """
    n = said.torque.shape[1]
    slides = said.stick <= np.median(said.stick, axis=0)
    squares = (said.torque**2)[slides]
    columns = np.concatenate([np.broadcast_to(np.eye(n), said.M.shape), said.M**2], axis=-1)[slides]
    usual = np.maximum(MAD**2 * np.median(said.torque**2, axis=0), 1e-18)
    variance = np.broadcast_to(usual, slides.shape)[slides]
    for _ in range(_ROUNDS):
        clipped = np.minimum(squares, _CLIP**2 * variance) / variance
        variances, _ = nnls(columns / variance[:, None], clipped)
        variance = np.maximum(columns @ variances, 1e-18)
    return np.sqrt(np.maximum(variances[:n], 1e-18)), np.sqrt(variances[n:])


def held_out(fit: Fit) -> Iterator[tuple[Friction, Dataset]]:
    """Frictions of folds of the fit's recordings, with those that each has not seen.

    By the fit's law, method and blocks; a single recording is cut into two.
    """
    assert fit.data is not None
    recordings, source = fit.data.recordings, fit.friction.provenance
    if len(recordings) == 1:
        half = recordings[0].angle.duration / 2
        recordings = within(recordings[0], 0.0, half), within(recordings[0], half, np.inf)
    refined = source.refined
    free = None if refined is None else sorted({e.block for e in refined.parameters})
    for k in range(count := min(_FOLDS, len(recordings))):
        seen = tuple(r for i, r in enumerate(recordings) if i % count != k)
        again = fit_again(
            replace(fit.data, recordings=seen),
            fit.friction.law,
            method=fit.method,
            free=free,
            sample_time=source.sample_time,
        )
        yield again.friction, replace(fit.data, recordings=recordings[k::count])


def band_of(quiet: Iterable[tuple[Friction, Dataset]], response: float, rate: float) -> Band:
    """Band by recordings without contact, each set with the friction that is to explain it.

    The factor is where the largest ratios of torque and deviation, one of each response time, are
    as rare as asked for, by the tail of the largest tenth.

    Raises
    ------
    InputError
        Where they are too short, and for numbers that are not positive.
    """
    for name, value in (("response", response), ("rate", rate)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} = {value} must be a positive number")
    runs = [
        settled(observed(friction, dataset, r, response))
        for friction, dataset in quiet
        for r in range(len(dataset.recordings))
    ]
    edges = [_edges(run.time, response) for run in runs]
    if sum(map(len, edges)) < _FEWEST:
        raise InputError(
            "external torque: recordings without contact are too short for a band: give "
            f"{_FEWEST * response:g} s and more beside {SETTLING * response / _DELAYS:.2g} s at "
            "the begin of each"
        )
    noise, shake = noises(settled(map(picked, runs, edges)))
    largest = np.concatenate(
        [
            np.maximum.reduceat(np.abs(run.torque) / deviation(run, noise, shake), e)
            for run, e in zip(runs, edges, strict=True)
            if len(e)
        ]
    )
    hours = sum(float(np.ptp(run.time)) for run in runs if len(run.time)) / 3600.0
    each = rate / largest.shape[1]
    factor = np.array([_factor(x, hours, each) for x in largest.T])
    spread = rms(np.concatenate([run.spread for run in runs]), 0)
    return Band(noise, shake, spread, factor, rate, hours, response)


def _edges(time: Array, response: float) -> Array:
    """Indices of the first sample in each response time."""
    blocks = np.floor((time - time[:1]) / response)
    return np.flatnonzero(np.diff(blocks, prepend=-1.0))


def _factor(peaks: Array, hours: float, rate: float) -> float:
    """Value that peaks exceed `rate` times an hour, by their tail.

    Beyond a threshold they are as rare as exponential values [Pickands1975], or as normal ones,
    whichever is likelier.

    >>> random = np.random.default_rng(0)
    >>> round(_factor(random.exponential(size=10_000), 1.0, 1.0), 1)  # ln 10000 = 9.2
    9.2
    >>> round(_factor(np.abs(random.normal(size=100_000)), 1.0, 1.0), 1)  # two-sided 1e-5
    4.4
    """
    count = max(int(_TAIL * len(peaks)), min(_FEWEST, len(peaks) - 1))
    ordered = np.sort(peaks)[::-1]
    threshold, rarer = ordered[count], np.log(count / (hours * rate))
    tail = ordered[:count] - threshold
    scale = float(tail.mean())
    # minus the logarithm of a normal value's tail is exponential
    rare = -log_ndtr(-ordered[: count + 1])
    normal_scale = float((rare[:count] - rare[count]).mean())
    slopes = rare[:count] - ordered[:count] ** 2 / 2 - np.log(2.0 * np.pi) / 2
    if float(slopes.mean()) - np.log(normal_scale) < -np.log(scale):
        return float(max(threshold + scale * rarer, 1.0))
    return float(max(-ndtri_exp(-(rare[count] + normal_scale * rarer)), 1.0))


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
        Recordings without contact, best such as were not fitted. None: those of the fit, each by a
        fit to the others, which takes as long as three fits.
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
    >>> fit = fid.fit("acrobot_clean", "stribeck", method="one_step")
    >>> torque = external_torque(fit, "acrobot_clean", quiet="acrobot_clean")
    >>> torque.joints, len(torque.contacts) < 3
    (('joint 1', 'joint 2'), True)
    """
    friction = friction_in(friction_of(fit))
    dataset = dataset_of(data)
    refuse_torques(dataset)
    if quiet is not None:
        without = iter([(friction, dataset_of(quiet))])
    elif isinstance(fit, Fit) and fit.data is not None:
        without = held_out(fit)
    else:
        raise InputError("external torque: name recordings without contact: quiet = a data set")
    band = band_of(without, response, rate)
    rows = []
    for r in range(len(dataset.recordings)):
        parts = observed(friction, dataset, r, response)
        blocks = ((said.time, *with_band(said, band)) for said in parts)
        rows.append(map(np.concatenate, zip(*blocks, strict=True)))
    time, torque, bands = zip(*rows, strict=True)
    return ExternalTorque(dataset.mechanism.joints, band, dataset.names, time, torque, bands)


def with_band(said: Observed, band: Band) -> tuple[Array, Array]:
    """Torque and half the band's width (K, n) [N m]; NaN before the filters have settled."""
    valid = np.where(said.settled, 1.0, np.nan)[:, None]
    size = deviation(said, band.noise, band.shake)
    return valid * said.torque, valid * band.factor * size
