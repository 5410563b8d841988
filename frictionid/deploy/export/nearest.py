"""The Coulomb and viscous friction nearest to a model: all that most engines hold."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from frictionid.arrays import Array
from frictionid.data.joint_scales import joint_sizes, norm_of
from frictionid.deploy.export.exported import ExportedFriction
from frictionid.errors import InputError
from frictionid.evaluation.curves import POINTS, curves, slow_speed
from frictionid.evaluation.initial_states import InitialStates
from frictionid.evaluation.predicted_motion import predict
from frictionid.friction import Friction, Inputs, Law, along, at_rest
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import Plant

_SAME = 1e-9  # of the torques: what rounding does


def nearest(own: ExportedFriction) -> Friction:
    """Coulomb and viscous friction nearest to the model's.

    Least squares over the recorded motion where there are data, so that speeds count as often as
    they occur; else over speeds up to the measured ones, all alike. Coulomb levels and viscous
    coefficients are not negative. A model of this law is given back as it is.

    Raises
    ------
    InputError
        Where the speeds of the motion are not known.

    Examples
    --------
    >>> from frictionid.deploy.export.exported import exported
    >>> from frictionid.friction.laws import Stribeck
    >>> model = Friction(Stribeck(), np.array([[0.1, 0.05, 0.5, 0.02]]))
    >>> nearest(exported(model, speeds=(10.0,))).theta.round(4)
    array([[0.108 , 0.0188]])
    """
    if is_coulomb_viscous(own.law):
        return _held(own, own.friction.theta)
    w, torque = sliding(own)
    fast = np.abs(w) >= slow_speed(np.quantile(np.abs(w), 0.95, axis=0))
    theta = np.zeros((own.friction.n, 2))
    for j, use in enumerate(fast.T):
        if use.any():
            columns = np.stack([np.sign(w[use, j]), w[use, j]], axis=-1)
            theta[j] = nnls(columns, torque[use, j])[0]
    return _held(own, theta)


def _held(own: ExportedFriction, theta: Array) -> Friction:
    return replace(own.friction, law=CoulombViscous(), theta=theta, constraints=None)


def is_coulomb_viscous(law: Law) -> bool:
    """Whether a law is Coulomb and viscous friction, the same in both directions."""
    return isinstance(law, CoulombViscous) and law.symmetric


def sliding(own: ExportedFriction) -> tuple[Array, Array]:
    """Velocities (S, n) and torques (S, n) of the model that a simpler law is to match.

    Raises
    ------
    InputError
        Where the speeds of the motion are not known.
    """
    sharp = replace(own.friction, law=own.friction.law.sharpened())
    if own.prepared is not None:
        nodes = own.prepared.integral.nodes
        return nodes.inputs.w, along(sharp, nodes)
    if own.speeds:
        grid = np.linspace(-1.0, 1.0, POINTS)[:, None] * np.array(own.speeds)
        return grid, curves(sharp, grid)
    raise InputError(
        f"{type(own.law).__name__}: the speeds are not known at which a simpler law is to match "
        "it: name the data set (--dataset), or give speeds"
    )


def rule(own: ExportedFriction) -> str:
    """How `nearest` was found, as a sentence."""
    where = "along the recorded motion" if own.data else "up to the measured speeds, all alike"
    return (
        f"level and slope are the least squares of the model's torques {where}, "
        "without slow samples (|w| < 0.05 rad/s)"
    )


def differs(own: ExportedFriction, held: Friction) -> bool:
    """Whether a friction is another one than the model's, beyond rounding."""
    if is_coulomb_viscous(own.law):
        return own.law.sharpened() == own.law
    if own.law.has_memory or follows_more(own.friction):
        return True
    w, torque = sliding(own)
    off = np.abs(along_velocity(held, w) - torque)
    return bool(off.max() > _SAME * max(float(np.abs(torque).max()), 1e-12))


def follows_more(friction: Friction) -> bool:
    """Whether the torque of a static friction depends on more than the velocity."""
    w = np.ones((2, friction.n))
    x = Inputs(*(v * np.array([[0.0], [1.0]]) for v in (w, w, w, w)))._replace(w=w)
    torque = friction.law.torque(friction.theta, x, ())
    return bool((torque[0] != torque[1]).any())


def along_velocity(friction: Friction, w: Array) -> Array:
    """Torque (S, n) of a static friction at velocities w (S, n), without numerical smoothing."""
    return friction.law.sharpened().torque(friction.theta, at_rest(w), ())


def break_away(friction: Friction) -> Array:
    """Break-away level (n,) [N m] of joints without motor torque at q = 0, mean of directions."""
    levels = []
    for side in (1.0, -1.0):
        x: Inputs = at_rest(np.full(friction.n, side))
        still = x._replace(w=0.0 * x.w)
        memory = friction.law.start(friction.theta, still)
        levels.append(friction.law.limit(friction.theta, x, memory))
    return np.asarray(sum(levels)) / 2


