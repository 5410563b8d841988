"""What the numbers support, in sentences: each is computed, and says how sure it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.report.load import Entry, Key, Section
from frictionid.report.numbers import coordinate, fixed, listed, short
from frictionid.report.paired import best, level, paired
from frictionid.report.tables import code, escape_markdown

TOLD = (0.5, 1.0)  # [s], horizons that the sentences are about, where a suite has them
EULER = Key("one_step_euler", "mean")
INTEGRAL = Key("one_step_integral", "rms")


class Matter(NamedTuple):
    """What the sentences about one data set are made of."""

    section: Section
    dataset: str
    horizons: tuple[float, ...]
    joints: tuple[str, ...]  # "1", "2" ..., empty where no true curve is known
    unit: str

    @property
    def what(self) -> str:
        """What the joints' coordinates are called."""
        return coordinate(self.unit)

    @property
    def last(self) -> Key:
        """The median rollout error at the longest horizon told."""
        return Key("rollout_angle", "median", self.horizons[-1])

    def name(self, entry: Entry) -> str:
        """An entry's name; recipes are told where there are several."""
        return named(self.section, entry)

    def entries(self, *roles: str) -> list[Entry]:
        """Entries of some roles that were scored on the data set."""
        return [entry for entry in self.section.of_role(*roles) if self.dataset in entry.scores]

    def curve_errors(self, entry: Entry) -> list[float]:
        """Curve error of each joint; empty where no true curve is known."""
        scores = entry.scores[self.dataset]
        return [scores[Key("curve_error", "rms", joint=joint)] for joint in self.joints]


def named(section: Section, entry: Entry) -> str:
    """An entry's name in Markdown; its recipe is told where there are several."""
    several = len(section.recipes) > 1 and entry.recipe
    beside = f" ({escape_markdown(entry.recipe)})" if several else ""
    return f"{code(entry.label)}{beside}"


def matter(
    section: Section, dataset: str, horizons: Sequence[float], about: Mapping[str, Any]
) -> Matter:
    """The matter of a data set, described by its entry in datasets.json."""
    told = tuple(h for h in TOLD if h in horizons) or tuple(horizons[-2:])
    joints = range(1, len(about["joints"]) + 1) if about["truth"] is not None else ()
    return Matter(section, dataset, told, tuple(map(str, joints)), about["angle_unit"])


def foretold(m: Matter) -> str:
    """The main finding: which model predicts best what was held out, how surely, how well."""
    if not m.entries("fitted"):
        return "Nothing was fitted to it."
    told = (prediction(m, "On held-out motion"), rivals(m), true_prediction(m))
    parts = (*told, from_true_states(m))
    return " ".join(part for part in parts if part)


def held_out_findings(m: Matter) -> list[str]:
    """Further findings about the data set that was fitted, judged on what was held out."""
    losses = " ".join(part for part in (one_step(m), below_truth(m)) if part)
    return [finding for finding in (losses, recipes(m), against_given(m)) if finding]


def unseen_findings(m: Matter) -> str:
    """Findings about a data set that no fit has seen."""
    parts = (prediction(m, f"On {code(m.dataset)}, which no fit has seen,"), against_given(m))
    found = [part for part in parts if part]
    if found:
        found.append("Each model has one number there: how much of that is chance is not known.")
    return " ".join(found)


def prediction(m: Matter, where: str) -> str:
    """Which fitted model predicts best, and by how much against no friction."""
    fitted = m.entries("fitted")
    keys = [Key("rollout_angle", "median", h) for h in m.horizons]
    first = {key: best(fitted, m.dataset, key) for key in keys}
    winners = list(
        dict.fromkeys(e for e in (first[k] for k in keys) if e is not None),
    )
    if not fitted or not keys:
        return ""
    if not winners:
        return f"{where} no fitted model predicts {_after(keys[-1])} with a finite median error."
    same = len(winners) == 1 and all(first.values())
    if same:
        values = [f"{_size(m, winners[0], key)} {_after(key)}" for key in keys]
        what = "predicts best" if len(fitted) > 1 else "is the only fitted model"
        told = f"{where} {m.name(winners[0])} {what}: its median {m.what} error is {listed(values)}"
        return f"{told}{_against_none(m, winners[0], keys)}."
    said = [
        f"{_after(key)} {m.name(e)} predicts best (median {m.what} error {_size(m, e, key)}"
        f"{_against_none(m, e, [key])})"
        for key in keys
        if (e := first[key]) is not None
    ]
    return f"{where} {listed(said)}."


def _after(key: Key) -> str:
    return f"after {key.horizon:g} s"


def _size(m: Matter, entry: Entry, key: Key) -> str:
    unit = f"{m.unit}/s" if key.horizon is None else m.unit
    return f"{short(level(entry, m.dataset, key), 2 if key.horizon else 3)} {unit}"


