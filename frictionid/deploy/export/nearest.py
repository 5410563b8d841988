"""The Coulomb and viscous friction nearest to a model, and what else of it a target loses."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from frictionid.arrays import Array, rms
from frictionid.data.joint_scales import joint_sizes, norm_of
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.errors import InputError
from frictionid.evaluation.curves import POINTS, slow_speed
from frictionid.evaluation.initial_states import InitialStates
from frictionid.evaluation.predicted_motion import predict
from frictionid.friction import Friction, Law, along, at_rest
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics.plant import base_by_rotors

from ..compensation import listed
from .exported import ExportedFriction, follows

_SAME = 1e-9  # of the torques: what rounding does


def nearest(model: ExportedFriction, apart: Array | float = 0.0) -> Friction:
    """Coulomb and viscous friction nearest to the model's.

    Least squares over the recorded motion where there are data, so that speeds count as often as
    they occur; else over speeds up to the measured ones, all alike. Coulomb levels and viscous
    coefficients are not negative. A model of this law is given back as it is.

    apart : constant torque (n,) [N m] that the target holds beside them

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
    theta = np.zeros((model.friction.n, 2))
    if is_coulomb_viscous(model.law):
        theta = model.friction.theta
    elif model.nearest is not None and not np.any(apart):
        theta = model.nearest.theta
    else:
        w, torque, fast = sliding(model)
        torque = torque - apart
        for j, use in enumerate(fast.T):
            if use.any():
                columns = np.stack([np.sign(w[use, j]), w[use, j]], axis=-1)
                theta[j] = nnls(columns, torque[use, j])[0]
    return replace(model.friction, law=CoulombViscous(), theta=theta, constraints=None)


def is_coulomb_viscous(law: Law) -> bool:
    """Whether a law is Coulomb and viscous friction, the same in both directions."""
    return isinstance(law, CoulombViscous) and law.symmetric


def sliding(model: ExportedFriction) -> tuple[Array, Array, Array]:
    """Velocities and torques (S, n) that a simpler law is to match, and which of them are fast.

    Raises
    ------
    InputError
        Where the speeds of the motion are not known, or the torque is not finite there.
    """
    sharp = replace(model.friction, law=model.friction.law.sharpened())
    if model.prepared is not None:
        nodes = model.prepared.integral.nodes
        w, torque = nodes.inputs.w, along(sharp, nodes)
    elif model.speeds:
        w = np.linspace(-1.0, 1.0, POINTS)[:, None] * np.array(model.speeds)
        with np.errstate(over="ignore", invalid="ignore"):  # refused below
            torque = sharp.curve(w)
    else:
        raise InputError(
            f"{type(model.law).__name__}: the speeds are not known at which a simpler law is to "
            "match it: name the data set (--dataset), or give speeds"
        )
    wrong = ~np.isfinite(torque).all(axis=0)
    if wrong.any():
        j = int(wrong.argmax())
        at = float(w[~np.isfinite(torque[:, j]), j][0])
        raise InputError(
            f"{type(model.law).__name__}: the torque of {model.joints[j]} is not finite at a "
            f"velocity of {at:.3g}, and no simpler law can match it: fit again"
        )
    return w, torque, np.abs(w) >= slow_speed(np.quantile(np.abs(w), 0.95, axis=0))


def differs(model: ExportedFriction, held: Friction) -> bool:
    """Whether a friction is another one than the model's, beyond rounding."""
    if is_coulomb_viscous(model.law):
        return model.law.sharpened() == model.law
    if model.law.has_memory or model.nearest is not None or followed(model):
        return True
    w, torque, _ = sliding(model)
    off = np.abs(held.curve(w) - torque)
    return bool(off.max() > _SAME * max(float(np.abs(torque).max()), 1e-12))


_MORE = {"q": "the angle", "u": "the motor torque", "load": "the bearing load"}


def followed(model: ExportedFriction) -> list[str]:
    """What beside the velocity the torque depends on, in words."""
    return [words for name, words in _MORE.items() if follows(model.friction, name)]


