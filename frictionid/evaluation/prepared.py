"""Data prepared for scoring: problems, initial states and trajectories, each computed once.

What follows from the samples alone (`EstimatedStates`) is shared by all views of the data: under
other mechanism parameters, without physics, or corrected by a calibration. A view computes its
problems and initial states when they are first asked for, and keeps them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from frictionid.arrays import Array
from frictionid.config import NotNegative, Positive, validated
from frictionid.data.plants import (
    Calibration,
    calibrated_dataset,
    calibrated_plant,
    plant_of,
    refuse_torques,
    unit_inertia_plant,
)
from frictionid.data.recordings import Dataset
from frictionid.data.state_estimators import Estimator, KalmanFilter, States, without_outliers
from frictionid.errors import InputError
from frictionid.fitting.one_step.recipe import (
    INTEGRAL,
    STUDY,
    Recipe,
    problem_of,
    states_of,
    training_problem,
)
from frictionid.fitting.one_step.residual import Problem
from frictionid.fitting.one_step.torque_outliers import without_torque_outliers
from frictionid.fitting.shooting import SampleWindows
from frictionid.friction import Friction
from frictionid.friction.coordinates import of_parts, turns_of
from frictionid.mechanics import Plant

from .curves import steady_state, velocity_grid
from .folds import Folds
from .free_run import Trajectory, make_trajectory, with_motor_torque
from .hysteresis import HysteresisSettings
from .initial_states import InitialStates, make_initial_states, preceding_samples, true_states


@validated
class Protocol:
    """Horizons of the rollouts [s], `every` how many seconds one starts, and what comes before.

    history : [s] of each recording before its first score, at least the longest memory
    sample_time : [s] between the samples used, None for all
    whole : whether recordings are also simulated as a whole, from their start, see `free_run`
    initial_states : estimator of the states that rollouts start from, by samples up to there only:
        a kinematic "filter", the same state for all, or each "model" itself, see `state_estimator`
    true_initial_states : whether simulated motion is also predicted from its true states, with
        memories of the true motion before, so that only the model's error remains
    loops : sinusoids of the hysteresis loops, shown of all laws; None: the usual ones, of laws with
        memory only

    >>> Protocol(horizons=(0.5,)).every
    0.25
    """

    horizons: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.1, 0.25, 0.5, 1.0)
    every: Positive = 0.25
    history: NotNegative = 0.15
    sample_time: Positive | None = None
    whole: bool = False
    initial_states: Literal["filter", "model"] = "filter"
    true_initial_states: bool = False
    loops: HysteresisSettings | None = None


@dataclass(frozen=True, eq=False)
class EstimatedStates:
    """States of all recordings, whatever the mechanism's parameters; each estimator runs once.

    sample_time : [s] between the samples used, None for all
    """

    dataset: Dataset
    sample_time: float | None = None
    computed: dict[Estimator, tuple[States, ...]] = field(default_factory=dict)

    def by(self, estimator: Estimator) -> tuple[States, ...]:
        """States by an estimator."""
        if estimator not in self.computed:
            self.computed[estimator] = states_of(
                self._input(estimator), estimator, self.sample_time
            )
        return self.computed[estimator]

    def _input(self, estimator: Estimator) -> Dataset:
        """The data set, for the causal filter without the outliers that the smoother found."""
        recordings = self.dataset.recordings
        if estimator != KalmanFilter() or self.sample_time is not None:
            return self.dataset
        angles = without_outliers([r.angle for r in recordings], self.by(INTEGRAL.states))
        pairs = zip(recordings, angles, strict=True)
        return replace(self.dataset, recordings=tuple(replace(r, angle=a) for r, a in pairs))


@dataclass(frozen=True, eq=False)
class Prepared:
    """A data set prepared for scoring under one plant and, where there is one, one calibration.

    offset : (n,) [rad], that of the angles which the data set has been corrected by
    """

    dataset: Dataset
    protocol: Protocol
    estimated: EstimatedStates
    plant: Plant
    offset: Array | None = None

    def states(self, estimator: Estimator) -> tuple[States, ...]:
        """Estimated states of all recordings, with the corrected angles."""
        states, offset = self.estimated.by(estimator), self.offset
        return states if offset is None else tuple(s._replace(q=s.q - offset) for s in states)

    @cached_property
    def smoothed(self) -> tuple[States, ...]:
        """States by the RTS smoother."""
        return self.states(INTEGRAL.states)

    @cached_property
    def causal(self) -> tuple[States, ...]:
        """States from samples up to each time only."""
        return self.states(KalmanFilter())

    @cached_property
    def euler(self) -> Problem:
        """One-step problem of the study, all rows alike."""
        return self._problem(STUDY)

    @cached_property
    def integral(self) -> Problem:
        """One-step problem of the momentum balance, all rows alike."""
        return self._problem(INTEGRAL)

    @cached_property
    def initial_states(self) -> InitialStates:
        """Initial states of the rollouts."""
        return self._initial_states(self.causal)

    @cached_property
    def true_initial_states(self) -> InitialStates | None:
        """Initial states, the true ones, where these are wanted and known."""
        wanted = self.protocol.true_initial_states
        true = true_states(self.dataset, self.causal) if wanted else None
        return None if true is None else self._initial_states(true)

    @cached_property
    def preceding(self) -> SampleWindows | None:
        """Samples before each initial state, where each model estimates its own."""
        if self.protocol.initial_states != "model":
            return None
        return preceding_samples(self.dataset, self.causal, self.initial_states)

    @cached_property
    def trajectory(self) -> Trajectory | None:
        """Whole recordings, where free runs are wanted."""
        if not self.protocol.whole:
            return None
        return make_trajectory(self.dataset, self.causal, self.protocol.history)

    @property
    def speeds(self) -> Array:
        """Velocities (K, m) [rad/s] where parts slide."""
        return speeds(self.dataset, self.smoothed)

    @cached_property
    def grid(self) -> Array:
        """Velocities (V, n) [rad/s] of the friction curves."""
        return velocity_grid(self.speeds)

    @property
    def position_units(self) -> tuple[str, ...]:
        """Unit of each joint's position, "rad" or "m"."""
        return self.plant.mechanism.position_units

    def _problem(self, recipe: Recipe) -> Problem:
        limits = self.protocol.sample_time, self.protocol.history
        return problem_of(self.dataset, self.plant, recipe, *limits, self.states(recipe.states))

    def _initial_states(self, states: Sequence[States]) -> InitialStates:
        p = self.protocol
        return make_initial_states(
            self.dataset, states, self.plant, p.horizons, every=p.every, begin=p.history
        )