def _against_none(m: Matter, entry: Entry, keys: Sequence[Key]) -> str:
    """How much smaller the errors are than without friction, as the end of a sentence."""
    without = m.entries("none")
    if not without:
        return ""
    pairs = [(level(without[0], m.dataset, k), level(entry, m.dataset, k)) for k in keys]
    if not all(np.isfinite(pair).all() and min(pair) > 0 for pair in pairs):
        return ", without friction not finite"
    factors = [none / own for none, own in pairs]
    if min(factors) >= 1:
        return f", {listed(map(times, factors))} times smaller than without friction"
    if max(factors) < 1:
        return f", {listed(times(1 / f) for f in factors)} times larger than without friction"
    return f", without friction {listed(_size(m, without[0], key) for key in keys)}"


def times(factor: float) -> str:
    """A factor as sentences tell it.

    >>> times(1.04), times(2.345), times(23.4), times(0.5)
    ('1.04', '2.3', '23', '0.50')
    """
    return fixed(factor, 2 if factor < 1.1 else 1 if factor < 10 else 0)


def rivals(m: Matter) -> str:
    """Which fitted models cannot be told apart from the best, at the longest horizon told."""
    fitted = m.entries("fitted")
    first = best(fitted, m.dataset, m.last) if m.horizons else None
    others = [entry for entry in fitted if entry is not first]
    if first is None or not others:
        return ""
    pairs = {e: paired(e, first, m.dataset, m.last) for e in others}
    near = [e for e in others if pairs[e].clear is False]
    far = [e for e in others if pairs[e].clear and pairs[e].mean > 0]
    rest = [e for e in others if e not in near and e not in far]
    folds = max(pair.folds for pair in pairs.values())
    margin = f"two standard errors of the difference, paired over {folds} folds"
    when = f"{_after(m.last).capitalize()}, {m.name(first)}"
    if len(far) == len(others):
        return f"{when} is better than every other fitted model by more than {margin}."
    if len(near) == len(others):
        whom = "the other fitted models" if len(others) > 1 else m.name(others[0])
        return f"{when} cannot be told apart from {whom}: within {margin}."
    parts = []
    if near:
        parts.append(f"cannot be told apart from {_names(m, near)} (within {margin})")
    if far:
        parts.append(f"is clearly better than {_names(m, far)}")
    if rest:
        parts.append(f"cannot be compared fold by fold with {_names(m, rest)}")
    return f"{when} {listed(parts)}."


def _names(m: Matter, entries: Sequence[Entry]) -> str:
    return listed(map(m.name, entries))


def true_prediction(m: Matter) -> str:
    """How far the true friction's own prediction is off."""
    truth, first = m.entries("truth"), None
    if m.horizons:
        first = best(m.entries("fitted"), m.dataset, m.last)
    if not truth or first is None:
        return ""
    size = _size(m, truth[0], m.last)
    apart = paired(truth[0], first, m.dataset, m.last)
    if apart.clear is None:
        return f"The true friction itself is {size} off."
    if not apart.clear:
        return f"The true friction itself is {size} off, not distinguishable from that."
    if apart.mean > 0:
        return (
            f"The true friction itself is further off, {size}: the fitted one makes up for errors "
            "that are not friction's."
        )
    return f"The true friction itself is {size} off: that much is not friction's."


def from_true_states(m: Matter) -> str:
    """How far predictions from true states are off: what is wrong then is the model's alone."""
    if not m.horizons:
        return ""
    key = m.last._replace(score="rollout_true_start")
    fitted = m.entries("fitted")
    first = best(fitted, m.dataset, key)
    if first is None:
        return ""
    second = best([e for e in fitted if e is not first], m.dataset, key)
    told = f"From true states {m.name(first)} is {_size(m, first, key)} off {_after(key)}"
    if second is None:
        return f"{told}."
    factor = level(second, m.dataset, key) / level(first, m.dataset, key)
    unsure = paired(second, first, m.dataset, key).clear
    ends = ", the difference within two standard errors" if unsure is False else ""
    return f"{told}, {times(factor)} times less than {m.name(second)}, the next best{ends}."


def one_step(m: Matter) -> str:
    """Whether the lowest one-step loss went with the best prediction and the closest curves."""
    fitted = m.entries("fitted")
    lowest = best(fitted, m.dataset, EULER)
    if lowest is None or len(fitted) < 2 or not m.horizons:
        return ""
    predictor = best(fitted, m.dataset, m.last)
    told = f"The lowest one-step loss (euler, {_size(m, lowest, EULER)}) belongs to "
    if lowest is predictor:
        told += f"{m.name(lowest)} as well"
    elif predictor is not None:
        clear = paired(lowest, predictor, m.dataset, m.last).clear
        verdict = "predicts clearly worse" if clear else "does not predict measurably worse"
        verdict = "predicts worse, how surely is not known" if clear is None else verdict
        told += f"{m.name(lowest)}, which {verdict}"
    else:
        told += m.name(lowest)
    return f"{told}{_closest(m, lowest)}."