def matched(model: ExportedFriction) -> str:
    """Where a simpler law matches the model, in words; see `sliding`."""
    if model.data is not None:
        return "along the recorded motion"
    where, inputs = "up to the measured speeds, all alike", " and ".join(followed(model))
    return f"{where}, at zero of {inputs}" if inputs else where


def break_away(friction: Friction) -> Array:
    """Break-away level (n,) [N m] of joints without motor torque at q = 0, mean of directions."""
    ahead, back = (at_rest(np.full(friction.n, side)) for side in (1.0, -1.0))
    memory = friction.law.start(friction.theta, ahead._replace(w=0.0 * ahead.w))
    levels = (friction.law.limit(friction.theta, x, memory) for x in (ahead, back))
    return np.asarray(sum(levels)) / 2


def lost_by(model: ExportedFriction, held: Friction, target: str, names: str) -> list[str]:
    """Sentences on what Coulomb and viscous friction lose of the model."""
    if not differs(model, held):
        return []
    if is_coulomb_viscous(model.law):
        return [
            f"{target} has a step at w = 0, the model smooths it over {model.law.width:g} rad/s "
            f"({model.law.shape}); {names} are its level and slope"
        ]
    lines = [f"{target} holds {names} of each joint, no {type(model.law).__name__}"]
    if model.nearest is None or not model.nearest.published:
        where = "along the recorded motion" if model.nearest else matched(model)
        units = "/s, ".join(dict.fromkeys(model.units))
        lines[0] += (
            f": their level and slope are the least squares of the model's torques {where}, "
            f"without slow samples (|w| < 0.05 {units}/s)"
        )
    levels = (break_away(model.friction), break_away(held))
    for name, unit, level, other in zip(model.joints, model.torque_units, *levels, strict=True):
        if level > 0 and abs(level - other) > 0.01 * level:
            lines.append(
                f"{name} breaks away at {level:.3g} {unit} by the model, "
                f"at {other:.3g} {unit} in {target}"
            )
    return lines


_FEW = 3  # base parameters named in a sentence
Row = tuple[str, float, float, str]  # base parameter, its value in a file and in the model, unit


def armature(model: ExportedFriction) -> tuple[Array | None, list[str]]:
    """Inertia (m,) of rotors [kg m^2], and base parameters that are the model's by it.

    None where no rotor is known, or one turns with other joints. With data it is what the described
    bodies lack of the model's base parameters.
    """
    mechanism, numbers = model.mechanism, model.friction.parameters
    if mechanism is None:
        is_single = len(model.joints) == 1 and "rotor" in numbers
        return np.array([numbers["rotor"]]) if is_single else None, []
    values = mechanism.nominal({k: numbers[k] for k in numbers if k in mechanism.defaults})
    changes = base_by_rotors(mechanism, values)
    if not changes:
        return None, []
    bodies, base = mechanism.base(values | dict.fromkeys(changes, 0.0)), model.calibration.base
    base = mechanism.base(values) if base is None or model.data is None else base
    columns = np.reshape([*changes.values()], (-1, len(base))).T
    at = np.abs(columns).max(axis=1, initial=0.0) > _SAME
    rotors = columns @ nnls(columns[at], (base - bodies)[at])[0]
    same = np.abs(base - bodies - rotors) <= _SAME * np.abs(base)
    A, q = mechanism.friction_map, np.zeros(mechanism.n)
    M = mechanism.inertia(bodies + rotors, q) - mechanism.inertia(bodies, q)
    parts, off = nnls((A[:, :, None] * A[:, None]).reshape(len(A), -1).T, M.ravel())
    if off > _SAME * np.abs(M).max() or not parts.any():
        return None, []
    return parts, [] if model.data is None else list(compress(mechanism.base_names, same))


