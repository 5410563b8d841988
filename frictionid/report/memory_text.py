"""Why a model with memory beats one without: what of it is delay, inertia, recipe, and memory.

The advantage of the best model that remembers over the best that does not, one step ahead, is read
under recipes whose data are corrected by what shooting finds: the clock of the torque, the inertia.
What a correction takes away was never memory; what the corrected recipes leave may be.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from frictionid.report.figures.loops import remembers
from frictionid.report.load import Entry, Key
from frictionid.report.numbers import decimals, fixed, listed
from frictionid.report.paired import Pair, best, paired
from frictionid.report.text import EULER, Matter

RAW: tuple[str, frozenset[str]] = ("euler", frozenset())
BOTH = frozenset(("delay", "inertia"))


class Rivals(NamedTuple):
    """The best model without and with memory under one recipe, and by how much memory is ahead."""

    static: Entry
    dynamic: Entry
    ahead: Pair


def memory_findings(m: Matter) -> list[str]:
    """Order of the losses, what the advantage of memory consists of, and what is left of it."""
    found = _rivals(m)
    if RAW not in found:
        return []
    raw = found[RAW]
    parts = [_order(m, raw), _parts(m, found), _rollouts(m, found)]
    return [" ".join(part for part in parts if part)]


def _rivals(m: Matter) -> dict[tuple[str, frozenset[str]], Rivals]:
    """Rivals by the scheme of their recipe and what corrects its data."""
    ways: dict[tuple[str, frozenset[str]], list[Entry]] = {}
    for entry in m.entries("fitted"):
        if entry.way.get("scheme") in ("euler", "integral"):
            key = str(entry.way["scheme"]), frozenset(entry.way.get("corrects", ()))
            ways.setdefault(key, []).append(entry)
    out = {}
    for key, entries in ways.items():
        static = best([e for e in entries if not remembers(e)], m.dataset, EULER)
        dynamic = best([e for e in entries if remembers(e)], m.dataset, EULER)
        if static is not None and dynamic is not None:
            out[key] = Rivals(static, dynamic, paired(static, dynamic, m.dataset, EULER))
    return out


def _order(m: Matter, raw: Rivals) -> str:
    """Mean losses as they stand, and in how many folds they are in this order."""
    models = [*m.entries("none")[:1], raw.static, raw.dynamic]
    losses = [entry.scores[m.dataset].folds(EULER) for entry in models]
    if len({len(own) for own in losses}) > 1 or not len(losses[0]):
        return ""
    each = np.array(losses)
    falls = int((np.diff(each, axis=0) < 0).all(axis=0).sum())
    names = [f"{m.name(e)} {own.mean():.2f}" for e, own in zip(models, losses, strict=True)]
    return (
        f"One step ahead, {listed(names)} {m.unit}/s (mean euler loss), in this order in {falls} "
        f"of {each.shape[1]} folds."
    )


def _parts(m: Matter, found: Mapping[tuple[str, frozenset[str]], Rivals]) -> str:
    raw = found[RAW].ahead
    if raw.clear is None:
        return ""
    if not raw.clear or raw.mean <= 0:
        return "So the model with memory is not measurably ahead there: nothing is to be explained."
    shares = _shares(found)
    if not shares:
        return ""
    last = _last(found)
    rest, where = found[last].ahead, _where(last)
    places = decimals([rest.error, raw.mean / 10], 1)
    told = [f"{what} {_signed(value, places)}" for what, value in shares.items()]
    left = f"{_signed(rest.mean, places)} ± {fixed(rest.error, places)} {m.unit}/s"
    verdict = {
        True: f"{left} are left, beyond two standard errors"
        if rest.mean > 0
        else f"the model without memory is ahead ({left})",
        False: f"{left} are left, inside two standard errors: no memory is to be seen",
        None: f"{left} are left, how surely is not known",
    }[rest.clear]
    return (
        f"Memory is ahead by {fixed(raw.mean, places)} {m.unit}/s; of that {listed(told)}. With "
        f"{where} {verdict}."
    )


def _shares(found: Mapping[tuple[str, frozenset[str]], Rivals]) -> dict[str, float]:
    """What the corrections and the recipe take off the advantage, in words and [rad/s].

    Delay and inertia: the mean over both orders of correcting them, where all four are known.
    """

    def ahead(scheme: str, *corrects: str) -> float | None:
        rivals = found.get((scheme, frozenset(corrects)))
        return None if rivals is None else rivals.ahead.mean

    raw, late, heavy = ahead("euler"), ahead("euler", "delay"), ahead("euler", "inertia")
    both, ours = ahead("euler", *BOTH), ahead("integral", *BOTH)
    assert raw is not None
    out: dict[str, float] = {}
    if late is not None and heavy is not None and both is not None:
        out["the delay of the torque explains"] = (raw - late + heavy - both) / 2
        out["inertia that the told mechanism lacks"] = (raw - heavy + late - both) / 2
    elif both is not None:
        out["delay and inertia explain"] = raw - both
    start = raw if both is None else both
    if ours is not None:
        what = "what samples before tell of the noise of differences and of the Euler step"
        whole = "delay, inertia, differences and the Euler step explain"
        out[what if both is not None else whole] = start - ours
    return out


def _last(found: Mapping[tuple[str, frozenset[str]], Rivals]) -> tuple[str, frozenset[str]]:
    """The recipe that leaves the fewest other reasons."""
    return max(found, key=lambda key: (len(key[1] & BOTH), key[0] == "integral"))


def _where(key: tuple[str, frozenset[str]]) -> str:
    scheme, corrects = key
    both = listed(sorted(corrects))
    told = f"{both} corrected by what shooting finds" if corrects else "nothing corrected"
    return f"{told} and the {scheme} recipe" if scheme == "integral" else told


def _rollouts(m: Matter, found: Mapping[tuple[str, frozenset[str]], Rivals]) -> str:
    """Whether memory predicts better where nothing else can explain it."""
    last = _last(found)
    if not m.horizons or not last[1]:
        return ""
    rivals = found[last]
    told = []
    for horizon in m.horizons:
        key = Key("rollout_angle", "median", horizon)
        apart = paired(rivals.static, rivals.dynamic, m.dataset, key)
        if apart.clear is None:
            continue
        places = decimals([apart.error])
        size = f"{_signed(apart.mean, places)} ± {fixed(apart.error, places)} {m.unit}"
        verdict = (
            "cannot be told apart"
            if not apart.clear
            else ("memory predicts better" if apart.mean > 0 else "memory predicts worse")
        )
        told.append(f"after {horizon:g} s {verdict} ({size})")
    if not told:
        return ""
    names = f"{m.name(rivals.dynamic)} against {m.name(rivals.static)}"
    return f"Predictions there, {names}: {listed(told)}."


def _signed(value: float, places: int) -> str:
    """A difference with so many decimals.

    >>> _signed(-0.0123, 3), _signed(-0.0001, 2)
    ('−0.012', '0.00')
    """
    text = fixed(value, places).replace("-", "−")
    return text if any(digit in text for digit in "123456789") else text.replace("−", "")
