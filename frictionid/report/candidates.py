"""Candidates of a verdict: models that can be recommended, and how they stand."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.reference_model import (
    Choice,
    Factor,
    Loss,
    StartErrors,
    choose,
    loss,
    preferring,
    unsupported,
)
from frictionid.evaluation.statistics import (
    FEWEST,
    nested_complexity,
    nested_names,
    shown_names,
    zero_names,
)
from frictionid.friction.provenance import tables_of

from .memory import has_memory
from .numbers import decimals, fixed, seconds, short
from .plausibility import FAILED, Check, checks_of
from .sections import ANY, Model, Section, SummaryData, rollout
from .tables import Cell, Column, Table, line, table_of, text_columns

EFFECTIVE = "effective_parameters_count"  # column
CANDIDATES = ("none", "fitted", "given")  # roles of models that can be recommended


class Measure(NamedTuple):
    """What models are judged by: predictions after a horizon [s], or, after NaN, torque left."""

    horizon: float = float("nan")
    unit: str = ""

    @property
    def is_torque(self) -> bool:
        """Whether it is torque left."""
        return bool(np.isnan(self.horizon))

    @property
    def column(self) -> str:
        """Column of the scores."""
        return "torque_left_share" if self.is_torque else rollout(self.horizon)

    @property
    def of_what(self) -> str:
        """What is an error, as the title of an axis."""
        if self.is_torque:
            return "torque left [% of the measured rms]"
        return f"error after {seconds(self.horizon)} [{self.unit}]"

    def shown(self, errors: Array) -> Array:
        """Errors in the unit of `of_what`."""
        return 100 * errors if self.is_torque else errors

    def size(self, error: float) -> str:
        """An error with its unit."""
        return f"{100 * error:.2g} %" if self.is_torque else f"{short(error)} {self.unit}"

    def words(self, error: float) -> str:
        """What a model of an error does.

        >>> Measure(0.5, "rad").words(0.1), Measure().words(0.047)
        ('is 0.10 rad off after 0.5 s', 'leaves 4.7 % of the torque')
        """
        if self.is_torque:
            return f"leaves {self.size(error)} of the torque"
        return f"is {self.size(error)} off after {seconds(self.horizon)}"


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model that can be recommended, and how it stands.

    Attributes
    ----------
    model : its line of the tables
    error : median error of all its predictions, or torque left; by_fold : (F,) of each fold
    errors : of its predictions from each start
    complexity : effective number of parameters, infinite where it is not known
    checks : whether it is physically plausible
    standing : "best", "adequate", "undecided", "worse" or "diverged", against the reference, see
        `frictionid.evaluation.reference_model.Choice`; "" of another recipe than the verdict's
    loss : against the reference, None of itself
    """

    model: Model
    error: float
    by_fold: Array
    errors: StartErrors
    complexity: float
    checks: tuple[Check, ...] = ()
    standing: str = ""
    loss: Loss | None = None

    @property
    def name(self) -> str:
        """Name of the model as it stands in the tables."""
        return self.model.name

    @property
    def implausible(self) -> tuple[str, ...]:
        """What is physically wrong with it, one clause for each check that it fails."""
        return tuple(check.statement for check in self.checks if check.outcome == FAILED)

    @property
    def unfit(self) -> bool:
        """Whether it is implausible, or its fit has not converged."""
        return bool(self.implausible or (self.model.refined and not self.model.refined.settled))

    @property
    def is_finite(self) -> bool:
        """Whether most of its predictions of each recording are finite."""
        return bool(len(self.errors.group)) and not self.errors.diverged

    @property
    def level(self) -> float:
        """Size of its errors, 1 at most: what models are compared by."""
        return self.errors.level


class Contrast(NamedTuple):
    """The best candidates of two groups, and the factor by which the first one is farther off."""

    first: Candidate
    second: Candidate
    factor: Factor

    @property
    def answer(self) -> str:
        """Whether the first one is practically worse: "yes", "no" or "undecided"."""
        return {"worse": "yes", "adequate": "no"}.get(self.factor.standing, "undecided")


def candidates_of(data: SummaryData, measure: Measure) -> list[Candidate]:
    """All models of a data set that can be recommended, with their checks, as in the tables.

    Given numbers that were fitted to these recordings are none: nothing is held out of them.

    measure : by what they are compared
    """
    column = measure.column
    candidates = [
        Candidate(
            model,
            data.value(model, column),
            data.of_folds(model, column),
            model.start_errors(measure.horizon),
            complexity_of(data, model),
        )
        for model in data.of_role(*CANDIDATES)
        if not _has_seen(model, data)
    ]
    static = [c for c in candidates if not has_memory(c.model)]
    controls = {
        c.model: (best.first.name, best.factor)
        for c in candidates
        if has_memory(c.model) and (best := contrast(under(static, c.model.recipe), [c]))
    }
    return [replace(c, checks=checks_of(c.model, data, controls.get(c.model))) for c in candidates]


def under(candidates: Sequence[Candidate], recipe: str) -> list[Candidate]:
    """Candidates by a recipe, and those that no recipe changes."""
    return [c for c in candidates if c.model.recipe in (ANY, recipe)]


