"""Gross outliers of logged torques: single samples that the motion does not show.

A torque may jump: it is switched, quantised, cut off. A sample that stands off from its neighbours
is therefore only a candidate, and the momentum balance decides. Over each sample interval

    p = ((M w)1 - (M w)0) / dt - mean(dL/dq) - mean(u) = - mean(Tf) - sum_k a_k F_k d_k

with the mean F_k that candidate k adds to the interval per unit, and how far d_k it stands off. Of
a torque that acted the share a_k is zero, of one that did not it is one. Both sides are averaged
over a few intervals, over which the smoother spreads what acts within one.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, diags_array

from frictionid.arrays import MAD, Array, usual_step
from frictionid.data.integrals import averages
from frictionid.data.plants import on_recorded_base
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import States
from frictionid.mechanics import Plant
from frictionid.mechanics.plant import interval_stencil, momentum_balance, with_midpoints

_OFF = 6.0  # times the usual distance from the neighbours
_ALIKE = 0.8  # of what a neighbour is off: the same size
_BLUR = 0.03  # [s], of the smoothed motion to either side
_CLEAR = 4.0  # standard errors of a share that is no chance
_SHARE = (0.6, 1.6)  # of a sample that did not act
_CLIP = 3.0  # standard deviations beyond which the balances of an interval count less
_SMALL = 2.0  # times the noise of the balances: no candidate
_ROUNDS, _FITS = 4, 5  # of the search, and of Huber's weights


def torque_outliers(dataset: Dataset, plant: Plant, states: Sequence[States]) -> tuple[Array, ...]:
    """Which logged torques of each recording are gross outliers, (T, n) of bool each.

    Those that hide beside others are found when these have been replaced.

    plant : one entry for each recording ; states : smoothed, of all recordings
    """
    out = [np.zeros(np.shape(r.torque.value), dtype=bool) for r in dataset.recordings]
    for _ in range(_ROUNDS):
        masks = _outliers(dataset, plant, states)
        if not any(mask.any() for mask in masks):
            break
        out = [a | b for a, b in zip(out, masks, strict=True)]
        dataset = with_torques_replaced(dataset, out)
    return tuple(out)


def without_torque_outliers(dataset: Dataset, plant: Plant, states: Sequence[States]) -> Dataset:
    """The data set with torques that are gross outliers replaced: by lines between the others."""
    return with_torques_replaced(dataset, torque_outliers(dataset, plant, states))


def with_torques_replaced(dataset: Dataset, masks: Sequence[Array]) -> Dataset:
    """The data set with lines between the other torques where masks (T, n) say so."""
    if not any(mask.any() for mask in masks):
        return dataset
    pairs = zip(dataset.recordings, masks, strict=True)
    return replace(dataset, recordings=tuple(_mended(r, mask) for r, mask in pairs))


def _outliers(dataset: Dataset, plant: Plant, states: Sequence[States]) -> list[Array]:
    """Outliers (T, n) of each recording that show with the torques as they stand."""
    driven = np.array(plant.mechanism.driven, dtype=bool)
    off = [_off(r.torque) * driven * (r.servo is None) for r in dataset.recordings]
    out = [np.zeros(x.shape, dtype=bool) for x in off]
    if not any(x.any() for x in off) or not any(len(s.time) > 1 for s in states):
        return out
    pairs = zip(dataset.recordings, states, strict=True)
    rows = [_balances(plant[i], *pair) for i, pair in enumerate(pairs)]
    for j in np.flatnonzero(np.any([x.any(axis=0) for x in off], axis=0)):
        noise, left = _without_friction([p[:, j] for p in rows], [s.w[:, j] for s in states])
        for i, recording in enumerate(dataset.recordings):
            at = np.flatnonzero(np.abs(off[i][:, j]) > _SMALL * noise)
            if len(at) and len(left[i]) > 2:
                torque, time = recording.torque, states[i].time
                footprint = _footprint(torque, at, off[i][at, j], time)
                out[i][at, j] = _did_not_act(footprint, left[i], noise, time)
    return out


def _mended(recording: Recording, mask: Array) -> Recording:
    torque = recording.torque
    value = np.array(torque.value, dtype=float)
    for j in np.flatnonzero(mask.any(axis=0)):
        bad = mask[:, j]
        value[bad, j] = np.interp(torque.time[bad], torque.time[~bad], value[~bad, j])
    return replace(recording, torque=torque._replace(value=value))


def _off(torque: Signal) -> Array:
    """How far samples (T, n) are off the median of two neighbours to either side.

    Zero where that is usual, or where one of these neighbours is farther off.
    """
    value = torque.value
    if len(value) < 8:
        return np.zeros_like(value)

    def beside(padded: Array) -> Array:
        return np.stack([padded[k : k + len(value)] for k in (0, 1, 3, 4)])

    ends = (2, 2), (0, 0)
    off = value - np.median(beside(np.pad(value, ends, mode="edge")), axis=0)
    size = np.abs(off)
    usual = MAD * np.median(size, axis=0)
    highest = beside(np.pad(size, ends)).max(axis=0)
    stands_off = (size > np.maximum(_OFF * usual, 1e-9)) & (size > _ALIKE * highest)
    return np.where(stands_off, off, 0.0)


def _balances(plant: Plant, recording: Recording, states: States) -> Array:
    """Balances p (K, n) [N m] of the intervals between the states."""
    at, q, w = with_midpoints(*states.motion)
    terms = on_recorded_base(plant, recording, at).terms(q, w)
    start, end, force = momentum_balance(terms, interval_stencil(len(states.time)))
    dt = np.diff(states.time)[:, None]
    u = averages(recording.torque, states.time)
    return (end - start) / dt - force - u


def _without_friction(balances: list[Array], speeds: list[Array]) -> tuple[float, list[Array]]:
    """Noise [N m] of one joint's balances (K,), and these without Coulomb and viscous friction."""
    w = np.concatenate([(x[1:] + x[:-1]) / 2 for x in speeds])
    sign = np.concatenate([(np.sign(x[1:]) + np.sign(x[:-1])) / 2 for x in speeds])
    p = np.concatenate(balances)
    A = np.stack([sign, w, np.ones_like(w)], axis=1)
    weight = np.ones_like(p)
    for _ in range(_FITS):
        root = np.sqrt(weight)
        left = p - A @ np.linalg.lstsq(A * root[:, None], p * root, rcond=1e-9)[0]
        noise = max(MAD * float(np.median(np.abs(left))), 1e-12)
        weight = np.minimum(1.0, _CLIP * noise / np.maximum(np.abs(left), 1e-300))
    return noise, np.split(left, np.cumsum([len(x) for x in balances])[:-1])


