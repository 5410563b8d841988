"""Health monitoring: a baseline of healthy recordings, and whether new ones differ from it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.api.fit import fit
from frictionid.api.models import DatasetLike, dataset_of, friction_of, identifier_of
from frictionid.arrays import Array, joined, picked
from frictionid.comparison.fit_model import as_logged
from frictionid.comparison.suite_recipes import usual_method
from frictionid.config import nearest
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import Prepared
from frictionid.files import json_text, read_json, sha256, write_json
from frictionid.friction.provenance import Segment

from .baseline import (
    Arrival,
    Baseline,
    changes_of,
    check_same_machine,
    hashes_of,
    load_baseline,
    make_baseline,
    numbers_of,
    save_baseline,
)
from .changes import Changes, prepared_data, recording_changes
from .effects import shares
from .judgement import Judgement, judge
from .monitored import Monitored

_TURNS, _NEAR = 6, 0.01  # about another payload, which still moves by more of its masses
_LIGHT = -0.9  # of a mass: the most that is taken off


def baseline(
    data: DatasetLike,
    out: str | Path | None = None,
    *,
    law: Any = "stribeck",
    model: Any = None,
    only: Sequence[str] = (),
) -> Baseline:
    """Baseline of healthy recordings of a machine: how its friction scatters between them.

    Parameters
    ----------
    data : data set
    out : str or Path, optional
        JSON file to write.
    law : as of `frictionid.fit`
        Fitted to all recordings, of arms by inverse dynamics, whose rotors files lack, of servos
        whose targets may be late by shooting, else in one step; changes are measured against it.
    model : Fit, Friction or path of a model file, optional
        In place of that fit, with its calibration.
    only : list of str
        Names of the recordings to take; all.

    Raises
    ------
    InputError
        Where there are fewer than two recordings, or the fit fails.

    Examples
    --------
    >>> healthy = baseline("acrobot_clean", law="coulomb_viscous")
    >>> healthy.changes.value.shape  # recordings, and what may change
    (25, 16)
    """
    (dataset,) = chosen_recordings([dataset_of(data)], only)
    if model is None:
        is_arm = usual_method(dataset, identifier_of(law)) == "inverse_dynamics"
        method = None if is_arm or as_logged(dataset) else "one_step"
        friction = fit(dataset, law, method=method).friction
    else:
        friction = friction_of(model)
    if friction.theta.ndim != 2 or friction.mechanism or not friction.law.names:
        raise InputError("a baseline needs one friction with physics, and a law other than none")
    healthy = make_baseline(prepared_data(dataset), friction)
    if out is not None:
        settings = {"law": str(friction.law), "dataset": dataset.name, "data": dataset.hashes}
        save_baseline(healthy, Path(out), settings)
    return healthy


def monitor(
    baseline: Baseline | str | Path,
    data: DatasetLike | Sequence[DatasetLike],
    *,
    rate: float = 0.01,
    state: str | Path | None = None,
    only: Sequence[str] = (),
    done: Callable[[str], None] | None = None,
) -> Monitored:
    """Whether friction, or something else, has changed since the recordings of a baseline.

    Parameters
    ----------
    baseline : Baseline, or path of its file
    data : data set, or list of data sets
        New recordings of the same machine.
    rate : float
        Of false alarms: how often healthy recordings may be called changed.
    state : str or Path, optional
        File in which arrived recordings and the evidence after each are kept.
    only : list of str
        Names of the recordings to take; all.
    done : function, optional
        Called with the name of each recording that is entered into the state.

    Raises
    ------
    InputError
        Where the baseline is another machine's, or was made by another version.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import frictionid as fid
    >>> data = fid.load_dataset("acrobot_clean")
    >>> old, new = (replace(data, recordings=part) for part in
    ...             (data.recordings[:20], data.recordings[20:]))
    >>> monitor(fid.baseline(old, law="coulomb_viscous"), new).answer
    'unchanged'
    """
    if not 0 < rate < 1:
        raise InputError(f"rate = {rate:g} must lie between 0 and 1")
    if not isinstance(baseline, Baseline | str | Path):
        raise InputError(f"monitor: {baseline!r} is no baseline; give one, or its file, first")
    healthy = baseline if isinstance(baseline, Baseline) else load_baseline(Path(baseline))
    several = [data] if isinstance(data, str | Path | Dataset) else data
    prepared: list[Prepared] = []
    recordings: list[tuple[str, str]] = []
    for dataset in chosen_recordings([dataset_of(x) for x in several], only):
        check_same_machine(healthy, dataset, dataset.name)
        prepared.append(prepared_data(dataset))
        digests = hashes_of(dataset)
        recordings += ((r.name, x) for r, x in zip(dataset.recordings, digests, strict=True))
    new, disturbed = _said(healthy, prepared, np.zeros(len(healthy.reference.effects)))
    arrivals: tuple[Arrival, ...] = ()
    if state is not None:
        arrivals = arriving(Path(state), healthy, recordings, new, done)
    names = tuple(name for name, _ in recordings)
    seconds = sum(r.angle.duration for p in prepared for r in p.dataset.recordings)
    judgement = judge(healthy, new, rate, disturbed, seconds)
    new, judgement = _at_its_payload(healthy, prepared, new, judgement, seconds)
    return Monitored(healthy, judgement, names, new, arrivals)


def _said(
    healthy: Baseline, prepared: Sequence[Prepared], payload: Array
) -> tuple[Changes, tuple[Segment, ...]]:
    """What recordings say, by derivatives at a payload (D,), and stretches that are left out."""
    most, beside = healthy.changes.disturbed, healthy.covariates
    each = (recording_changes(p, healthy.reference, beside, most, payload) for p in prepared)
    changes, stretches = zip(*each, strict=True)
    return joined(changes), tuple(chain(*stretches))


def _at_its_payload(
    healthy: Baseline,
    prepared: Sequence[Prepared],
    new: Changes,
    judgement: Judgement,
    seconds: float,
) -> tuple[Changes, Judgement]:
    """What recordings say by derivatives at the payload that they carry, and the judgement.

    One for all: each by its own would turn what noise does to mass, gain and friction together.
    """
    payload = np.zeros_like(judgement.payload)
    for _ in range(_TURNS):
        share = shares(healthy.reference.effects, payload)
        step = judgement.payload - payload
        if not judgement.payload.any() or np.abs(step).max() < _NEAR:
            break
        # as of accelerations, which are torques over masses: none falls below zero
        payload = np.maximum(payload + share * step / (1.0 - np.minimum(step, 0.5)), _LIGHT)
        new, disturbed = _said(healthy, prepared, payload)
        judgement = judge(healthy, new, judgement.rate, disturbed, seconds)
    return new, judgement


def chosen_recordings(datasets: Sequence[Dataset], only: Sequence[str]) -> list[Dataset]:
    """Data sets with the recordings that are named, all where none is.

    Raises
    ------
    InputError
        For a name that none of them has, and where there is no recording.
    """
    names = {r.name for dataset in datasets for r in dataset.recordings}
    for name in sorted({*only} - names):
        raise InputError(f"no recording {name!r}; {nearest(name, sorted(names))}")
    if not names:
        raise InputError("name a data set with recordings")
    if not only:
        return [*datasets]
    chosen = [(d, tuple(r for r in d.recordings if r.name in only)) for d in datasets]
    return [replace(d, recordings=recordings) for d, recordings in chosen if recordings]


def log_bet(p: float) -> float:
    """Logarithm of the integral of e p^(e - 1) de over e from 0 to 1.

    >>> round(float(np.exp(log_bet(1.0))), 6), round(float(np.exp(log_bet(0.01))), 2)
    (0.5, 4.45)
    """
    p = min(max(p, 1e-12), 1.0)
    a = np.log(p)
    if abs(a) < 1e-4:
        return float(np.log(0.5 - a / 6.0))
    return float(np.log((1.0 - p + p * a) / (p * a * a)))


STATE = "frictionid monitor 2"


def digest_of(baseline: Baseline) -> str:
    """Digest of what a baseline knows of its recordings."""
    text = json_text({"hashes": baseline.hashes, "value": baseline.changes.value})
    return sha256(text.encode())


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
    if document.get("format") != STATE:
        raise InputError(
            f'{path}: "format" is {document.get("format")!r}, not "{STATE}": name another file'
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
    path: Path,
    baseline: Baseline,
    recordings: Sequence[tuple[str, str]],
    new: Changes,
    done: Callable[[str], None] | None = None,
) -> tuple[Arrival, ...]:
    """All recordings of the state, each new one written to it before the next is looked at.

    A process that is killed between two of them loses nothing: the file is written as a whole.

    Parameters
    ----------
    recordings : name and digest of each
    new : their changes
    done : called with the name of each that was not in the state
    """
    arrivals = load_state(path, baseline)
    for i, (name, digest) in enumerate(recordings):
        if digest in {arrival.digest for arrival in arrivals}:
            continue
        changes = picked(new, [i])
        before = joined([baseline.changes, *(arrival.changes for arrival in arrivals)])
        p = judge(replace(baseline, changes=before), changes).p
        bet = log_bet(p) if np.isfinite(p) else 0.0  # what cannot be judged is no evidence
        evidence = arrivals[-1].log_evidence if arrivals else 0.0
        arrivals.append(Arrival(name, digest, changes, evidence + bet))
        listed = [
            {"name": a.name, "sha256": a.digest, "log_evidence": a.log_evidence}
            | numbers_of(a.changes, 0)
            for a in arrivals
        ]
        document = {"format": STATE, "baseline": digest_of(baseline), "arrived": listed}
        write_json(path, document)
        if done is not None:
            done(name)
    return tuple(arrivals)
