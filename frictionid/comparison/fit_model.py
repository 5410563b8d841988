"""Fit one model to all recordings of a data set, and what smoothing did to a one-step fit."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array, evenly
from frictionid.check import source_sentences, torque_sources
from frictionid.check.motion import motions_of
from frictionid.check.torque_speed import limit_findings, torque_speeds
from frictionid.data.plants import plant_of, refuse_torques, with_calibrated_servos
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal, holds
from frictionid.data.state_estimators import States, thin
from frictionid.errors import InputError
from frictionid.evaluation import (
    EstimatedStates,
    Prepared,
    Protocol,
    screened,
    torque_left,
    velocity_grid,
    with_speeds,
)
from frictionid.evaluation.free_run import free_run, make_trajectory
from frictionid.fitting.fit import Fit
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction

from .equal_joints import (
    check_units,
    differences,
    equal_groups,
    sentences,
    with_equal,
)
from .training_set import Method, TrainingSet, check_method, training_set


def with_notes(fit: Fit, *, intervals: bool = True) -> Friction:
    """Friction (F + 1, n, P) of a fit's folds and of all data, with what the fit says of all data.

    Sparse laws have an `equation` for each joint. Behind each coefficient stands its 95 % interval
    where the recipe shoots, and else its standard error in a one-step fit; `equation_errors` says
    which. One-step fits have `half_widths` (n, P) of 95 % intervals of the noise alone, NaN where
    there is none, and what they hold in words; networks have none, shooting has its own.
    """
    last, notes = fit.friction, dict[str, Any]()
    assert fit.folds is not None
    if last.law.is_sparse:
        shot = fit.diagnostics is not None
        bars = fit.half_widths() if shot else fit.errors()
        notes["equation"] = tuple(last.law.equation(last.theta, bars, last.position_units))
        notes["equation_errors"] = "95 % intervals" if shot else OF_NOISE
    if intervals and fit.diagnostics is None and fit.covariance.parameters:
        notes["half_widths"] = fit.half_widths()
        notes["half_widths_hold"] = "noise alone, not the bias of smoothed states"
    return fit.folds.noted(notes)


@dataclass(frozen=True)
class _NotFixed(Identifier):
    """An identifier whose friction shooting refines, also where it is given."""

    inner: Identifier

    @property
    def uses_mechanism(self) -> bool:
        return self.inner.uses_mechanism

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        return self.inner.fit(problem, weights, seed)


_NODES = 0.004  # [s], shortest time between samples of the balance that says what torque is left
OF_NOISE = "standard errors of the noise alone, bias of the smoothing not included"
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
    the recipe shoots, it has the whole result as `refined`, see `Estimates`; of sparse laws, the
    `equation`.

    Examples
    --------
    Friction of one's own recordings::

        dataset = frictionid.load_dataset("my_rig")
        print(fit_model(dataset, LeastSquares(Stribeck())))
    """
    check_method(recipe, identifier)
    protocol = protocol or Protocol()
    refuse_torques(dataset)
    estimated = EstimatedStates(dataset, protocol.sample_time)
    plant = plant_of(dataset)
    prepared = Prepared(screened(dataset, plant, estimated), protocol, estimated, plant)
    training = training_set(prepared, [recipe])
    fit = recipe.fit(_NotFixed(identifier), training, seed)
    friction = with_notes(fit)[-1]
    notes: dict[str, Any] = {
        "dataset": dataset.name,
        "data": dict(dataset.hashes),
        "identifier": repr(identifier),
        "recipe": repr(recipe),
        "sample_time": protocol.sample_time,
        "seed": seed,
        **friction.provenance.notes,
    }
    if identifier.uses_mechanism:
        late = (AS_LOGGED,) * (fit.diagnostics is None and as_logged(dataset))
        notes["torque"] = (*source_sentences(torque_sources(dataset)), *late)
        envelopes = tuple(torque_speeds(dataset, prepared.smoothed))
        driven = with_calibrated_servos(dataset, friction.calibration)
        limits = limit_findings(driven, prepared.smoothed, envelopes)
        notes |= {"envelopes": envelopes, "limits": tuple(f.text for f in limits)}
    if fit.diagnostics is not None:
        w = training.problems[recipe.steps[0].name].nodes.inputs.w
        notes["refined"] = fit.estimates(dataset, velocity_grid(w))
    if equal := equal_groups(identifier):
        check_units(friction, equal)
        notes["equality"] = tuple(_equality(identifier, recipe, training, seed))
    notes["torque_left"] = tuple(_torque_left(friction, prepared))
    return with_speeds(friction.noted(notes), prepared)


def _torque_left(friction: Friction, prepared: Prepared) -> Iterable[tuple[Any, ...]]:
    """Scores of the torque left, along samples that are not nearer than windows need them."""
    protocol = prepared.protocol
    apart = max(protocol.sample_time or 0.0, _NODES)
    states = tuple(thin(s, apart) for s in prepared.smoothed)
    estimated = EstimatedStates(prepared.dataset, apart, {INTEGRAL.states: states})
    thinned = replace(prepared, protocol=replace(protocol, sample_time=apart), estimated=estimated)
    return map(tuple, torque_left(friction, thinned))


def as_logged(dataset: Dataset) -> bool:
    """Whether a servo's held targets are taken to act when they are logged."""
    return any(holds(s.goal) and s.target_delay == 0 for s in dataset.servos)


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


