"""Two results side by side: whether they can be compared, and what changed between them."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from frictionid.comparison.result_folder import Document
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
    scores, parameters, missing = list[Score](), list[Change](), list[Change]()
    for name in common:
        sections = before[name], after[name]
        models, others = ({(m.label, m.recipe): m for m in s.models} for s in sections)
        for key in dict.fromkeys([*models, *others]):
            model, other = models.get(key), others.get(key)
            if model is None or other is None:
                missing.append(Change(name, model and model.name, other and other.name))
                continue
            scores += _scores((model, other), sections, alike=all(same[name].values()))
            parameters += _parameters((model, other), sections)
    return SideBySide(
        datasets=same,
        settings=_changes(_flat(a.get("settings", {})), _flat(b.get("settings", {}))),
        versions=_changes(a.get("versions", {}), b.get("versions", {})),
        scores=tuple(scores),
        parameters=tuple(parameters),
        missing=tuple(missing),
    )


def _equal(a: Document, b: Document, key: str, dataset: str) -> bool:
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


def _changes(before: Document, after: Document) -> tuple[Change, ...]:
    every = (Change(n, before.get(n), after.get(n)) for n in dict.fromkeys([*before, *after]))
    return tuple(change for change in every if change.before != change.after)


Models = tuple[Model, Model]
Sections = tuple[Section, Section]


def _scores(models: Models, sections: Sections, *, alike: bool) -> Iterator[Score]:
    """Errors of a model of both results; they stand against each other where folds are alike."""
    a, b = (section.fitted for section in sections)
    for horizon in (h for h in a.reported if h in b.reported):
        column = rollout(horizon)
        values = a.value(models[0], column), b.value(models[1], column)
        standing = _standing(*(model.start_errors(horizon) for model in models)) if alike else ""
        unit = a.description.angle_unit
        yield Score(a.dataset, models[0].name, horizon, unit, *values, standing)


def _standing(before: StartErrors, after: StartErrors) -> str:
    """How the second result's errors stand against the first one's, from the same starts."""
    if len(np.unique(before.group)) < 2 or not np.array_equal(before.group, after.group):
        return ""
    if before.diverged or after.diverged:
        return ""
    is_worse = after.level >= before.level
    standing = loss(*((after, before) if is_worse else (before, after))).factor.standing
    words = {"adequate": "equivalent", "worse": "worse" if is_worse else "better"}
    return words.get(standing, standing)


def _parameters(models: Models, sections: Sections) -> Iterator[Change]:
    """Fitted parameters, of all data, that are not the same."""
    for name, before, after in _changes(*map(_values, models, sections)):
        if before is None or after is None or abs(after - before) > SAME * abs(before):
            yield Change(f"{sections[0].dataset}, {models[0].name}: {name}", before, after)


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
        change = f"{signed(100 * (ratio - 1))} %" if np.isfinite(ratio) else NOTHING
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