_SCORED = "euler integral initial_states true_initial_states preceding trajectory grid".split()


def prepare(
    dataset: Dataset, protocol: Protocol, parameters: Mapping[str, float] | None = None
) -> Prepared:
    """A data set prepared for scoring, with all that the protocol asks for computed.

    `parameters` replace the mechanism's, for models that bring their own; with motor constants
    among them, torques that follow from voltages follow them.

    Raises
    ------
    InputError
        Where the recordings are too short for the protocol, or a parameter is unknown.
    """
    plant = plant_of(dataset, parameters)
    refuse_torques(dataset)
    if dataset.truth is not None and steady_state(dataset.truth).n != plant.parts:
        raise InputError(f"data set {dataset.name!r}: [truth] is not that of {plant.parts} joints")
    estimated = EstimatedStates(dataset, protocol.sample_time)
    driven = screened(with_motor_torque(dataset, plant), plant, estimated)
    prepared = Prepared(driven, protocol, estimated, plant)
    for name in _SCORED:  # now, so that data too short are refused before anything is fitted
        getattr(prepared, name)
    return prepared


def screened(dataset: Dataset, plant: Plant, estimated: EstimatedStates) -> Dataset:
    """The data set without torques that the motion denies, see `torque_outliers`."""
    return without_torque_outliers(dataset, plant, estimated.by(INTEGRAL.states))


def with_parameters(prepared: Prepared, parameters: Mapping[str, float]) -> Prepared:
    """The data prepared under other mechanism parameters; no state is estimated anew."""
    if not parameters:
        return prepared
    plant = plant_of(prepared.dataset, parameters)
    return replace(prepared, dataset=with_motor_torque(prepared.dataset, plant), plant=plant)


def without_physics(prepared: Prepared) -> Prepared:
    """The data prepared for models of the whole acceleration, see `unit_inertia_plant`."""
    return replace(prepared, plant=unit_inertia_plant(prepared.dataset))


def prepared_for(prepared: Prepared, friction: Friction) -> Prepared:
    """The data prepared with the model's own mechanism or parameters."""
    if friction.mechanism == "unit":
        return without_physics(prepared)
    return with_parameters(prepared, friction.parameters)


def with_calibration(prepared: Prepared, calibration: Calibration | None) -> Prepared:
    """The data corrected by a calibration, and prepared with its base parameters."""
    if calibration is None:
        return prepared
    dataset = calibrated_dataset(prepared.dataset, calibration)
    plant = calibrated_plant(prepared.dataset, calibration)
    offset = calibration.offset if prepared.offset is None else calibration.offset + prepared.offset
    return Prepared(dataset, prepared.protocol, prepared.estimated, plant, offset)


CalibratedView = tuple[Array, Prepared]  # folds (k,) of one calibration, data corrected by it


