"""Nested folds: the recordings that train a fold as a data set, and those that it holds out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.cross_validate import Benchmark
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.errors import InputError
from frictionid.evaluation import Split, make_folds


def training_benchmark(benchmark: Benchmark, fold: int | None, inner: Split) -> Benchmark:
    """A benchmark among the recordings that train a fold, all of them for None; held-out ones test.

    The truth of simulated data is left out: nothing is tuned to it.

    Raises
    ------
    InputError
        For shuffled folds, where every held-out sample has neighbours in the training set.
    """
    dataset = benchmark.dataset
    whole = replace(dataset, truth=None, recordings=tuple(map(_without_truth, dataset.recordings)))
    if fold is None:
        return _inner_benchmark(whole, benchmark, inner, ())
    if not benchmark.folds.contiguous:
        raise InputError(
            "tuning is nested in the training folds, which shuffled samples do not part: set "
            'folds.kind = "recordings" or "blocks", or tune.nested = false'
        )
    shortest = benchmark.protocol.history + min(benchmark.protocol.horizons)
    seen = _pieces_in_use(whole, _training(benchmark, fold), shortest)
    if seen is None:
        raise InputError(
            f"data set {dataset.name!r}: fold {fold} leaves no {shortest:g} s of motion in one "
            "piece to tune on: use fewer folds"
        )
    unseen = _pieces_in_use(whole, _held_out(benchmark, fold), shortest)
    tests = () if unseen is None else (replace(unseen, name=f"{dataset.name}, held out"),)
    return _inner_benchmark(seen, benchmark, inner, tests)


def _inner_benchmark(
    dataset: Dataset, benchmark: Benchmark, inner: Split, tests: tuple[Dataset, ...]
) -> Benchmark:
    few = len(dataset.recordings) < inner.folds(len(dataset.recordings))
    split = replace(inner, kind="blocks") if few else inner
    return Benchmark(dataset, make_folds(dataset.recordings, split), benchmark.protocol, tests)


def _without_truth(recording: Recording) -> Recording:
    return replace(recording, truth=None)


def _training(benchmark: Benchmark, fold: int) -> list[Array]:
    """Whether each interval of each recording trains a fold."""
    out = []
    for i, time in enumerate(benchmark.folds.times):
        rows = np.full(len(time) - 1, i)
        out.append(benchmark.folds.training(rows, time[:-1], np.diff(time))[fold] > 0)
    return out


def _held_out(benchmark: Benchmark, fold: int) -> list[Array]:
    return [label[:-1] == fold for label in benchmark.folds.labels]


def _pieces_in_use(dataset: Dataset, use: list[Array], shortest: float) -> Dataset | None:
    """The pieces of recordings that consist of intervals in use, without those too short."""
    pieces = [
        piece
        for recording, intervals in zip(dataset.recordings, use, strict=True)
        for piece in _pieces(recording, intervals)
        if piece.angle.time[-1] - piece.angle.time[0] >= shortest - 1e-9
    ]
    return replace(dataset, recordings=tuple(pieces)) if pieces else None


def _pieces(recording: Recording, use: Array) -> Iterator[Recording]:
    if use.all():
        yield recording
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[0], use.astype(int), [0]])))
    for number, (first, last) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        angle = _between(recording.angle, int(first), int(last) + 1)
        yield replace(recording, name=f"{recording.name}, piece {number}", angle=angle)


def _between(signal: Signal, first: int, stop: int) -> Signal:
    each = signal.sigma is not None and np.ndim(signal.sigma) == 2
    sigma = np.asarray(signal.sigma)[first:stop] if each else signal.sigma
    return Signal(signal.time[first:stop], signal.value[first:stop], signal.hold, sigma)