# --- What smoothing does to a one-step fit -------------------------------------------------------
#
# One-step fits see smoothed states, whose errors are alike in all recordings, so that no scatter
# between these shows what they do to the parameters. A parametric bootstrap does [Efron1993]: the
# fitted friction theta moves the machine from the measured starts under the recorded torques, its
# motion gets the noise that the angles have, and is fitted as the data were. What the second fit is
# off, theta* - theta, is the bias of the first one.

# Pieces of at most so long [s] are moved, so many at most, with noise drawn so often.
LONGEST, MOST, DRAWS = 3.0, 100, 4
# A piece is left out whose replayed motion is this many times as fast as any measured one.
WILD = 2.0


def with_smoothing_bias(
    friction: Friction,
    dataset: Dataset,
    identifier: Identifier,
    recipe: Method,
    protocol: Protocol,
    seed: int,
) -> Friction:
    """A one-step fit (n, P) of a data set whose intervals hold the bias of smoothed states, too.

    Half the widths of its intervals grow by the size of the bias, as a systematic error; theta
    stays. The provenance has it as `smoothing_bias` (n, P).

    Raises
    ------
    InputError
        For fits without one-step intervals, servos, and where the friction replays no such motion.
    """
    half = friction.provenance.half_widths
    if half is None or friction.calibration is not None:
        raise InputError(
            "bias: it is that of the intervals of a one-step fit, and this one has none: give a "
            "law with parameters, and no calibration; the intervals of shooting have no such bias"
        )
    if dataset.servos:
        raise InputError("bias: it is known of recorded torques, not of servos: fit by shooting")
    if isinstance(identifier, LeastSquares):  # harmonics that were chosen stay
        identifier = replace(identifier, law=friction.law)
    pieces, moved, noise = replayed(friction, dataset)
    rng, off = np.random.default_rng(seed), []
    for _ in range(DRAWS):
        seen = [_seen(*each, rng) for each in zip(pieces.recordings, moved, noise, strict=True)]
        data = replace(pieces, recordings=tuple(seen))
        off.append(fit_model(data, identifier, recipe, protocol, seed).theta - friction.theta)
    bias = np.mean(off, axis=0)
    return friction.noted(
        {
            "half_widths": half + np.abs(bias),
            "half_widths_hold": "noise, and the bias of smoothed states",
            "smoothing_bias": bias,
        }
    )


def replayed(friction: Friction, dataset: Dataset) -> tuple[Dataset, list[Array], list[Array]]:
    """Pieces of the recordings, their motion (T, n) by a friction, and noise (n,) of the angles.

    Raises
    ------
    InputError
        Where more than half of the motion by this friction is nothing like the measured one.
    """
    smoothed = EstimatedStates(dataset).by(INTEGRAL.states)
    each = zip(dataset.recordings, smoothed, _noises(dataset), strict=True)
    cut = [(*piece, noise) for r, states, noise in each for piece in _pieces(r, states)]
    cut = [cut[i] for i in evenly(len(cut), MOST)]
    pieces = replace(dataset, recordings=tuple(piece for piece, _, _ in cut), truth=None)
    trajectory = make_trajectory(pieces, [states for _, states, _ in cut])
    q = free_run(plant_of(pieces), friction[None][np.zeros(len(cut), dtype=int)], trajectory)
    fastest = np.max([np.abs(states.w).max(axis=0) for states in smoothed], axis=0)
    kept = []
    for k, (piece, states, noise) in enumerate(cut):
        moved = q[: len(states.time), k]
        speed = np.abs(np.diff(moved, axis=0)) / np.diff(states.time)[:, None]
        if (speed <= WILD * fastest).all():
            kept.append((piece, moved, noise))
    if len(kept) < 0.5 * len(cut):
        raise InputError(
            f"bias: in {len(cut) - len(kept)} of {len(cut)} pieces of the motion the fitted "
            "friction moves the machine unlike the recordings: fit by shooting instead"
        )
    recordings, motions, noises = (list(part) for part in zip(*kept, strict=True))
    return replace(pieces, recordings=tuple(recordings)), motions, noises


def _noises(dataset: Dataset) -> list[Array]:
    """Noise (n,) [rad] of each recording's angles; motions may be of means of samples."""
    pairs = zip(dataset.recordings, motions_of(dataset.recordings), strict=True)
    return [m.angle_noise * np.sqrt(len(r.angle.time) / len(m.states.time)) for r, m in pairs]


def _pieces(recording: Recording, states: States) -> list[tuple[Recording, States]]:
    """Equal parts of a recording, as long as allowed, with their states."""
    count = int(np.ceil(np.ptp(states.time) / LONGEST - 1e-9))
    out = []
    for k, at in enumerate(np.array_split(np.arange(len(states.time)), max(count, 1))):
        part = States(states.time[at], states.q[at], states.w[at])
        name, angle = f"{recording.name}_{k}", Signal(part.time, part.q)
        piece = replace(recording, name=name, angle=angle, velocity=None, truth=None)
        out.append((piece, part))
    return out


def _seen(piece: Recording, moved: Array, noise: Array, rng: np.random.Generator) -> Recording:
    """A piece as it is measured: its motion with noise (n,)."""
    value = moved + noise * rng.standard_normal(moved.shape)
    return replace(piece, angle=piece.angle._replace(value=value))
