"""Two results side by side: whether they can be compared, and what changed between them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from frictionid.comparison.results import Results
from frictionid.errors import InputError
from frictionid.evaluation.statistics import CERTAIN, REGION, correlated_test
from frictionid.report.numbers import NOTHING, decimals, fixed, seconds, signed
from frictionid.report.sections import Model, Section, SummaryData, rollout, sections_of
from frictionid.report.tables import Column, Table, line, text_columns

SAME = 1e-9  # relative difference of equal numbers


class Change(NamedTuple):
    """A setting, version or parameter with its values in both results; None where it is missing."""

    name: str
    before: Any
    after: Any


class Score(NamedTuple):
    """Median error of a model after a horizon [s] in both results.

    standing : of the second one, by the rule of the verdict, "better", "worse", "equivalent" or
        "undecided"; "" where the folds are not the same
    """

    dataset: str
    model: str
    horizon: float
    unit: str
    before: float
    after: float
    standing: str


class SideBySide(NamedTuple):
    """What two results have in common, and what changed.

    datasets : whether each common data set has the same "data" and the same "folds"
    missing : models of one of the two results only
    """

    datasets: Mapping[str, Mapping[str, bool]]
    settings: tuple[Change, ...]
    versions: tuple[Change, ...]
    scores: tuple[Score, ...]
    parameters: tuple[Change, ...]
    missing: tuple[Change, ...]

    @property
    def comparable(self) -> bool:
        """Whether all common data sets have the same data and folds."""
        return all(same["data"] and same["folds"] for same in self.datasets.values())


def side_by_side(first: Results, second: Results) -> SideBySide:
    """Two results of comparisons, the second one against the first.

    Raises
    ------
    InputError
        Where no data set was fitted in both.
    """
    sections = [{s.dataset: s for s in sections_of(own)} for own in (first, second)]
    common = [name for name in sections[0] if name in sections[1]]
    if not common:
        names = " and ".join(", ".join(own) for own in sections)
        raise InputError(
            f"{first.folder} and {second.folder} have no fitted data set in common ({names}): give "
            "two results on the same data"
        )
    a, b = first.provenance, second.provenance
    same = {name: {key: _equal(a, b, key, name) for key in ("data", "folds")} for name in common}
    pairs = [(sections[0][name], sections[1][name]) for name in common]
    return SideBySide(
        datasets=same,
        settings=_changes(_flat(a.get("settings", {})), _flat(b.get("settings", {}))),
        versions=_changes(a.get("versions", {}), b.get("versions", {})),
        scores=tuple(
            s for pair in pairs for s in _scores(*pair, all(same[pair[0].dataset].values()))
        ),
        parameters=tuple(p for pair in pairs for p in _parameters(*pair)),
        missing=tuple(p for pair in pairs for p in _missing(*pair)),
    )


def _equal(a: Mapping[str, Any], b: Mapping[str, Any], key: str, dataset: str) -> bool:
    """Whether the hashes of a data set, or of its folds, are known and the same."""
    hashes = [own.get(key, {}).get(dataset) for own in (a, b)]
    return bool(hashes[0]) and hashes[0] == hashes[1]


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    """Settings by dotted names; lists count from 1.

    >>> _flat({"folds": {"count": 3}, "seeds": [0, 1]})
    {'folds.count': 3, 'seeds.1': 0, 'seeds.2': 1}
    """
    entries: Any = None
    if isinstance(value, Mapping):
        entries = value.items()
    elif isinstance(value, list):
        entries = enumerate(value, 1)
    if entries is None:
        return {name: value}
    return {k: v for key, own in entries for k, v in _flat(own, f"{name}.{key}".strip(".")).items()}


def _changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> tuple[Change, ...]:
    names = dict.fromkeys([*before, *after])
    every = (Change(name, before.get(name), after.get(name)) for name in names)
    return tuple(change for change in every if change.before != change.after)


def _matched(a: Section, b: Section) -> Iterator[tuple[Model, Model]]:
    """Models of the same label and recipe."""
    known = {(model.label, model.recipe): model for model in b.models}
    for model in a.models:
        if (model.label, model.recipe) in known:
            yield model, known[model.label, model.recipe]


def _missing(a: Section, b: Section) -> Iterator[Change]:
    names = [{(m.label, m.recipe): m.name for m in own.models} for own in (a, b)]
    for key in dict.fromkeys([*names[0], *names[1]]):
        if key not in names[0] or key not in names[1]:
            yield Change(a.dataset, names[0].get(key), names[1].get(key))


def _scores(a: Section, b: Section, folds: bool) -> Iterator[Score]:
    horizons = [h for h in a.fitted.reported if h in b.fitted.reported]
    for one, other in _matched(a, b):
        for horizon in horizons:
            column = rollout(horizon)
            values = a.fitted.value(one, column), b.fitted.value(other, column)
            standing = _standing(a.fitted, one, b.fitted, other, column) if folds else ""
            unit = a.description.angle_unit
            yield Score(a.dataset, one.name, horizon, unit, *values, standing)


def _standing(a: SummaryData, one: Model, b: SummaryData, other: Model, column: str) -> str:
    """How the second result's errors of the folds stand against the first one's."""
    before, after = a.of_folds(one, column), b.of_folds(other, column)
    if len(before) != len(after) or len(before) < 2:
        return ""
    if not (np.isfinite(before).all() and np.isfinite(after).all()):
        return ""
    region = REGION * float(min(before.mean(), after.mean()))
    test = correlated_test(after - before, region)
    chances = {"better": test.below, "equivalent": test.inside, "worse": test.above}
    return next((name for name, chance in chances.items() if chance >= CERTAIN), "undecided")


def _parameters(a: Section, b: Section) -> Iterator[Change]:
    """Fitted parameters, of all data, that are not the same."""
    for one, other in _matched(a, b):
        values = [_values(one, a.description.joints), _values(other, b.description.joints)]
        for name in dict.fromkeys([*values[0], *values[1]]):
            before, after = (own.get(name) for own in values)
            if before is None or after is None or abs(after - before) > SAME * abs(before):
                yield Change(f"{a.dataset}, {one.name}: {name}", before, after)


def _values(model: Model, joints: tuple[str, ...]) -> dict[str, float]:
    return {
        f"{name} of {joint} [{number['unit']}]": float(number["value"])
        for joint, own in zip(joints, model.document.get("joints", ()), strict=False)
        for name, number in own.items()
        if number["value"] is not None
    }


# --- As text --------------------------------------------------------------------------------------


def comparable_lines(found: SideBySide) -> list[str]:
    """Whether each data set's scores can be compared, a sentence each."""
    words = {
        (True, True): "same data and same folds: scores can be compared fold by fold",
        (
            True,
            False,
        ): "same data, other folds: scores are of other held-out parts",
        (False, True): "other data: scores cannot be compared",
        (False, False): "other data and other folds: scores cannot be compared",
    }
    return [
        f"{name}: {words[same['data'], same['folds']]}." for name, same in found.datasets.items()
    ]


def score_table(found: SideBySide) -> Table:
    """Median errors of both results."""
    places = decimals([v for score in found.scores for v in (score.before, score.after)])
    lines = []
    for score in found.scores:
        ratio = score.after / score.before if score.before > 0 else float("nan")
        change = f"{signed(100 * (ratio - 1), 1)} %" if np.isfinite(ratio) else NOTHING
        after = f"{seconds(score.horizon)} [{score.unit}]"
        values = (fixed(v, places) for v in (score.before, score.after))
        lines.append(line([score.dataset, score.model, after, *values, change, score.standing]))
    heads = [*text_columns("data set", "model", "after"), Column("first"), Column("second")]
    heads += [Column("change"), *text_columns("second is")]
    return Table("Median errors of predictions.", "side-by-side", tuple(heads), tuple(lines))


def change_table(changes: tuple[Change, ...], what: str) -> Table:
    """What changed: name, value in the first and in the second result."""

    def text(value: Any) -> str:
        return (
            NOTHING if value is None else f"{value:.5g}" if isinstance(value, float) else str(value)
        )

    lines = [line([c.name, text(c.before), text(c.after)]) for c in changes]
    return Table("", what, tuple(text_columns(what, "first", "second")), tuple(lines))