def lost_by(own: ExportedFriction, held: Friction, target: str, names: str) -> list[str]:
    """Sentences on what Coulomb and viscous friction lose of the model."""
    if not differs(own, held):
        return []
    if is_coulomb_viscous(own.law):
        return [
            f"{target} has a step at w = 0, the model smooths it over {own.law.width:g} rad/s "
            f"({own.law.shape}); {names} are its level and slope"
        ]
    lines = [
        f"{target} holds {names} of each joint, no {type(own.law).__name__}: their {rule(own)}"
    ]
    for name, unit, model, other in zip(
        own.joints, own.units, break_away(own.friction), held.theta[:, 0], strict=True
    ):
        if model > 0 and abs(model - other) > 0.01 * model:
            force = "N m" if unit == "rad" else "N"
            lines.append(
                f"{name} breaks away at {model:.3g} {force} by the model, "
                f"at {other:.3g} {force} in {target}"
            )
    return lines


_MOST = 200  # rollouts: more say no more of a median


class Cost(NamedTuple):
    """What another friction costs on recorded motion.

    torque : (n,) RMS difference of the torques along the motion [N m or N]
    own, held : median error 1 s ahead of the model's predictions, and of the other's, in `unit`
    apart : median distance of the two predictions
    predictions : their number, from states that a filter estimates
    """

    torque: tuple[float, ...]
    own: float
    held: float
    apart: float
    unit: str
    predictions: int


def cost_of(exported: ExportedFriction, held: Friction) -> Cost:
    """Cost of a friction in place of the model's, on the motion of its data.

    Raises
    ------
    InputError
        Without data, and where no recording holds a prediction so long.
    """
    data = exported.prepared
    if data is None:
        raise InputError("what is lost shows on recorded motion: name a data set")
    nodes = data.integral.nodes
    off = along(exported.friction, nodes) - along(held, nodes)
    initial = reaching(data.initial_states)
    plant = data.plant[initial.recording]
    motions = [_ahead(plant, f, initial) for f in (exported.friction, held)]
    measured = at_horizon(initial.measured, initial)
    sizes = joint_sizes(data.position_units, data.initial_states.measured)
    errors = [
        norm_of(a - b, data.position_units, sizes)
        for a, b in ((motions[0], measured), (motions[1], measured), (motions[0], motions[1]))
    ]
    # a prediction that has diverged is far away, no number that is left out
    own, other, apart = (float(np.median(np.nan_to_num(e, nan=np.inf))) for e, _ in errors)
    rms = np.sqrt((off**2).mean(axis=0))
    unit = errors[0][1]
    return Cost((*map(float, rms),), own, other, apart, unit, len(measured))


def reaching(initial: InitialStates) -> InitialStates:
    """Those of the initial states that reach the horizon, at most 200, evenly."""
    rows = np.flatnonzero(initial.last[-1] > 0)
    if len(rows) > _MOST:
        rows = rows[np.linspace(0, len(rows) - 1, _MOST).astype(int)]
    return initial.take(rows)


def at_horizon(q: Array, initial: InitialStates) -> Array:
    """Angles (S, n) at the horizon, of series (T + 1, S, n)."""
    at: Array = q[initial.last[-1], np.arange(q.shape[1])]
    return at


def _ahead(plant: Plant, friction: Friction, initial: InitialStates) -> Array:
    each = friction[None][np.zeros(len(initial.q), dtype=int)]
    return at_horizon(predict(plant, each, initial).q, initial)


def cost_sentence(exported: ExportedFriction, cost: Cost) -> str:
    """The cost in words.

    >>> from frictionid.deploy.export.exported import exported
    >>> from frictionid.friction.laws import NoFriction
    >>> model = exported(Friction(NoFriction(), np.zeros((1, 0))), ["hip"])
    >>> cost_sentence(model, Cost((0.01,), 0.05, 0.06, 0.02, "rad", 40))
    "on the data's motion its torques are 0.01 N m off (RMS of hip); 1 s ahead its predictions err \
by 0.06 rad where the model's err by 0.05, 0.02 from these (medians of 40)"
    """
    units = ["N m" if unit == "rad" else "N" for unit in exported.units]
    parts = [
        f"{v if v > 1e-9 else 0.0:.3g} {unit}" for v, unit in zip(cost.torque, units, strict=True)
    ]
    return (
        f"on the data's motion its torques are {', '.join(parts)} off "
        f"(RMS of {', '.join(exported.joints)}); {exported.horizon:g} s ahead its predictions err "
        f"by {cost.held:.3g} {cost.unit} where the model's err by {cost.own:.3g}, "
        f"{cost.apart:.3g} from these (medians of {cost.predictions})"
    )
