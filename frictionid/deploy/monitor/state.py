"""What a monitor remembers between calls: recordings that arrived, and the evidence after each."""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.monitor.baseline import Baseline, changes_of, numbers_of
from frictionid.deploy.monitor.changes import Changes, curve_changes
from frictionid.deploy.monitor.judgement import without_covariates
from frictionid.deploy.monitor.martingale import log_bet
from frictionid.errors import InputError
from frictionid.files import json_text, read_json, write_json

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
