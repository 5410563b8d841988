"""What smoothing does to a one-step fit: its own motion, smoothed and fitted again.

One-step fits see smoothed states, whose errors are alike in all recordings, so that no scatter
between these shows what they do to the parameters. A parametric bootstrap does [Efron1993]: the
fitted friction theta moves the machine from the measured starts under the recorded torques, its
motion gets the noise that the angles have, and is fitted as the data were. What the second fit is
off, theta* - theta, is the bias of the first one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.check.motion import motions_of
from frictionid.comparison.fit_model import fit_model
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.data.state_estimators import States
from frictionid.errors import InputError
from frictionid.evaluation import EstimatedStates, Protocol
from frictionid.evaluation.free_run import free_run, make_trajectory
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.method import Method
from frictionid.fitting.one_step.formulation import INTEGRAL
from frictionid.friction import Friction

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
    if any(r.servo is not None for r in dataset.recordings):
        raise InputError("bias: it is known of recorded torques, not of servos: fit by shooting")
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
    cut = [cut[i] for i in np.unique(np.linspace(0, len(cut) - 1, MOST).round().astype(int))]
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