def calibrated_views(
    prepared: Prepared, calibration: Calibration | None, folds: int
) -> tuple[CalibratedView, ...]:
    """The data as each of F folds sees them, one view for each distinct calibration.

    Views are in the order of their last fold, so that the last one is that of the last fold.
    """
    if calibration is None:
        return ((np.arange(folds), prepared),)
    groups = _same_calibration(calibration, folds)
    return tuple(
        (folds_alike, with_calibration(prepared, calibration[int(folds_alike[0])]))
        for folds_alike in groups
    )


def _same_calibration(calibration: Calibration, folds: int) -> list[Array]:
    """Folds (k,) of each distinct calibration, in the order of their last fold.

    >>> sensors = {name: np.zeros((3, 1)) for name in ("gain", "bias", "offset")}
    >>> late = replace(Calibration.ideal(1), **sensors, delay=np.array([0.01, 0.02, 0.01]))
    >>> [own.tolist() for own in _same_calibration(late, 3)]
    [[1], [0, 2]]
    """
    fields = [np.asarray(x) for x in vars(calibration).values() if x is not None]
    groups: dict[bytes, list[int]] = {}
    for fold in range(folds):
        groups.setdefault(b"".join(x[fold].tobytes() for x in fields), []).append(fold)
    return [np.array(group) for group in sorted(groups.values(), key=lambda group: group[-1])]


def training_of(prepared: Prepared, recipe: Recipe) -> Problem:
    """The one-step problem that identifiers fit by a recipe."""
    limits = prepared.protocol.sample_time, prepared.protocol.history
    states = prepared.states(recipe.states)
    return training_problem(prepared.dataset, prepared.plant, recipe, *limits, states)


def speeds(dataset: Dataset, smoothed: Iterable[States]) -> Array:
    """Velocities (K, m) [rad/s] where parts slide: true ones if they are known, else smoothed."""
    true = [r.truth.velocity.value for r in dataset.recordings if r.truth is not None]
    w = np.concatenate(true if true else [s.w for s in smoothed])
    return of_parts(w, turns_of(dataset.mechanism, w))


def with_speeds(friction: Friction, prepared: Prepared) -> Friction:
    """Friction whose provenance has the parts' names and greatest speeds in the data."""
    reach = tuple(float(f"{speed:.6g}") for speed in np.abs(prepared.speeds).max(axis=0))
    joints = tuple(prepared.dataset.mechanism.friction_names)
    return friction.noted({"joints": joints, "speeds": reach})


# --- Horizons and sample time that follow the data, where nobody has said which -------------------

HORIZONS_OF_ARMS = (0.05, 0.1, 0.2)  # [s]: without its controller an arm drifts off
_FAST, _APART = 0.95e-3, 0.002  # [s] between samples that are more than scores need, and then
_SWINGING = 2  # joints of what no controller must hold


def is_arm(dataset: Dataset) -> bool:
    """Whether a controller held the machine that is in no recording: many joints, all driven."""
    mechanism = dataset.mechanism
    return mechanism.n > _SWINGING and all(mechanism.driven) and not dataset.servos


def protocol_for(protocol: Protocol, held: Sequence[tuple[Dataset, Folds | None]]) -> Protocol:
    """The protocol with horizons that folds, or recordings, hold, where it has the usual ones.

    Of arms the usual ones are shorter. Samples are 2 ms apart where a log has more than 1 kHz.

    held : data sets with their folds, None where whole recordings are predicted
    """
    if protocol.sample_time is None and all(usual_interval(data) < _FAST for data, _ in held):
        protocol = replace(protocol, sample_time=_APART)
    if protocol.horizons != Protocol().horizons:
        return protocol
    usual = HORIZONS_OF_ARMS if all(is_arm(data) for data, _ in held) else protocol.horizons
    room = min(_longest(data, folds) for data, folds in held) - protocol.history
    kept = tuple(h for h in usual if h + protocol.every <= room)
    return replace(protocol, horizons=kept or usual[:1])


def usual_interval(dataset: Dataset) -> float:
    """Usual time [s] between two samples."""
    return float(np.median(np.concatenate([np.diff(r.angle.time) for r in dataset.recordings])))


def _longest(dataset: Dataset, folds: Folds | None) -> float:
    """Longest stretch of time [s] that one fold holds out, or of a recording."""
    if folds is None or not folds.contiguous:
        return max(r.angle.duration for r in dataset.recordings)
    longest = 0.0
    for time, label in zip(folds.times, folds.labels, strict=True):
        edges = np.flatnonzero(np.diff(label)) + 1
        first, last = np.append(0, edges), np.append(edges, len(label)) - 1
        longest = max(longest, float((time[last] - time[first]).max(initial=0.0)))
    return longest