def _closest(m: Matter, lowest: Entry) -> str:
    """Whose curves are closest to the truth, as the end of a sentence."""
    known = {e: float(np.mean(m.curve_errors(e))) for e in m.entries("fitted") if m.joints}
    finite = [e for e, error in known.items() if np.isfinite(error)]
    if not finite:
        return ""
    closest = min(finite, key=lambda e: known[e])
    if closest is lowest:
        return f", and so do the closest curves ({_off(m, lowest)} off)"
    if lowest not in finite:
        return f"; the closest curves ({_off(m, closest)} off) are those of {m.name(closest)}"
    return (
        f"; its curves are {_off(m, lowest)} off, the closest ({_off(m, closest)}) are those of "
        f"{m.name(closest)}"
    )


def _off(m: Matter, entry: Entry) -> str:
    return listed(f"{short(100 * error)} %" for error in m.curve_errors(entry))


def below_truth(m: Matter) -> str:
    """Which fitted models beat the truth's own one-step losses, and how wrong their curves are."""
    truth, fitted = m.entries("truth"), m.entries("fitted")
    if not truth or not fitted:
        return ""
    keys = (EULER, INTEGRAL)
    floor = {key: level(truth[0], m.dataset, key) for key in keys}
    below = {k: [e for e in fitted if level(e, m.dataset, k) < floor[k]] for k in keys}
    told = [
        f"{len(below[k]) or 'none'} score below the {k.score.removeprefix('one_step_')} loss "
        f"({_size(m, truth[0], k)})"
        for k in keys
    ]
    sentence = f"Of {len(fitted)} fitted models, {listed(told)} of the true friction itself"
    under = [entry for entry in fitted if any(entry in below[k] for k in keys)]
    if not under:
        return f"{sentence}."
    worst = max(under, key=lambda e: float(np.mean(m.curve_errors(e))))
    return (
        f"{sentence}, {'among them ' if len(under) > 1 else ''}{m.name(worst)} with curves "
        f"{_off(m, worst)} off: a lower one-step loss is no evidence of truer friction."
    )


def recipes(m: Matter) -> str:
    """Which recipe gets closer to the true curves, or else predicts better, and by what factor."""
    values = {recipe: _by_recipe(m, recipe) for recipe in m.section.recipes}
    common = [key for key in values[m.section.recipes[0]] if all(key in v for v in values.values())]
    good = [k for k in common if all(np.isfinite(v[k]) and v[k] > 0 for v in values.values())]
    if len(values) < 2 or not good:
        return ""
    overall = {r: float(np.mean([np.log(v[k]) for k in good])) for r, v in values.items()}
    first = min(overall, key=lambda recipe: overall[recipe])
    told = []
    for other in (recipe for recipe in values if recipe != first):
        factor = np.array([values[other][k] / values[first][k] for k in good])
        if np.allclose(factor, 1):
            told.append(f"the same as with {code(other)}")
            continue
        middle, low, high = map(times, (np.median(factor), factor.min(), factor.max()))
        span = f" ({low} to {high})" if len(good) > 1 else ""
        told.append(
            f"{middle} times smaller than with {code(other)}{span}, and smaller in "
            f"{int((factor > 1).sum())} of {len(good)} cases"
        )
    return f"With the recipe {code(first)} {_what(m)} is {'; '.join(told)} (median {_cases(m)})."


def _what(m: Matter) -> str:
    return (
        "the error of the friction curves" if m.joints else f"the {m.what} error {_after(m.last)}"
    )


def _cases(m: Matter) -> str:
    return "over identifiers and joints" if m.joints else "over identifiers"


def _by_recipe(m: Matter, recipe: str) -> dict[tuple[str, str], float]:
    """Error of each model fitted by a recipe: of each joint's curve, else of the last rollout."""
    out = {}
    for entry in m.entries("fitted"):
        if entry.recipe == recipe:
            for joint, error in zip(m.joints, m.curve_errors(entry), strict=True):
                out[entry.label, joint] = error
            if not m.joints and m.horizons:
                out[entry.label, ""] = level(entry, m.dataset, m.last)
    return out


def against_given(m: Matter) -> str:
    """How the best fitted model compares with models that were given."""
    given, fitted = m.entries("given"), m.entries("fitted")
    told = []
    for key in (Key("rollout_angle", "median", h) for h in m.horizons):
        first, rival = best(fitted, m.dataset, key), best(given, m.dataset, key)
        if first is None or rival is None:
            continue
        clear = paired(first, rival, m.dataset, key).clear
        unsure = " (cannot be told apart)" if clear is False else ""
        told.append(
            f"{_after(key)} {m.name(rival)} is {_size(m, rival, key)} off and {m.name(first)} "
            f"{_size(m, first, key)}{unsure}"
        )
    if not told:
        return ""
    return f"Against the best model that was given, not fitted: {'; '.join(told)}."