def _has_seen(model: Model, data: SummaryData) -> bool:
    """Whether a given model's file says that it was fitted to files of the data set."""
    hashes = set(tables_of(model.provenance.data).values())
    return model.role == "given" and bool(hashes & data.description.hashes)


def complexity_of(data: SummaryData, model: Model) -> float:
    """Effective number of parameters, else their number; infinite where neither is known."""
    if model.role == "none":
        return 0.0
    counts = [data.value(model, name) for name in (EFFECTIVE, "n_parameters")]
    return next((count for count in counts if np.isfinite(count)), float("inf"))


def judged(
    candidates: Sequence[Candidate], others: Sequence[Candidate] = ()
) -> tuple[Choice, tuple[Candidate, ...]]:
    """What the rule chooses of candidates from the same starts, and these with how they stand.

    others : by other recipes, whose parameters have intervals
    """
    names = [_parameters(c.model) for c in candidates]
    errors = [c.errors for c in candidates]
    fits = [c.model for c in (*candidates, *others) if c.model.refined]
    shown = [_shown(c.model, fits) for c in candidates]
    choice = choose(
        errors,
        nested_complexity([c.complexity for c in candidates], names),
        unsupported(errors, names, shown) | np.array([c.unfit for c in candidates], dtype=bool),
        np.array([c.model.role == "none" for c in candidates], dtype=bool),
    )
    zero = [zero_names(c.model.document if c.model.refined else {}) for c in candidates]
    choice = preferring(choice, names, shown, zero)
    standings = zip(candidates, choice.standings, choice.losses, strict=False)
    return choice, tuple(replace(c, standing=s, loss=against) for c, s, against in standings)


def _parameters(model: Model) -> frozenset[str]:
    """`nested_names` of a fit's friction parameters; a sparse sum has those of its terms."""
    joints = model.document.get("joints") if model.role == "fitted" else ()
    return nested_names(
        name
        for joint in joints or ()
        for name, entry in joint.items()
        if entry["value"] or not model.provenance.equation
    )


def _shown(model: Model, fits: Sequence[Model]) -> frozenset[str] | None:
    """Friction's parameters that data tell from zero, by any recipe; None without intervals."""
    identified = [shown_names(f.refined) for f in fits if f.label == model.label]
    return frozenset().union(*filter(None, identified)) if identified else None


def recipe_to_judge(candidates: Sequence[Candidate]) -> str:
    """The recipe whose models are compared: one that corrects the data, of the most models.

    Shooting, which estimates the calibration beside friction, corrects them too. Of equal ones that
    of the lowest error.
    """

    def rank(recipe: str) -> tuple[bool, int, float]:
        models = [c for c in candidates if c.model.recipe == recipe]
        corrects = any(c.model.method.get("corrects") or c.model.refined for c in models)
        return corrects, len(models), -min(c.level for c in models if c.is_finite)

    usable = {c.model.recipe for c in candidates if c.model.recipe != ANY and c.is_finite}
    return max(sorted(usable), key=rank, default=ANY)


def contrast(first: Sequence[Candidate], second: Sequence[Candidate]) -> Contrast | None:
    """The best of a group against the best of another; None where one has no finite candidate."""
    groups = [[c for c in group if c.is_finite] for group in (first, second)]
    if not all(groups):
        return None
    a, b = (min(group, key=lambda c: c.level) for group in groups)
    if len(np.unique(a.errors.group)) < FEWEST:
        return None
    if a.level >= b.level:
        return Contrast(a, b, loss(a.errors, b.errors).factor)
    return Contrast(a, b, loss(b.errors, a.errors).factor.turned)


FAMILIES = {
    "physics": "physics with textbook friction",
    "hybrid": "physics with learned friction",
    "black box": "no physics",
}
# laws whose form was learned, by their names in model files
LEARNED = "mlp window_mlp lstm ensemble TorchModule library table spline".split()


def family(model: Model) -> str:
    """Family of a model; "" for fixed numbers and the truth."""
    if model.role not in ("none", "fitted"):
        return ""
    if model.document.get("mechanism"):
        return "black box"
    return "hybrid" if model.document.get("law", {}).get("kind", "") in LEARNED else "physics"


def family_table(section: Section) -> Table | None:
    """Median rollout errors of all models by family; None where a family is missing."""
    models = [(name, m) for name in FAMILIES for m in section.models if family(m) == name]
    places = [(data, h) for data in section.data for h in data.reported]
    if {name for name, _ in models} != set(FAMILIES) or not places:
        return None
    values = np.array([[data.value(m, rollout(h)) for data, h in places] for _, m in models])
    lowest = np.where(np.isfinite(values), values, np.inf).min(axis=0)
    digits = [decimals(column) for column in values.T]
    lines = [
        line([FAMILIES[name], model.name, *map(Cell, map(fixed, row, digits), row == lowest)], name)
        for (name, model), row in zip(models, values, strict=True)
    ]
    columns = [Column(f"{d.dataset}, {h:g} s", unit=d.description.angle_unit) for d, h in places]
    caption = (
        f"Median {section.description.coordinate} error of predictions by what a model knows: on "
        f"held-out motion of {section.dataset}, and on data that no fit has seen."
    )
    return table_of([*text_columns("what it knows", "model"), *columns], lines, caption)