def kept_inertias(model: ExportedFriction, target: str, carried: Sequence[str] = ()) -> list[str]:
    """A sentence on base parameters that the fit has otherwise than its data are described.

    carried : those that the target's armature makes the model's; None where it has none
    """
    fitted = model.friction.provenance.refined
    apart: list[tuple[float, Row]] = [
        (-abs(e.value - e.nominal) / e.error, (e.name, e.nominal, e.value, e.unit))
        for e in (fitted.parameters if fitted else ())
        if e.block == "inertia" and e.nominal is not None and not e.holds(e.nominal)
        if e.name not in (carried or ())
    ]
    rows = base_differences([row for _, row in sorted(apart)], "described")
    said = (
        f"{target} keeps its own masses and inertias, the model has others: {rows}; "
        "--to mujoco without --into writes them"
    )
    said += ", --dataset those of rotors" * (carried is not None and model.data is None)
    return [said] if apart else []


def base_differences(rows: Sequence[Row], word: str) -> str:
    """The first few base parameters."""
    parts = [f"{name} {b:.4g} {unit} ({word} {a:.4g})" for name, a, b, unit in rows[:_FEW]]
    return ", ".join(parts) + f" and {len(rows) - _FEW} more" * (len(rows) > _FEW)


def lost_of_motors(model: ExportedFriction, target: str, *, has_drives: bool) -> list[str]:
    """Sentences on what a target does not hold of the motors.

    has_drives : whether it holds delay and envelope of position control
    """
    holds, bias = has_drives and model.drive is not None, (model.drive or model.calibration).bias
    gain = 1.0 if model.drive else model.calibration.gain
    units = " or ".join(dict.fromkeys(model.torque_units))
    left = {
        f"gain ({listed(gain)})": np.any(np.not_equal(gain, 1.0)),
        f"constant torque ({listed(bias)} {units})": np.any(bias),
        f"delay of {1e3 * model.delay:.3g} ms": model.delay != 0 and (model.delay < 0 or not holds),
        "torque-speed envelope": not holds and any(map(model.envelope, range(len(model.joints)))),
    }
    return [f"{target} holds no {name} of the motors: it is left" for name in left if left[name]]


TABLE_USE = (
    "interpolate torque over velocity, joint by joint; add it to the motor torque (a joint without "
    "motor needs none)"
)


def lost_in_table(model: ExportedFriction, off: float) -> tuple[str, ...]:
    """Sentences on what a table of torque over velocity loses, which is so far off [N m]."""
    lost = [f"between its velocities the table is straight: at most {off:.2g} off steady sliding"]
    if model.friction.law.has_memory:
        lost.append("a table has no memory: it holds steady sliding at each velocity")
    if missing := [_MORE[x] for x in model.programs.inputs if x in _MORE]:
        lost.append(f"a table of velocities holds friction at zero of {' and '.join(missing)}")
    return tuple(lost)


def gains_of(recording: Recording) -> tuple[tuple[float, ...], ...]:
    """What makes the gains of a servo: none of a torque, nor of a supply that is measured."""
    servo = recording.servo
    if servo is None:
        return ()
    supply = 0.0 if isinstance(servo.supply, Signal) else servo.supply
    numbers = (servo.gain, servo.damping, servo.limit, np.nan_to_num(supply))
    return tuple(tuple(np.ravel(x).tolist()) for x in numbers)


def whose_gains(model: ExportedFriction) -> tuple[str, ...]:
    """A sentence on whose gains are written, where recordings differ in them."""
    recordings = () if model.data is None or model.drive is None else model.data.recordings
    if len({gains_of(r) for r in recordings}) < 2:
        return ()
    return (f"recordings differ in their gains: those of {recordings[0].name} are written",)


def changed(model: ExportedFriction, recording: Recording) -> list[str]:
    """Names of the mechanism's parameters that a recording has otherwise, such as a payload."""
    stated = {} if model.mechanism is None else model.mechanism.nominal()
    return [name for name, value in recording.parameters.items() if stated.get(name) != value]


_MOST = 200  # rollouts: more say no more of a median


class Replay(NamedTuple):
    """Predictions by what a target holds, beside the model's, on recorded motion.

    model, held : median error at the horizon of the model's predictions, and of the target's, in
        `unit`
    apart, mean_apart : median and mean distance of the two, whose mean a joint that just misses
        upright rules
    predictions : their number, from states that a filter estimates
    at_once : mean distance without the file's delay, None where it has none
    torque : (n,) RMS difference of the torques along the motion [N m or N], of a friction
    engine : name and version of what predicted, of a file
    """

    model: float
    held: float
    apart: float
    mean_apart: float
    unit: str
    predictions: int
    torque: tuple[float, ...] = ()
    engine: str = ""
    at_once: float | None = None


