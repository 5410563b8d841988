"""Formulation of one-step problems: state estimator, scheme and stiction mask of a recipe.

STUDY is the recipe of the study [DeMeester2020], INTEGRAL the default.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Literal, Protocol

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.config import NotNegative, validated
from frictionid.data.joint_scales import are_mixed
from frictionid.data.recordings import Dataset
from frictionid.data.signals import taken
from frictionid.data.state_estimators import RTS, Backward, Estimator, States, thin
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.coordinates import with_units_of
from frictionid.mechanics import Mechanism, Plant

from ..fit import Fit
from ..identifier import Identifier
from .one_step_fit import checked_fit, one_step_fit
from .residual import Problem, mask_stiction, one_step_problem


@validated
class Recipe:
    """How a one-step problem is made: estimated states and a scheme, "euler" or "integral".

    velocity_threshold : [rad/s] of the stiction mask of a fit, see `mask_stiction`. None: from
    the speeds in each recording. 0 uses all rows, as the study did.
    """

    name: str
    states: Estimator
    scheme: Literal["euler", "integral"]
    velocity_threshold: NotNegative | None = 0.0
    needs_intervals: ClassVar[bool] = False
    calibrated: ClassVar[None] = None
    corrects: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        if self.scheme == "integral" and isinstance(self.states, Backward):
            raise InputError(
                f"recipe {self.name!r}: backward differences lag half a sample, which makes the "
                '"integral" scheme worse than "euler": choose the states "rts" or "savgol"'
            )

    @property
    def steps(self) -> "tuple[Recipe, ...]":
        """The one-step recipes whose problems a fit needs."""
        return (self,)

    def friction_of(
        self, identifier: Identifier, data: "TrainingData", seed: int
    ) -> tuple[Friction, Problem]:
        """The identifier's friction (F + 1, n, P) of the folds and of all data, and its problem."""
        uses = identifier.uses_mechanism
        problem = data.problems[self.name] if uses else data.without_mechanism(self)
        friction = checked_fit(identifier, problem, data.weights[self.name], seed)
        return with_units_of(data.mechanism, friction), problem

    def fit(self, identifier: Identifier, data: "TrainingData", seed: int) -> Fit:
        """The identifier's friction of all folds and of all data; InputError where that fails."""
        friction, problem = self.friction_of(identifier, data, seed)
        weights = data.weights[self.name][-1]
        return one_step_fit(friction, problem, weights, intervals=not identifier.fixed)


class TrainingData(Protocol):
    """What recipes fit: a one-step problem for each, and the weights (F + 1, K) of its rows.

    The rows of the weights are those of the folds' training and, last, of all data.
    """

    @property
    def problems(self) -> Mapping[str, Problem]: ...
    @property
    def weights(self) -> Mapping[str, Array]: ...
    @property
    def mechanism(self) -> Mechanism: ...

    def without_mechanism(self, recipe: Recipe) -> Problem:
        """The problem for joints of unit inertia on which nothing but friction acts."""
        ...


STUDY = Recipe("study", Backward(), "euler")
INTEGRAL = Recipe("integral", RTS(), "integral", velocity_threshold=None)


def states_of(
    dataset: Dataset, estimator: Estimator, sample_time: float | None
) -> tuple[States, ...]:
    """Estimated states of all recordings, at samples at least `sample_time` apart."""
    angles = [r.angle for r in dataset.recordings]
    if sample_time is None:
        return estimator(angles)
    if isinstance(estimator, Backward):  # differences need the samples they are used at
        few = [thin(States(*a[:2], a.value), sample_time).time for a in angles]
        pairs = zip(angles, few, strict=True)
        return estimator([taken(a, np.searchsorted(a.time, time)) for a, time in pairs])
    return tuple(thin(s, sample_time) for s in estimator(angles))


def problem_of(
    dataset: Dataset,
    plant: Plant,
    recipe: Recipe,
    sample_time: float | None = None,
    history: float = 0.0,
    states: tuple[States, ...] | None = None,
) -> Problem:
    """One-step problem of a data set by a recipe, without stiction mask: for scores.

    The rows are the same for every recipe. Each recording's first interval is left out, where
    backward differences know no velocity yet.

    sample_time : [s] between the samples used, None for all
    history : [s] of each recording before its first row
    states : of the recipe's estimator, if they are known already

    Raises
    ------
    InputError
        Where no recording has a row.
    """
    if states is None:
        states = states_of(dataset, recipe.states, sample_time)
    if all(len(s.time) < 2 for s in states):
        raise InputError(
            f"data set {dataset.name!r}: samples {sample_time} s apart leave no interval of any "
            "recording: lower sample_time"
        )
    lost = 1 if isinstance(recipe.states, Backward) else 0
    before = [max(_samples(history, s.time), 1) - lost for s in states]
    return one_step_problem(recipe.scheme, plant, dataset.recordings, states, before)


def _samples(seconds: float, time: Array) -> int:
    """Samples of a clock in so many seconds."""
    return round(seconds / usual_step(time)) if len(time) > 1 else 0


def training_problem(
    dataset: Dataset,
    plant: Plant,
    recipe: Recipe,
    sample_time: float | None = None,
    history: float = 0.0,
    states: tuple[States, ...] | None = None,
) -> Problem:
    """One-step problem for fits: `problem_of` with the rows of joints at rest projected out.

    Where some joints turn and others slide, r and G are in units of the joints' sizes, as in the
    scores: a fit does not depend on whether a position is in m or in mm.

    Raises
    ------
    InputError
        Where no joint moves, or no recording has a row.
    """
    if not dataset.scales.fast.any():
        raise InputError(
            f"data set {dataset.name!r}: no joint moves by more than the noise of its angle: give "
            "recordings of motion"
        )
    problem = problem_of(dataset, plant, recipe, sample_time, history, states)
    if are_mixed(plant.mechanism.position_units):
        sizes = dataset.scales.size
        problem = replace(problem, r=problem.r / sizes, G=problem.G / sizes[:, None])
    threshold = recipe.velocity_threshold
    return problem if threshold == 0 else mask_stiction(problem, threshold)
