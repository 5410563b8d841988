"""Fit one model to all recordings of a data set."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check import torque_sources
from frictionid.comparison.equal_joints import (
    check_units,
    differences,
    equal_groups,
    sentences,
    with_equal,
)
from frictionid.comparison.training_set import TrainingSet, training_set
from frictionid.data.plants import plant_of, refuse_torques
from frictionid.data.recordings import Dataset
from frictionid.data.signals import holds
from frictionid.errors import InputError
from frictionid.evaluation import (
    EstimatedStates,
    Prepared,
    Protocol,
    screened,
    speeds,
    velocity_grid,
    with_speeds,
)
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.method import Fit, Method
from frictionid.fitting.one_step.formulation import INTEGRAL
from frictionid.fitting.one_step.residual import Problem
from frictionid.fitting.shooting import document_of
from frictionid.friction import Friction


def with_equations(fit: Fit) -> Friction:
    """Friction (F, n, P) of a fit; its provenance has a line for each joint of all data.

    Laws that are not sparse have none. Behind each coefficient stands its 95 % interval where the
    recipe shoots, and else its standard error in a one-step fit; `equation_errors` says which.
    """
    friction, last = fit.friction, fit.friction[-1]
    if not last.law.is_sparse:
        return friction
    bars = fit.error_bars()
    own = {
        "equation": last.law.equation(last.theta, bars.size, last.position_units),
        "equation_errors": bars.meaning,
    }
    return replace(friction, provenance={**friction.provenance, **own})


def with_intervals(friction: Friction, fit: Fit) -> Friction:
    """Friction (F, n, P) of a one-step fit, with the intervals of all data in its provenance.

    `half_widths` (n, P) of 95 % intervals of the noise alone, None where there is none, and what
    they hold in words. Networks and laws without derivatives have none; shooting has its own result
    document.
    """
    law = friction.law
    derivable = law.names and (law.has_gradient or law.has_memory)
    if fit.refined is not None or law.is_network or not derivable:
        return friction
    half = [[v if np.isfinite(v) else None for v in joint] for joint in fit.half_widths().tolist()]
    hold = "noise alone, not the bias of smoothed states"
    known = {"half_widths": half, "half_widths_hold": hold}
    return replace(friction, provenance={**friction.provenance, **known})


@dataclass(frozen=True)
class _NotFixed(Identifier):
    """An identifier whose friction shooting refines, also where it is given."""

    inner: Identifier

    @property
    def uses_mechanism(self) -> bool:
        return self.inner.uses_mechanism

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        return self.inner.fit(problem, weights, seed)


class Fitted(NamedTuple):
    """Friction (n, P) fitted to all recordings, and all that the method gave."""

    friction: Friction
    fit: Fit


AS_LOGGED = (
    "targets are taken to act when they are logged: a delay of theirs, which a fit by shooting "
    "finds, passes for viscous friction here"
)


def fit_model(
    dataset: Dataset,
    identifier: Identifier,
    recipe: Method = INTEGRAL,
    protocol: Protocol | None = None,
    seed: int = 0,
) -> Friction:
    """Friction (n, P) fitted to all recordings, with its calibration where the recipe has one.

    Given friction is refined where the recipe shoots. Sample time and history are those of the
    protocol, so that the intervals are those of a comparison. The provenance names data,
    identifier, recipe and seed, and says as `torque` whether each motor's torque is measured. Where
    the recipe shoots, it has the whole result as `refined`, see `document_of`; of sparse laws, the
    `equation`.

    Raises
    ------
    InputError
        Where data, identifier and recipe do not fit together, or the fit fails.

    Examples
    --------
    Friction of one's own recordings::

        dataset = frictionid.load_dataset("my_rig")
        print(fit_model(dataset, LeastSquares(Stribeck())))
    """
    return fitted(dataset, identifier, recipe, protocol, seed).friction


def fitted(
    dataset: Dataset,
    identifier: Identifier,
    recipe: Method = INTEGRAL,
    protocol: Protocol | None = None,
    seed: int = 0,
) -> Fitted:
    """The friction of `fit_model` and, for its intervals, what the method gave."""
    recipe.check(identifier)
    protocol = protocol or Protocol()
    refuse_torques(dataset)
    estimated = EstimatedStates(dataset, protocol.sample_time)
    plant = plant_of(dataset)
    prepared = Prepared(screened(dataset, plant, estimated), protocol, estimated, plant)
    training = training_set(prepared, [recipe])
    fit = recipe.fit(_NotFixed(identifier), training, seed)
    friction = with_intervals(with_equations(fit), fit)[-1]
    provenance: dict[str, Any] = {
        "dataset": dataset.name,
        "data": dict(dataset.hashes),
        "identifier": repr(identifier),
        "recipe": repr(recipe),
        "sample_time": protocol.sample_time,
        "seed": seed,
        **friction.provenance,
    }
    if identifier.uses_mechanism:
        provenance["torque"] = [source.sentence for source in torque_sources(dataset)]
        if fit.refined is None and _as_logged(dataset):
            provenance["torque"].append(AS_LOGGED)
    if fit.refined is not None:
        w = training.problems[recipe.first_step.name].nodes.inputs.w
        provenance["refined"] = document_of(fit.refined, dataset, velocity_grid(w))
    if equal := equal_groups(identifier):
        check_units(friction, equal)
        provenance["equality"] = _equality(identifier, recipe, training, seed)
    known = replace(friction, provenance=provenance)
    return Fitted(with_speeds(known, speeds(dataset, prepared.smoothed)), fit)


def _as_logged(dataset: Dataset) -> bool:
    """Whether a servo's held targets are taken to act when they are logged."""
    servos = [r.servo for r in dataset.recordings if r.servo is not None]
    return any(holds(s.goal) and s.target_delay == 0 for s in servos)


def _equality(
    identifier: Identifier, recipe: Method, training: TrainingSet, seed: int
) -> list[str]:
    """Whether a fit that gives each joint its own parameters finds equal joints equal."""
    equal = equal_groups(identifier)
    try:
        apart = recipe.fit(_NotFixed(with_equal(identifier, ())), training, seed)
    except InputError as error:
        return [f"whether joints are equal was not tested: fitted apart, {error}"]
    return sentences(differences(apart, equal), equal)
