"""What a reader must know before trusting the numbers: divergence, loose parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.report.load import Entry, Evidence, Key, folds_told
from frictionid.report.numbers import far, listed, percent
from frictionid.report.tables import code
from frictionid.report.text import Matter

LOOSE = 0.5  # scatter of a parameter over the folds, in units of its mean
ASTRAY = 0.02  # distance of the fit to all data from the folds' mean curve, in units of its size


def cautions(evidence: Evidence, fitted: Sequence[Matter], scored: Sequence[Matter]) -> list[str]:
    """Sentences of what to read with care; matters of the data sets fitted, and of all scored."""
    parts = [_unfinished(evidence), _shuffled(evidence), _diverged(scored), _infinite(scored)]
    parts += [_astray(fitted), _loose(fitted), _unscored(fitted)]
    return [sentence for sentence in parts if sentence]


def _unfinished(evidence: Evidence) -> str:
    if not evidence.missing:
        return ""
    total = len(evidence.provenance["tasks"])
    return (
        f"{len(evidence.missing)} of {total} tasks are not finished and their lines are missing: "
        "finish them with `frictionid compare --resume`."
    )


def _shuffled(evidence: Evidence) -> str:
    names = [section.dataset for section in evidence.sections]
    kinds = {name: folds_told(evidence.provenance, name).get("kind") for name in names}
    told = [name for name in names if kinds[name] == "shuffled"]
    if not told:
        return ""
    where = "" if len(told) == len(names) else f" of {listed(map(code, told))}"
    return (
        f"The folds{where} are shuffled samples: held-out samples have neighbours in the training "
        "set, so losses flatter models that interpolate, and rollouts are not held out at all."
    )


def _unscored(fitted: Sequence[Matter]) -> str:
    names = [code(m.dataset) for m in fitted if m.joints and not m.entries("truth")]
    if not names:
        return ""
    return (
        f"Of the true friction of {listed(names)} only the curve at steady speed is compared: the "
        "truth has no row of its own."
    )


def _diverged(matters: Sequence[Matter]) -> str:
    told, limits = [], []
    for m in matters:
        if not m.horizons:
            continue
        key = Key("rollout_angle", "diverged", m.horizons[-1])
        shares = {e: e.scores[m.dataset][key] for e in m.entries("fitted", "given")}
        shares = {e: share for e, share in shares.items() if share > 0}
        if shares:
            worst = max(shares, key=lambda e: shares[e])
            without = [percent(e.scores[m.dataset][key]) for e in m.entries("none")]
            beside = f", without friction {without[0]}" if without else ""
            told.append(f"on {code(m.dataset)} up to {percent(shares[worst])}{beside}")
            limits.append(far(m.unit))
    if not told:
        return ""
    return (
        f"After {matters[0].horizons[-1]:g} s some predictions of the models have diverged, are "
        f"off by more than {' or '.join(dict.fromkeys(limits))}, which medians hide: "
        f"{'; '.join(told)}."
    )


def _infinite(matters: Sequence[Matter]) -> str:
    told = []
    for m in matters:
        names = [
            m.name(entry)
            for entry in m.entries("none", "fitted", "given", "truth")
            if np.isinf(list(entry.scores[m.dataset].values())).any()
        ]
        if names:
            told.append(f"on {code(m.dataset)} of {listed(names)}")
    if not told:
        return ""
    return f"Some errors are infinite, stand as ∞ and are in no average: {'; '.join(told)}."


def _astray(matters: Sequence[Matter]) -> str:
    told = []
    for m in matters:
        names = [m.name(entry) for entry in m.entries("fitted") if astray(entry)]
        if names:
            told.append(f"on {code(m.dataset)} {listed(names)}")
    if not told:
        return ""
    return (
        "The fit to all data lies outside the scatter of the folds' curves, it may have found "
        f"another minimum: {'; '.join(told)}."
    )


def astray(entry: Entry) -> bool:
    """Whether a joint's curve from all data is further from the folds' mean than every fold's."""
    folds, overall = entry.curves[:-1], entry.curves[-1]
    if len(folds) < 2 or not np.isfinite(entry.curves).all():
        return False
    mean = folds.mean(axis=0)
    size, off = _rms(mean), _rms(overall - mean)
    return bool(((off > _rms(folds - mean).max(axis=0)) & (off > ASTRAY * size)).any())


def _rms(curves: Array) -> Array:
    """Root mean square over the velocities, the last axis but one."""
    return np.sqrt(np.mean(np.square(curves), axis=-2))


def _loose(matters: Sequence[Matter]) -> str:
    told = []
    for m in matters:
        counts = [(entry, loose(entry)) for entry in m.entries("fitted")]
        names = [f"{m.name(e)} {n} of {e.theta[0].size}" for e, n in counts if n]
        if names:
            told.append(f"on {code(m.dataset)} {listed(names)}")
    if not told:
        return ""
    return (
        "Parameters that scatter over the folds by more than half their mean are not determined "
        f"one by one, even where the curve is: {'; '.join(told)}."
    )


def loose(entry: Entry) -> int:
    """How many parameters scatter over the folds by more than half their mean.

    Those of networks and of models without physics do, whatever they are worth: they count as none.
    """
    if len(entry.theta) < 2 or "joints" not in entry.model or entry.model.get("mechanism"):
        return 0
    sd, mean = entry.theta.std(axis=0, ddof=1), np.abs(entry.theta.mean(axis=0))
    return int((sd > LOOSE * mean).sum())
