"""What a reader must know before trusting the numbers: divergence, loose parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.report.evidence import Entry, Evidence, Key, Section
from frictionid.report.findings import Matter
from frictionid.report.numbers import listed, percent
from frictionid.report.tables import code

LOOSE = 0.5  # scatter of a parameter over the folds, in units of its mean
ASTRAY = 0.02  # distance of the fit to all data from the folds' mean curve, in units of its size


def general_cautions(evidence: Evidence) -> list[str]:
    """Sentences about the whole comparison."""
    found = []
    if evidence.missing:
        total = len(evidence.provenance["tasks"])
        found.append(
            f"{len(evidence.missing)} of {total} tasks are not finished, their lines are missing: "
            "finish them with `frictionid compare --resume`."
        )
    if evidence.provenance["settings"].get("folds", {}).get("kind") == "shuffled":
        found.append(
            "The folds are shuffled samples: held-out samples have neighbours in the training set, "
            "so losses flatter models that interpolate, and rollouts are not held out at all."
        )
    return found


def section_cautions(section: Section, matters: Sequence[Matter]) -> list[str]:
    """Sentences about the results of one fitted data set and of those that only test it."""
    parts = [_diverged(m) for m in matters]
    parts += [_infinite(m) for m in matters]
    parts += [_astray(section), _loose(section)]
    return [sentence for sentence in parts if sentence]


def _diverged(m: Matter) -> str:
    if not m.horizons:
        return ""
    key = Key("rollout_angle", "diverged", m.horizons[-1])
    known = [(entry, entry.scores[m.dataset][key]) for entry in m.entries("fitted", "given")]
    some = [(entry, share) for entry, share in known if share > 0]
    if not some:
        return ""
    worst, share = max(some, key=lambda pair: pair[1])
    without = [e.scores[m.dataset][key] for e in m.entries("none")]
    beside = f"; without friction {percent(without[0])}" if without else ""
    return (
        f"On {code(m.dataset)} up to {percent(share)} of a model's predictions ({m.name(worst)}) "
        f"are off by more than 1 rad after {key.horizon:g} s{beside}: they count as diverged, and "
        "medians hide them."
    )


def _infinite(m: Matter) -> str:
    names = [
        m.name(entry)
        for entry in m.section.entries
        if m.dataset in entry.scores and np.isinf(list(entry.scores[m.dataset].values())).any()
    ]
    if not names:
        return ""
    where = f"On {code(m.dataset)} some errors of {listed(names)}"
    return f"{where} are infinite: they stand as ∞ and are in no average."


def _astray(section: Section) -> str:
    names = [f"{code(e.label)} ({e.recipe})" for e in section.of_role("fitted") if astray(e)]
    if not names:
        return ""
    return (
        f"The fit to all data of {listed(names)} lies outside the scatter of the folds' curves: "
        "it may have found another minimum."
    )


def astray(entry: Entry) -> bool:
    """Whether a joint's curve from all data is further from the folds' mean than every fold's."""
    folds, overall = entry.curves[:-1], entry.curves[-1]
    if len(folds) < 2 or not np.isfinite(entry.curves).all():
        return False
    mean = folds.mean(axis=0)
    size, off = _rms(mean), _rms(overall - mean)
    return bool(((off > _rms(folds - mean).max(axis=0)) & (off > ASTRAY * size)).any())


def _rms(curves: np.ndarray) -> np.ndarray:
    """Root mean square over the velocities, the last axis but one."""
    return np.sqrt(np.mean(np.square(curves), axis=-2))


def _loose(section: Section) -> str:
    told = []
    for entry in section.of_role("fitted"):
        count, total = loose(entry), int(np.prod(entry.theta.shape[1:]))
        if count:
            told.append(f"{code(entry.label)} ({entry.recipe}): {count} of {total}")
    if not told:
        return ""
    return (
        "Parameters that scatter over the folds by more than half their mean are not determined "
        f"one by one, even where the curve is: {'; '.join(told)}."
    )


def loose(entry: Entry) -> int:
    """How many parameters scatter over the folds by more than half their mean."""
    if len(entry.theta) < 2:
        return 0
    sd, mean = entry.theta.std(axis=0, ddof=1), np.abs(entry.theta.mean(axis=0))
    return int((sd > LOOSE * mean).sum())