def _footprint(torque: Signal, at: Array, off: Array, time: Array) -> csr_array:
    """What C samples of a torque, that far off, add to its means over the intervals, (K, C)."""
    clock, K = torque.time, len(time) - 1
    rows, means = [], []
    for k, size in zip(at, off, strict=True):
        local = slice(max(k - 1, 0), k + 2)
        value = np.where(np.arange(local.start, min(local.stop, len(clock))) == k, size, 0.0)
        first = max(int(np.searchsorted(time, clock[local][0], side="right")) - 1, 0)
        last = min(int(np.searchsorted(time, clock[local][-1], side="left")), K)
        edges = time[min(first, K - 1) : max(last, 1) + 1]
        means.append(averages(Signal(clock[local], value[:, None], torque.hold), edges)[:, 0])
        rows.append(min(first, K - 1) + np.arange(len(edges) - 1))
    column = np.repeat(np.arange(len(at)), [len(r) for r in rows])
    place = np.concatenate(rows), column
    return csr_array((np.concatenate(means), place), shape=(K, len(at)))


def _did_not_act(footprint: csr_array, left: Array, noise: float, time: Array) -> Array:
    """Which of C candidates the balances (K,) of a recording deny, see the module."""
    half = max(round(_BLUR / usual_step(time)), 2)
    F, p = _blurred(footprint, half), np.convolve(left, np.full(2 * half + 1, 1.0 / (2 * half + 1)))
    p = p[half : half + len(left)]
    normal = csr_array(F.T @ F)
    size = np.sqrt(normal.diagonal())
    unit = np.where(size > 0, size, 1.0)
    scaled = csr_array(diags_array(1 / unit) @ normal @ diags_array(1 / unit))
    target = (F.T @ p) / unit
    share, error = np.empty(len(size)), np.empty(len(size))
    for part in _apart(scaled):
        inverse = np.linalg.pinv(scaled[part, part].toarray(), rcond=1e-6, hermitian=True)
        share[part] = -(inverse @ target[part]) / unit[part]
        # the means are correlated: about as much as makes this right
        error[part] = noise * np.sqrt(np.maximum(inverse.diagonal(), 0.0)) / unit[part]
    low, high = _SHARE
    return (size > 0) & (share > low) & (share < high) & (share > _CLEAR * error)


def _blurred(footprint: csr_array, half: int) -> csr_array:
    """Means of the rows of a footprint (K, C) over so many rows to either side."""
    entries, band = footprint.tocoo(), np.arange(-half, half + 1)
    row = (entries.row[:, None] + band).ravel()
    values = np.repeat(entries.data, len(band)) / len(band)
    inside = (row >= 0) & (row < footprint.shape[0])
    place = row[inside], np.repeat(entries.col, len(band))[inside]
    return csr_array((values[inside], place), shape=footprint.shape)


def _apart(normal: csr_array) -> list[slice]:
    """Candidates, in the order of time, in groups whose means have no interval in common."""
    entries = normal.tocoo()
    last = np.arange(normal.shape[0])
    np.maximum.at(last, entries.row, entries.col)
    ends = 1 + np.flatnonzero(np.maximum.accumulate(last) == np.arange(len(last)))
    return [slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
