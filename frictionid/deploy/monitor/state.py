"""What a monitor remembers between calls: recordings that arrived, and the evidence of a change.

The evidence is a conformal test martingale. Each recording is ranked among all so far by its
distance from their mean; its p-value is uniform and independent of the earlier ones, as long as
recordings are exchangeable. A bet against that,

    E_t = product over i of the integral of e p_i^(e - 1) de from 0 to 1

is a martingale that begins at one: with probability at least 1 - rate it never reaches 1/rate
[Vovk2005], [Ville1939]. So the rate holds for the whole time of monitoring, however long.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.monitor.baseline import Baseline, changes_of, numbers_of
from frictionid.deploy.monitor.changes import Changes, curve_changes
from frictionid.deploy.monitor.judgement import without_covariates
from frictionid.deploy.monitor.two_samples import white_rows
from frictionid.errors import InputError
from frictionid.files import json_text, read_json, write_json


def log_evidence(healthy: Array, arrived: Array, names: tuple[str, ...]) -> Array:
    """Logarithm of the evidence (k,) after each of k recordings that arrived.

    Parameters
    ----------
    healthy : array, shape (N, n, d)
    arrived : array, shape (k, n, d), in the order of arrival
    names : of the recordings that arrived; equal ranks are broken by them, at random

    >>> rng = np.random.default_rng(1)
    >>> sick = rng.normal(size=(8, 1, 2)) + 8.0
    >>> after = log_evidence(rng.normal(size=(60, 1, 2)), sick, tuple("abcdefgh"))
    >>> bool(after[-1] > np.log(100))
    True
    """
    rows = np.concatenate([healthy, arrived])
    first = len(healthy) + 1
    return np.cumsum([log_bet(rows[: first + i], name) for i, name in enumerate(names)])


def log_bet(rows: Array, name: str) -> float:
    """Logarithm of the bet on the last of recordings (N, n, d); `name` breaks equal ranks."""
    distance = (white_rows(rows) ** 2).sum(axis=-1).max(axis=-1)
    further, equal = (distance > distance[-1]).sum(), (distance == distance[-1]).sum()
    share = np.random.default_rng(zlib.crc32(name.encode())).random()
    return _log_bet(float((further + share * equal) / len(rows)))


def _log_bet(p: float) -> float:
    """Logarithm of the integral of e p^(e - 1) de over e from 0 to 1.

    >>> round(float(np.exp(_log_bet(1.0))), 6), round(float(np.exp(_log_bet(0.01))), 2)
    (0.5, 4.45)
    """
    p = min(max(p, 1e-12), 1.0)
    a = np.log(p)
    if abs(a) < 1e-4:
        return float(np.log(0.5 - a / 6.0))
    return float(np.log((1.0 - p + p * a) / (p * a * a)))


FORMAT = "frictionid monitor 1"


class Arrival(NamedTuple):
    """A recording that arrived: name, digest, its numbers, and the log evidence after it."""

    name: str
    digest: str
    changes: Changes
    log_evidence: float


def digest_of(baseline: Baseline) -> str:
    """Digest of what a baseline knows of its recordings."""
    text = json_text({"hashes": baseline.hashes, "parts": baseline.changes.parts})
    return sha256(text.encode()).hexdigest()


def load_state(path: Path, baseline: Baseline) -> list[Arrival]:
    """Recordings that arrived before, none where there is no file.

    Raises
    ------
    InputError
        Where the file is no state of a monitor, or that of another baseline.
    """
    if not path.exists():
        return []
    document = read_json(path)
    if document.get("format") != FORMAT:
        raise InputError(
            f'{path}: "format" is {document.get("format")!r}, not "{FORMAT}": name another file'
        )
    if document.get("baseline") != digest_of(baseline):
        raise InputError(f"{path}: is the state of another baseline: name another file")
    try:
        return [
            Arrival(row["name"], row["sha256"], changes_of([row]), float(row["log_evidence"]))
            for row in document["arrived"]
        ]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error!r}): name another file") from None


def arriving(
    path: Path, baseline: Baseline, names: tuple[str, ...], digests: tuple[str, ...], new: Changes
) -> Iterator[Arrival]:
    """Recordings that are not in the state yet, each written to it before the next is looked at.

    A process that is killed between two of them loses nothing: the file is written as a whole.
    """
    known = load_state(path, baseline)
    for i, (name, digest) in enumerate(zip(names, digests, strict=True)):
        if digest in {arrival.digest for arrival in known}:
            continue
        own = Changes(*(values[i : i + 1] for values in new))
        columns = zip(baseline.changes, *(a.changes for a in known), strict=True)
        before_it = Changes(*map(np.concatenate, columns))
        rows = np.concatenate(without_covariates(before_it, own))
        bet = log_bet(curve_changes(rows, baseline.reference.speeds), digest)
        before = known[-1].log_evidence if known else 0.0
        known.append(Arrival(name, digest, own, before + bet))
        write_json(path, _document(baseline, known))
        yield known[-1]


def _document(baseline: Baseline, arrivals: list[Arrival]) -> dict[str, Any]:
    rows = [
        {"name": a.name, "sha256": a.digest, "log_evidence": a.log_evidence}
        | numbers_of(a.changes, 0)
        for a in arrivals
    ]
    return {"format": FORMAT, "baseline": digest_of(baseline), "arrived": rows}


def evidence(arrivals: list[Arrival]) -> Array:
    """Log evidence (k,) after each arrival."""
    return np.array([arrival.log_evidence for arrival in arrivals])
