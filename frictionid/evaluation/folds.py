"""Folds: which samples are held out when, made once and the same for every identifier."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from frictionid.arrays import Array
from frictionid.config import NotNegative, validated
from frictionid.data.recordings import Recording
from frictionid.errors import InputError

USUAL = 10  # folds
Kind = Literal["recordings", "blocks", "stretches", "shuffled"]


@validated
class Split:
    """How to split into `count` folds: see `kind`.

    Whole "recordings", contiguous "blocks" of all data, "stretches" of each recording, or
    "shuffled" samples.

    Without a `kind` these are whole recordings, and blocks of a single one. Without a `count` there
    are ten folds, or one for each recording where there are fewer.
    Whole recordings are right where there are enough of them. With fewer recordings than folds,
    blocks: `gap` [s] around a held-out block is left out of its training, at least the smoother's
    support plus the models' memory. Stretches where a joint moves in one recording alone: a fold
    without that has nothing to learn of it. Shuffled samples are what the study did
    [DeMeester2020]: held-out samples then have neighbours in the training set, which flatters
    models that interpolate; rollouts cannot be held out at all.
    """

    count: Annotated[int, Field(ge=2)] | None = None
    kind: Kind | None = None
    gap: NotNegative = 0.25
    seed: Annotated[int, Field(ge=0)] = 0

    def folds(self, recordings: int) -> int:
        """Number of folds of so many recordings.

        >>> Split().folds(25), Split().folds(4), Split().folds(1), Split(count=3).folds(25)
        (10, 4, 10, 3)
        """
        if self.count is not None:
            return self.count
        whole = self.kind_of(recordings) == "recordings"
        return min(USUAL, max(recordings, 2)) if whole else USUAL

    def kind_of(self, recordings: int) -> str:
        """Kind of the folds of so many recordings.

        >>> Split().kind_of(2), Split().kind_of(1), Split(kind="shuffled").kind_of(1)
        ('recordings', 'blocks', 'shuffled')
        """
        return self.kind or ("recordings" if recordings > 1 else "blocks")


@dataclass(frozen=True, eq=False)
class Folds:
    """Held-out fold of each sample interval: `labels` has an array (T_i,) for each recording.

    The interval between samples k and k + 1 of recording i is held out in fold labels[i][k].
    """

    count: int
    times: tuple[Array, ...]
    labels: tuple[Array, ...]
    gap: float = 0.0
    contiguous: bool = True
    names: tuple[str, ...] = ()

    @property
    def hash(self) -> str:
        """SHA-256 of the assignment: equal hashes mean equal folds."""
        sizes = [len(label) for label in self.labels]
        head = f"{self.count} {self.gap!r} {self.contiguous} {sizes} {self.names!r}"
        digest = hashlib.sha256(head.encode())
        for time, label in zip(self.times, self.labels, strict=True):
            digest.update(np.ascontiguousarray(time, dtype="<f8").tobytes())
            digest.update(np.ascontiguousarray(label, dtype="<i4").tobytes())
        return digest.hexdigest()

    def held_out(self, recording: Array, time: Array) -> Array:
        """Fold that holds out the rows (K,) starting at `time` in `recording`, shape (K,)."""
        out = np.empty(len(recording), dtype=int)
        for i, (clock, label) in enumerate(zip(self.times, self.labels, strict=True)):
            rows = recording == i
            out[rows] = label[np.searchsorted(clock, time[rows] + 1e-9, side="right") - 1]
        return out

    def training(self, recording: Array, time: Array, dt: Array | float = 0.0) -> Array:
        """Training weights (F, K), 1 or 0, of rows from `time` to `time + dt` [s] of `recording`.

        A row trains the folds that neither hold it out nor hold out anything within the gap of it,
        before or after, in the same recording.
        """
        held = self.held_out(recording, time)
        weights = (held[None] != np.arange(self.count)[:, None]).astype(float)
        if self.gap <= 0:
            return weights
        stop = time + dt
        for i, (clock, label) in enumerate(zip(self.times, self.labels, strict=True)):
            rows = np.flatnonzero(recording == i)
            for fold in np.unique(label):
                intervals = np.flatnonzero(label == fold)
                near = _distance(clock, intervals, time[rows], stop[rows]) < self.gap - 1e-9
                weights[fold, rows[near]] = 0.0
        return weights

    def whole(self, recording: int, start: float, stop: float) -> int | None:
        """Fold that holds out all of [start, stop] of a recording, or None where none does.

        Shuffled folds hold out no stretch of time: there the fold of the start is returned, and
        what follows has been seen in training.
        """
        clock, label = self.times[recording], self.labels[recording]
        first, last = np.searchsorted(clock, [start + 1e-9, stop - 1e-9], side="right") - 1
        fold = int(label[first])
        if self.contiguous and not (label[first : last + 1] == fold).all():
            return None
        return fold


def _distance(clock: Array, places: Array, start: Array, stop: Array) -> Array:
    """Time (K,) [s] between rows [start, stop] and intervals `own` of a clock; 0 if they touch."""
    begins = np.concatenate([clock[places], [np.inf]])
    ends = np.concatenate([[-np.inf], clock[np.minimum(places + 1, len(clock) - 1)]])
    place = np.searchsorted(begins[:-1], start + 1e-9, side="right")
    return np.maximum(np.minimum(begins[place] - stop, start - ends[place]), 0.0)


def make_folds(recordings: Sequence[Recording], split: Split) -> Folds:
    """Folds of the recordings, of nearly equal numbers of samples.

    Raises
    ------
    InputError
        With more folds than recordings for kind "recordings", or than samples.

    Examples
    --------
    >>> from frictionid.data.signals import Signal
    >>> time = np.arange(5.0)
    >>> still = Signal(time, np.zeros((5, 1)))
    >>> recordings = [Recording(name, still, still) for name in "abcd"]
    >>> sorted(int(label[0]) for label in make_folds(recordings, Split(count=4)).labels)
    [0, 1, 2, 3]
    """
    times = tuple(np.asarray(r.angle.time, dtype=float) for r in recordings)
    names = tuple(r.name for r in recordings)
    sizes = np.array([len(t) for t in times])
    count, kind = split.folds(len(recordings)), split.kind_of(len(recordings))
    if kind == "recordings":
        if len(recordings) < count:
            raise InputError(
                f"{len(recordings)} recordings cannot make {count} folds of whole ones: "
                f'lower folds.count, or set folds.kind = "blocks"'
            )
        owner = _balanced(sizes, count, split.seed)
        labels = [np.full(size, fold) for size, fold in zip(sizes, owner, strict=True)]
        return Folds(count, times, tuple(labels), names=names)
    total = int(sizes.sum())
    if total < count:
        raise InputError(f"{total} samples cannot make {count} folds")
    every = np.arange(total) * count // total
    if kind == "shuffled":
        every = np.random.default_rng(split.seed).permutation(every)
    parts = tuple(np.split(every, np.cumsum(sizes)[:-1]))
    if kind == "stretches":
        short = int(sizes.argmin())
        if sizes[short] < count:
            raise InputError(f"{names[short]}: {sizes[short]} samples cannot make {count} folds")
        parts = tuple(np.arange(size) * count // size for size in sizes)
    contiguous = kind != "shuffled"
    return Folds(count, times, parts, split.gap if contiguous else 0.0, contiguous, names)


def usual_kind(recordings: Sequence[Recording], fewest: int = 2) -> Kind:
    """Kind of folds from which all can be learned, of at least so many whole recordings.

    A joint moves in a recording where it travels 2 % of its widest motion.

    >>> from frictionid.data.signals import Signal
    >>> still, moving = np.zeros(5), np.arange(5.0)
    >>> angles = (np.stack([moving, still], 1), np.stack([still, moving], 1))
    >>> signals = [Signal(moving, angle) for angle in angles]
    >>> usual_kind([Recording(name, s, s) for name, s in zip("ab", signals, strict=True)])
    'stretches'
    """
    if len(recordings) < fewest:
        return "blocks"
    travel = np.array([np.ptp(r.angle.value, axis=0) for r in recordings])
    moves = (travel > 0.02 * travel.max(axis=0)).sum(axis=0)
    return "stretches" if (moves == 1).any() else "recordings"


def _balanced(sizes: Array, count: int, seed: int) -> Array:
    """Fold of each recording: in random order, longest first, each to the smallest fold so far."""
    order = np.random.default_rng(seed).permutation(len(sizes))
    order = order[np.argsort(-sizes[order], kind="stable")]
    load, owner = np.zeros(count), np.empty(len(sizes), dtype=int)
    for i in order:
        owner[i] = int(np.argmin(load))
        load[owner[i]] += sizes[i]
    return owner
