"""What a target loses that holds another friction than the model: torque, and motion ahead."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.joint_scales import joint_sizes, norm_of
from frictionid.deploy.export.exported import ExportedFriction
from frictionid.errors import InputError
from frictionid.evaluation.initial_states import InitialStates
from frictionid.evaluation.predicted_motion import predict
from frictionid.friction import Friction, along
from frictionid.mechanics import Plant

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
