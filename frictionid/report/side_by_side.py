"""Two results side by side: whether they can be compared, and what changed between them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from frictionid.comparison.results import Results
from frictionid.errors import InputError
from frictionid.evaluation.reference_model import StartErrors, loss

from .numbers import NOTHING, decimals, fixed, seconds, signed
from .sections import Model, Section, rollout, sections_of
from .tables import Table, table_of, text_columns

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


class _Pair(NamedTuple):
    """A data set that was fitted in both results, whether its folds are the same, and its models.

    models : of both results, None where one has no model of this label and recipe
    """

    before: Section
    after: Section
    alike: bool
    models: tuple[tuple[Model | None, Model | None], ...]

    @property
    def common(self) -> Iterator[tuple[Model, Model]]:
        """Models that both results have."""
        return ((a, b) for a, b in self.models if a is not None and b is not None)


def side_by_side(first: Results, second: Results) -> SideBySide:
    """Two results of comparisons, the second one against the first.

    Raises
    ------
    InputError
        Where no data set was fitted in both.
    """
    before, after = ({s.dataset: s for s in sections_of(result)} for result in (first, second))
    common = [name for name in before if name in after]
    if not common:
        names = " and ".join(", ".join(sections) for sections in (before, after))
        raise InputError(
            f"{first.folder} and {second.folder} have no fitted data set in common ({names}): give "
            "two results on the same data"
        )
    a, b = first.provenance, second.provenance
    same = {name: {key: _equal(a, b, key, name) for key in ("data", "folds")} for name in common}
    pairs = [_pair(before[name], after[name], all(same[name].values())) for name in common]
    return SideBySide(
        datasets=same,
        settings=_changes(_flat(a.get("settings", {})), _flat(b.get("settings", {}))),
        versions=_changes(a.get("versions", {}), b.get("versions", {})),
        scores=tuple(score for pair in pairs for score in _scores(pair)),
        parameters=tuple(change for pair in pairs for change in _parameters(pair)),
        missing=tuple(
            Change(pair.before.dataset, a and a.name, b and b.name)
            for pair in pairs
            for a, b in pair.models
            if a is None or b is None
        ),
    )


def _pair(before: Section, after: Section, alike: bool) -> _Pair:
    a, b = ({(m.label, m.recipe): m for m in section.models} for section in (before, after))
    models = tuple((a.get(key), b.get(key)) for key in dict.fromkeys([*a, *b]))
    return _Pair(before, after, alike, models)


def _equal(a: Mapping[str, Any], b: Mapping[str, Any], key: str, dataset: str) -> bool:
    """Whether the hashes of a data set, or of its folds, are known and the same."""
    hashes = [provenance.get(key, {}).get(dataset) for provenance in (a, b)]
    return bool(hashes[0]) and hashes[0] == hashes[1]


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    """Settings by dotted names; lists count from 1.

    >>> _flat({"folds": {"count": 3}, "seeds": [0, 1]})
    {'folds.count': 3, 'seeds.1': 0, 'seeds.2': 1}
    """
    entries = dict(enumerate(value, 1)) if isinstance(value, list) else value
    if not isinstance(entries, Mapping):
        return {name: value}
    parts = (_flat(part, f"{name}.{key}".strip(".")) for key, part in entries.items())
    return {key: leaf for part in parts for key, leaf in part.items()}


def _changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> tuple[Change, ...]:
    every = (Change(n, before.get(n), after.get(n)) for n in dict.fromkeys([*before, *after]))
    return tuple(change for change in every if change.before != change.after)


def _scores(pair: _Pair) -> Iterator[Score]:
    a, b = pair.before.fitted, pair.after.fitted
    unit = a.description.angle_unit
    for first, second in pair.common:
        for horizon in (h for h in a.reported if h in b.reported):
            column = rollout(horizon)
            values = a.value(first, column), b.value(second, column)
            errors = first.start_errors(horizon), second.start_errors(horizon)
            standing = _standing(*errors) if pair.alike else ""
            yield Score(a.dataset, first.name, horizon, unit, *values, standing)


def _standing(before: StartErrors, after: StartErrors) -> str:
    """How the second result's errors stand against the first one's, from the same starts."""
    if len(np.unique(before.group)) < 2 or not np.array_equal(before.group, after.group):
        return ""
    if before.diverged or after.diverged:
        return ""
    if after.size.mean() >= before.size.mean():
        standing = loss(after, before).factor.standing
        return {"adequate": "equivalent"}.get(standing, standing)
    standing = loss(before, after).factor.standing
    return {"adequate": "equivalent", "worse": "better"}.get(standing, standing)


def _parameters(pair: _Pair) -> Iterator[Change]:
    """Fitted parameters, of all data, that are not the same."""
    for first, second in pair.common:
        values = _values(first, pair.before), _values(second, pair.after)
        for name, before, after in _changes(*values):
            if before is None or after is None or abs(after - before) > SAME * abs(before):
                yield Change(f"{pair.before.dataset}, {first.name}: {name}", before, after)


def _values(model: Model, section: Section) -> dict[str, float]:
    joints = zip(section.description.joints, model.document.get("joints", ()), strict=False)
    return {
        f"{name} of {joint} [{number['unit']}]": float(number["value"])
        for joint, parameters in joints
        for name, number in parameters.items()
        if number["value"] is not None
    }


# --- As text --------------------------------------------------------------------------------------

WORDS = {
    (True, True): "same data and same folds: scores can be compared fold by fold",
    (True, False): "same data, other folds: scores are of other held-out parts",
    (False, True): "other data: scores cannot be compared",
    (False, False): "other data and other folds: scores cannot be compared",
}


def comparable_lines(compared: SideBySide) -> list[str]:
    """Whether each data set's scores can be compared, a sentence each."""
    datasets = compared.datasets.items()
    return [f"{name}: {WORDS[same['data'], same['folds']]}." for name, same in datasets]


def score_table(compared: SideBySide) -> Table:
    """Median errors of both results."""
    places = decimals([v for score in compared.scores for v in (score.before, score.after)])
    rows = []
    for score in compared.scores:
        ratio = score.after / score.before if score.before > 0 else float("nan")
        change = f"{signed(100 * (ratio - 1), 1)} %" if np.isfinite(ratio) else NOTHING
        after = f"{seconds(score.horizon)} [{score.unit}]"
        values = (fixed(v, places) for v in (score.before, score.after))
        rows.append([score.dataset, score.model, after, *values, change, score.standing])
    heads = [*text_columns("data set", "model", "after"), "first", "second", "change"]
    return table_of([*heads, *text_columns("second is")], rows, "Median errors of predictions.")


def change_table(changes: tuple[Change, ...], what: str) -> Table:
    """What changed: name, value in the first and in the second result."""
    rows = ([name, _shown(before), _shown(after)] for name, before, after in changes)
    return table_of(text_columns(what, "first", "second"), rows)


def _shown(value: Any) -> str:
    if value is None:
        return NOTHING
    return f"{value:.5g}" if isinstance(value, float) else str(value)
