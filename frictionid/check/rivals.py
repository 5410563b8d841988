"""Which explanation of a misfit the data single out, and which they cannot tell apart.

Every suspect (a gain, a rotor, a base parameter, friction that grows with the torque) has rivals
that no column describes: a disturbance, an unmodelled load, several errors at once, and the errors
of the motion itself. A suspect is named where it leaves little, not where it removes something.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding, percent
from frictionid.check.model_errors import ModelError, model_errors
from frictionid.check.motion import WIDTH, Measured
from frictionid.check.partial_regression import MODEL, PartialRegression, partial_regression
from frictionid.fitting.one_step.balances import Rows

# Nominal numbers of real machines are rarely better than this share; friction that grows with the
# torque shows from this share of it.
LARGE, LOADED = 0.1, 0.08
# Another gear or torque constant stays within these factors; beyond them something else is wrong.
GAINS = (0.2, 5.0)
# A gain that its own joint alone shows is off by this much: a nominal inertia may be off by less.
WRONG = 0.25
# A suspect matters where it removes this share of the sum of squares, and is this many standard
# errors from nothing.
EXPLAINS, ERRORS = 0.3, 4.0
# It is singled out where it leaves at most this share of the squares, or only errors of the motion
# (disturbances leave 0.55 and more to the best suspect).
SINGLED_OUT = 0.35
# Others are named beside it that leave less than this much more than it.
ALIKE = 1.1
# A misfit below this many times what errors of the motion make is theirs.
NOISE = 1.5
# Share of the terms that any machine's balance leaves.
USUAL = 0.03
# Share of the terms that unknown friction and simple errors leave at most: beyond it, something is
# wrong in any case (real machines: 0.03 to 0.08).
MISFIT = 0.1
# The same in one recording, where it is more than twice that of the others.
LOCAL = 0.05

# Findings beside which an estimate is only right if nothing else is wrong.
RIVALS = frozenset({"load", "unknown_cause", "zero_torque", "constant_angle"})


class Misfit(NamedTuple):
    """What the nominal mechanism leaves, whatever the friction.

    share : RMS over the terms of the balance ; noise : that which errors of the motion make ;
    errors : suspects, the one that leaves least first ; free : share of the squares that free base
    parameters leave ; where, there : recording that it is much worse in than in the others, and the
    share in it; "" and `share` where there is none
    """

    share: float
    noise: float
    errors: tuple[ModelError, ...]
    free: float
    where: str
    there: float


def misfit(measured: Measured, rows: Rows, torque: Array) -> Misfit:
    """The misfit of the nominal mechanism; rows of unit vectors, torque (K, n) [N m]."""
    nominal = measured.nominal
    fit = partial_regression(rows, torque, nominal)
    left = fit.residual(torque - rows.required(nominal))
    count = max(len(left), 1)
    rest = np.zeros((1, measured.mechanism.n))
    inertia = np.abs(np.diagonal(measured.mechanism.dynamics(nominal[0], rest, rest)[0][0]))
    velocity = np.median([m.velocity_noise for m in measured.motions], axis=0)
    noise = fit.weight * inertia * velocity * np.sqrt(2.0) / WIDTH
    moving = rows.moving.sum(0) / max(int(rows.moving.sum()), 1)
    number = np.broadcast_to(rows.recording[:, None], rows.moving.shape)[rows.moving]
    return Misfit(
        MODEL * float(np.sqrt(left @ left / count)),
        MODEL * float(np.sqrt(np.sum(moving * noise**2))),
        model_errors(measured.plant, rows, torque, fit),
        free_share(rows, torque, nominal, fit),
        *_worst(measured, left, number),
    )


def _worst(measured: Measured, left: Array, number: Array) -> tuple[str, float]:
    """Recording whose residual is more than twice that of the others together, and its share."""
    squares = np.bincount(number, left**2, len(measured.motions))
    counts = np.bincount(number, minlength=len(measured.motions))
    if (counts > 0).sum() < 3:
        return "", MODEL * float(np.sqrt(left @ left / max(len(left), 1)))
    each = squares / np.maximum(counts, 1)
    i = int(np.argmax(each))
    others = (squares.sum() - squares[i]) / max(counts.sum() - counts[i], 1)
    alone = bool(each[i] > 4.0 * others)
    name = measured.dataset.recordings[i].name if alone else ""
    return name, MODEL * float(np.sqrt(each[i] if alone else squares.sum() / counts.sum()))


def free_share(rows: Rows, torque: Array, nominal: Array, fit: PartialRegression) -> float:
    """Sum of squares with all base parameters free, over the one with the nominal ones."""
    target = fit.residual(torque - rows.required(nominal))
    columns = fit.residual(np.moveaxis(rows.regressor, -1, 0)).T
    size = np.sqrt((columns**2).sum(0))
    if not np.abs(torque).any():  # only ratios show: hold the largest
        size[np.argmax(size * np.abs(nominal[0]))] = 0.0
    columns = columns[:, size > 0] / size[size > 0]
    left = target - columns @ np.linalg.lstsq(columns, target, rcond=1e-7)[0]
    return float(left @ left) / max(float(target @ target), 1e-300)


def unlogged_torque(found: Misfit, torque: Array, driven: Sequence[bool]) -> list[Finding]:
    """A finding where motors are not logged: torques (K, n) that are zero, and a misfit."""
    joints = [j + 1 for j, is_driven in enumerate(driven) if is_driven]
    unknown = any(f.kind == "unknown_cause" for f in findings_of(found))
    if np.abs(torque).any() or not joints or not unknown:
        return []
    return [
        Finding(
            "zero_torque",
            "doubtful",
            f"the torque of all motors ({', '.join(map(str, joints))}) is logged as zero, and "
            f"{percent(found.share)} of the balance stays unexplained, whatever the friction: the "
            "machine moves as if something drove it",
            "log the torque (the motor's current times its constant); where no motor acted, look "
            "for what else did, or keep the free decays alone",
            None,
            {"left": found.share, "noise": found.noise},
        )
    ]


def constant_angle(found: Misfit, measured: Measured) -> list[Finding]:
    """A finding where an angle is constant throughout, and the other joints move as if it moved."""
    span = [np.ptp(r.angle.value, axis=0) for r in measured.dataset.recordings]
    still = np.flatnonzero(np.max(span, axis=0) == 0.0)
    if not len(still) or found.share < max(NOISE * found.noise, MISFIT):
        return []
    j = int(still[0])
    return [
        Finding(
            "constant_angle",
            "doubtful",
            f"angle {j + 1} changes in no recording, and {percent(found.share)} of the balance of "
            "the other joints stays unexplained, whatever the friction: they move as if this joint "
            "moved",
            "check its sensor and its column; where the joint is locked, describe a mechanism "
            "without it",
            j + 1,
            {"left": found.share, "noise": found.noise},
        )
    ]


def findings_of(found: Misfit, coarse: bool = False) -> list[Finding]:
    """The finding that the misfit deserves: a cause, causes that look the same, or none known.

    coarse : whether samples are so far apart that they leave a misfit without any other cause
    """
    named = singled_out(found) or _wrong_gain(found)
    if named:
        return [_cause(named)]
    if found.share < max(NOISE * found.noise, USUAL) or not found.errors:
        return []
    suspect = _suspect(found)
    free = found.free <= 0.5
    if free and found.free <= SINGLED_OUT and found.free**0.5 * found.share < LOCAL:
        return [_mechanism(found)]
    if not coarse and (suspect is not None or free or _beyond(found)):
        return [_unknown(found, suspect)]
    return []


def _beyond(found: Misfit) -> bool:
    """Whether no friction and no usual error of a model would leave so much."""
    least = LOCAL if found.where else MISFIT
    return found.there > max(least, 3.0 * found.noise)


def singled_out(found: Misfit) -> list[ModelError]:
    """The suspects that the data single out, those that they cannot tell apart side by side."""
    best = _suspect(found)
    if best is None:
        return []
    enough = (NOISE * found.noise / max(found.share, 1e-300)) ** 2
    if best.left > max(SINGLED_OUT, enough):
        return []
    return [e for e in _possible(found.errors) if e.left <= ALIKE * best.left]


def _wrong_gain(found: Misfit) -> list[ModelError]:
    """A gain that is far off and explains the balance of its own joint, and a rotor that does too.

    In an arm the other joints' balances leave more than a wrong gear of one of them.
    """
    own = [e for e in _possible(found.errors) if e.own <= SINGLED_OUT]
    gains = [e for e in own if e.kind == "gain" and GAINS[0] < e.size < GAINS[1]]
    best = min(gains, key=lambda e: e.left, default=None)
    if best is None or abs(best.share) < max(WRONG, ERRORS * best.error):
        return []
    rotors = [e for e in own if e.kind == "rotor" and e.left <= ALIKE * best.left]
    return [best, *rotors]


def _suspect(found: Misfit) -> ModelError | None:
    """The suspect that leaves least, if it matters."""
    possible = _possible(found.errors)
    if not possible or 1 - possible[0].left < EXPLAINS:
        return None
    best = possible[0]
    if best.kind == "gain" and not GAINS[0] < best.size < GAINS[1]:
        return None
    if abs(best.share) < (LOADED if best.kind == "load" else LARGE):
        return None
    return best if abs(best.size - (best.kind == "gain")) >= ERRORS * best.error else None


def _possible(errors: Sequence[ModelError]) -> list[ModelError]:
    return [e for e in errors if e.kind not in ("rotor", "load") or e.size > 0]


REMEDIES = {
    "gain": "check gear ratio, torque constant and units; or all masses and inertias are wrong by "
    "this factor",
    "rotor": "add it to [mechanism.parameters], or fit the base parameters",
    "base": "correct [mechanism.parameters], or fit the base parameters",
    "load": "fit a law with load-dependent friction (motor_load, load_dependent)",
}


def _cause(named: list[ModelError]) -> Finding:
    best = named[0]
    also = "; ".join(_words(e) for e in named[1:3])
    tail = f" (equally likely by the data: {also})" if also else ""
    numbers = {"size": best.size, "error": best.error, "explains": 1 - best.left}
    # load-dependent friction is no fault of the data
    level = "good" if all(e.kind == "load" for e in named) else "doubtful"
    return Finding(best.kind, level, f"{_words(best)}{tail}", REMEDIES[best.kind], None, numbers)


def _words(e: ModelError) -> str:
    if e.kind == "gain":
        return f"{e.words} is {e.size:.3f} +- {e.error:.3f}, not 1: wrong gear or torque constant"
    if e.kind == "rotor":
        return f"{e.words}: {e.size:.3g} +- {e.error:.1g} {e.unit} beyond the nominal mechanism"
    if e.kind == "load":
        return f"{e.words}: by {e.size:.3f} +- {e.error:.3f} of it"
    return f"{e.words} is {100 * e.share:+.0f} % from its nominal value"


def _mechanism(found: Misfit) -> Finding:
    return Finding(
        "nominal_mechanism",
        "doubtful",
        "the nominal mechanism does not fit: its base parameters, if free, remove "
        f"{100 * (1 - found.free):.0f} % of the squared residual",
        "compare the estimates below with the nominal values, or fit the base parameters",
        None,
        {"left": found.free},
    )


def _unknown(found: Misfit, suspect: ModelError | None) -> Finding:
    """Causes that no column singles out."""
    best = min(found.free, suspect.left if suspect else 1.0)
    where = f", {100 * found.there:.0f} % in {found.where!r}" if found.where else ""
    least = (
        f"; other numbers of the mechanism or the motor would remove {100 * (1 - best):.0f} % of "
        "its square at most"
        if best < 0.7
        else ""
    )
    return Finding(
        "unknown_cause",
        "doubtful",
        f"{100 * found.share:.0f} % of the balance stays unexplained, whatever the friction{where}"
        f"{least}. A disturbance, an unmodelled load or several errors at once: the data cannot "
        "tell these apart",
        "record what else acts on the machine, or leave out the recordings in which it does",
        None,
        {"left": found.share, "noise": found.noise},
    )