def replayed(model: ExportedFriction, initial: InitialStates, held: Array) -> Replay:
    """A target's predictions (S, n) at the horizon, beside the model's from the same states."""
    data = model.prepared
    assert data is not None
    ours = predictions(model, model.friction, initial)
    measured, units = at_horizon(initial.measured, initial), data.position_units
    sizes = joint_sizes(units, data.initial_states.measured)
    pairs = ((ours, measured), (held, measured), (ours, held))
    norms = [norm_of(a - b, units, sizes) for a, b in pairs]
    # a motion that has diverged is far away, no number that is left out
    errors = [np.nan_to_num(error, nan=np.inf) for error, _ in norms]
    first, second, apart = (float(np.median(error)) for error in errors)
    return Replay(first, second, apart, float(errors[-1].mean()), norms[0][1], len(measured))


def predictions(model: ExportedFriction, friction: Friction, initial: InitialStates) -> Array:
    """Angles (S, n) at the horizon, by a friction with the model's machine."""
    assert model.prepared is not None
    plant = model.prepared.plant[initial.recording]
    copies = np.zeros(len(initial.q), dtype=int)
    return at_horizon(predict(plant, friction[None][copies], initial).q, initial)


def cost_of(model: ExportedFriction, held: Friction, *, has_backlash: bool = True) -> Replay:
    """Cost of a friction in place of the model's, on the motion of its data.

    has_backlash : whether its target has the model's

    Raises
    ------
    InputError
        Where no recording holds a prediction so long.
    """
    data = model.prepared
    assert data is not None
    torques = [along(friction, data.integral.nodes) for friction in (model.friction, held)]
    apart = rms(torques[0] - torques[1], 0)
    initial = reaching(data.initial_states)
    theirs = initial
    if not has_backlash:  # encoders at the joints
        servos = {id(s): replace(s, backlash=0.0) for s in initial.servos}
        tight = tuple(servos[id(s)] for s in initial.servos)
        theirs = initial._replace(servos=tight, play=None)
    replay = replayed(model, initial, predictions(model, held, theirs))
    return replay._replace(torque=tuple(map(float, apart)))


def reaching(initial: InitialStates) -> InitialStates:
    """Initial states that reach the horizon, at most 200, evenly."""
    rows = np.flatnonzero(initial.last[-1] > 0)
    if len(rows) > _MOST:
        rows = rows[np.linspace(0, len(rows) - 1, _MOST).astype(int)]
    return initial.take(rows)


def at_horizon(q: Array, initial: InitialStates) -> Array:
    """Angles (S, n) at the horizon, of series (T + 1, S, n)."""
    return q[initial.last[-1], np.arange(q.shape[1])]


def cost_sentence(exported: ExportedFriction, cost: Replay) -> str:
    """The cost in words.

    >>> from frictionid.deploy.export.exported import exported
    >>> from frictionid.friction.laws import NoFriction
    >>> model = exported(Friction(NoFriction(), np.zeros((1, 0))), ["hip"])
    >>> cost_sentence(model, Replay(0.05, 0.06, 0.02, 0.03, "rad", 40, (0.01,)))
    "on the data's motion its torques are 0.01 N m off (RMS of hip); 1 s ahead its predictions err \
by 0.06 rad where the model's err by 0.05, 0.02 from these (medians of 40)"
    """
    torques = (
        f"{v if v > 1e-9 else 0.0:.3g} {unit}"
        for v, unit in zip(cost.torque, exported.torque_units, strict=True)
    )
    return (
        f"on the data's motion its torques are {', '.join(torques)} off "
        f"(RMS of {', '.join(exported.joints)}); {exported.horizon:g} s ahead its predictions err "
        f"by {cost.held:.3g} {cost.unit} where the model's err by {cost.model:.3g}, "
        f"{cost.apart:.3g} from these (medians of {cost.predictions})"
    )
