"""Errors of the nominal mechanism, and which of them the data single out.

Torque gains, zeros of angles, rotors, base parameters, and friction that grows with the motor's
torque: each is fitted without the others, with the friction of each joint free; zeros and gains
also together. Every such suspect has rivals that no column describes: a disturbance, an unmodelled
load, and the errors of the motion. One is named where it leaves little, not where it removes much.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from frictionid.arrays import Array
from frictionid.fitting.one_step.balances import Rows
from frictionid.mechanics import Plant
from frictionid.mechanics.plant import base_by_rotors

from .conventions import rows_under
from .findings import Finding, finding, sentence
from .hypotheses import Convention
from .motion import WIDTH, Measured
from .partial_regression import MODEL, PartialRegression, partial_regression
from .regression import unit_columns
from .servos import servos_of

# Nominal numbers are rarely better than this share; friction that grows with torque shows from it.
LARGE, LOADED = 0.1, 0.08
# Of what a wrong zero counts as a share [rad]: few are known better than a tenth of it. Its column
# is a difference over a step [rad], of which rounding leaves less than a share.
ZERO, STEP, ROUNDING = np.radians(10), 0.01, 1e-6
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
# Zeros and gains, at most MOST, are off together where they leave this share of other causes'.
# Free masses and rotors leave no less than the share FAR of what a true gain of all leaves.
ALL, TOGETHER, MOST, FAR = "gain of all torques", 0.8, 3, 0.1
# A misfit below this many times what errors of the motion make is theirs.
NOISE = 1.5
USUAL = 0.03  # of the terms: what any machine's balance leaves
# Unknown friction and simple errors leave at most this share (real machines: 0.03 to 0.08).
MISFIT = 0.1
# The same in one recording, whose squares are this many times those of the others; from fewer
# times, the others are tested without it.
LOCAL, MUCH_WORSE, WORSE = 0.05, 4.0, 2.0
_SERVO = "; torque is computed from gains: a wrong position gain may be the cause, too"


class ModelError(NamedTuple):
    """A change that would correct the nominal mechanism, or its friction.

    kind, words ; size and error in `unit`; share: relative to the nominal value (gain - 1, or the
    largest change of a base parameter), of a zero to `ZERO`; left: sum of squares over the one
    without any change; left_in_row: the same in the balance of the joint that it changes most;
    beside: words of other errors that it goes together with
    """

    kind: str
    words: str
    size: float
    error: float
    unit: str
    share: float
    left: float
    left_in_row: float = 1.0
    beside: tuple[str, ...] = ()


class _Suspect(NamedTuple):
    """An error to test: column (K, n) [N m per unit] of the balances, relative size of a unit."""

    kind: str
    words: str
    column: Array
    unit: str
    share: float


def model_errors(
    measured: Measured, rows: Rows, torque: Array, fit: PartialRegression, free: float = 1.0
) -> tuple[ModelError, ...]:
    """All errors, the one that explains most first.

    rows : of unit vectors ; torque (K, n) [N m] ; fit : of them, with the friction of each joint
    free ; free : share of the squares that free base parameters leave
    """
    target = torque - rows.required(measured.nominal)
    suspects = list(_suspects(measured, rows, torque))
    each = [error for s in suspects for error in _estimated(fit, target, s)]
    each = sorted((e for e in each if np.isfinite(e.error)), key=lambda e: e.left)
    each = [e for e in each if e.words != ALL or free > FAR * e.left]
    several = _together(fit, target, suspects)
    if several and several[0].left <= min(SINGLED_OUT, TOGETHER * min(each[0].left, free)):
        names = {e.words for e in several}
        each = [*several, *(e for e in each if e.words not in names)]
    return tuple(each)


def _together(
    fit: PartialRegression, target: Array, suspects: Sequence[_Suspect]
) -> list[ModelError]:
    """Wrong zeros and gains, each beside the others: those that show, if several do."""
    tested = [s for s in suspects if s.kind == "zero" or (s.kind == "gain" and s.words != ALL)]
    while len(tested) > 1:
        errors = list(_estimated(fit, target, *tested))
        clear = [_clearness(e) for e in errors]
        if min(clear) >= 1.0:
            return errors if len(errors) <= MOST else []
        del tested[int(np.argmin(clear))]
    return []


def _estimated(fit: PartialRegression, target: Array, *suspects: _Suspect) -> Iterator[ModelError]:
    """Errors fitted together to the torques (K, n) [N m] that the mechanism does not need."""
    sizes, errors, squares = fit.estimate(target, *(s.column for s in suspects))
    left = squares / max(float(np.sum(fit.residual(target) ** 2)), 1e-300)
    for s, size, error in zip(suspects, sizes.tolist(), errors.tolist(), strict=True):
        in_row = fit.left_in_row(target, s.column, size) if s.kind in ("gain", "rotor") else 1.0
        share = s.share * size
        if s.kind == "gain":  # the joint feels 1 - c of what is logged
            size, share = 1 - size, -share
        beside = tuple(other.words for other in suspects if other is not s)
        yield ModelError(s.kind, s.words, size, error, s.unit, share, left, in_row, beside)


def _suspects(measured: Measured, rows: Rows, torque: Array) -> Iterator[_Suspect]:
    plant, mechanism, nominal = measured.plant, measured.mechanism, measured.nominal[0]
    motors = np.flatnonzero(mechanism.driven).tolist()
    units = {p.name: p.unit for p in mechanism.parameters}
    if len(motors) > 1:
        yield _Suspect("gain", ALL, torque, "", 1.0)
    eye = np.eye(torque.shape[1])
    for j in motors:
        yield _Suspect("gain", f"gain of torque {j + 1}", torque * eye[j], "", 1.0)
    growing = np.abs(torque) * rows.friction[..., 0]  # times the mean of sgn(w)
    for j in motors:
        words = f"the friction of joint {j + 1} grows with its torque"
        yield _Suspect("load", words, growing * eye[j], "", 1.0)
    for j, slope in _zeros(measured, rows.required(measured.nominal)):
        yield _Suspect("zero", f"the zero of angle {j + 1}", slope, "rad", 1 / ZERO)
    for name, change in _rotors(plant).items():
        share = float(np.max(np.abs(change) / np.maximum(np.abs(nominal), 1e-12)))
        words, column = f"rotor inertia missing ({name})", rows.regressor @ change
        yield _Suspect("rotor", words, column, units[name], share)
    for i, (name, unit) in enumerate(zip(mechanism.base_names, mechanism.base_units, strict=True)):
        if nominal[i]:
            yield _Suspect("base", name, rows.regressor[..., i], unit, 1 / abs(float(nominal[i])))


def _zeros(measured: Measured, required: Array) -> Iterator[tuple[int, Array]]:
    """Angles (from 0) that the torque depends on, and its change (K, n) [N m/rad] by their zeros.

    required (K, n) [N m] : with the zeros as they are
    """
    eye = np.eye(measured.mechanism.n)
    turning = [j for j, unit in enumerate(measured.mechanism.position_units) if unit == "rad"]
    maps = [Convention("zero", "", eye, eye, shift=-STEP * eye[j]) for j in turning]
    for j, rows in zip(turning, rows_under(measured, maps), strict=True):
        change = rows.regressor[..., 0] - required
        if np.abs(change).max() > ROUNDING * np.abs(required).max():
            yield j, change / STEP


def _rotors(plant: Plant) -> dict[str, Array]:
    """Change (nb,) of the base parameters by each rotor, of the first recording."""
    parameters = {name: float(value[0]) for name, value in plant.parameters.items()}
    return base_by_rotors(plant.mechanism, parameters)


def missing_rotors(
    measured: Measured, rows: Rows, late: float = 0.0
) -> tuple[Array, Finding] | None:
    """Change (nb,) of base parameters by rotors that nobody has given, and what to give; or None.

    Where they explain much of the balance; that is no fault of the mechanism.

    All of an arm at once, none negative: one of them alone may look like a wrong gain or mass. A
    machine's only rotor is one of the `model_errors`. The torque is `late` [s].
    """
    plant, nominal = measured.plant, measured.nominal
    rotors = {n: x for n, x in _rotors(plant).items() if not plant.parameters[n].any()}
    torque = rows.means(measured.torque, late)
    if len(rotors) < 2 or not torque.any():
        return None
    changes = np.stack(list(rotors.values()))
    fit = partial_regression(rows, torque, nominal)
    target = fit.residual(torque - rows.required(nominal))
    columns = np.stack([fit.residual(rows.regressor @ change) for change in changes], axis=-1)
    columns, size = unit_columns(columns)
    scaled, distance = nnls(columns, target)
    value = scaled / size
    without = float(target @ target)
    share = MODEL * float(np.sqrt(without / max(len(target), 1)))
    left = distance**2 / max(without, 1e-300)
    if share < USUAL or 1 - left < EXPLAINS:
        return None
    pairs = zip(rotors, value.tolist(), strict=True)
    units = {p.name: p.unit for p in plant.mechanism.parameters}
    values = ", ".join(f"{name} = {x:.2g} {units[name]}" for name, x in pairs if x > 0)
    words = {"values": values, "removed": 1 - left}
    return value @ changes, finding("rotors", {"left": left}, words)


class Misfit(NamedTuple):
    """What the nominal mechanism leaves, whatever the friction.

    share : RMS over the terms of the balance ; noise : that which errors of the motion make ;
    errors : suspects, the one that leaves least first ; free : share of the squares that free base
    parameters leave ; where, there : recording that it is much worse in than in the others, and the
    share in it; "" and `share` where there is none ; rival : another cause, in words, that no
    column tells from these ; odd : number of a recording that it is worse in, by more than noise
    """

    share: float
    noise: float
    errors: tuple[ModelError, ...]
    free: float
    where: str
    there: float
    rival: str
    odd: frozenset[int]


def misfit(measured: Measured, rows: Rows, torque: Array) -> Misfit:
    """The misfit of the nominal mechanism; rows of unit vectors, torque (K, n) [N m]."""
    nominal = measured.nominal
    fit = partial_regression(rows, torque, nominal)
    left = fit.residual(torque - rows.required(nominal))
    count = max(len(left), 1)
    each = fit.weight * measured.momentum_noise / WIDTH
    moving = rows.moving.sum(0) / max(int(rows.moving.sum()), 1)
    number = np.broadcast_to(rows.recording[:, None], rows.moving.shape)[rows.moving]
    share = MODEL * float(np.sqrt(left @ left / count))
    free = _free_share(left, rows, torque, nominal, fit)
    noise = MODEL * float(np.sqrt(np.sum(moving * each**2)))
    i, there, ratio = _worst(left, number, len(measured.motions))
    much = ratio > MUCH_WORSE
    return Misfit(
        share,
        noise,
        model_errors(measured, rows, torque, fit, free),
        free,
        measured.dataset.recordings[i].name if much else "",
        there if much else share,
        _SERVO if servos_of(measured.dataset) else "",
        frozenset({i} if ratio > WORSE and there > NOISE * noise else ()),
    )


def _worst(left: Array, number: Array, count: int) -> tuple[int, float, float]:
    """Recording that leaves most, its share, and its squares over those of the others together."""
    squares = np.bincount(number, left**2, count)
    counts = np.bincount(number, minlength=count)
    each = squares / np.maximum(counts, 1)
    i = int(np.argmax(each))
    others = (squares.sum() - squares[i]) / max(counts.sum() - counts[i], 1)
    ratio = each[i] / max(others, 1e-300) if (counts > 0).sum() >= 3 else 0.0
    return i, MODEL * float(np.sqrt(each[i])), float(ratio)


def _free_share(
    target: Array, rows: Rows, torque: Array, nominal: Array, fit: PartialRegression
) -> float:
    """Sum of squares with all base parameters free, over that of the target, with nominal ones."""
    columns = fit.residual(np.moveaxis(rows.regressor, -1, 0)).T
    size = np.sqrt((columns**2).sum(0))
    if not torque.any():  # only ratios show: hold the largest
        size[np.argmax(size * np.abs(nominal[0]))] = 0.0
    columns = columns[:, size > 0] / size[size > 0]
    left = target - columns @ np.linalg.lstsq(columns, target, rcond=1e-7)[0]
    return float(left @ left) / max(float(target @ target), 1e-300)


def unlogged_torque(left: Misfit, torque: Array, driven: Sequence[bool]) -> list[Finding]:
    """A finding where motors are not logged: torques (K, n) that are zero, and a misfit."""
    motors = ", ".join(str(j + 1) for j in np.flatnonzero(driven))
    unknown = any(f.kind == "unknown_cause" for f in findings_of(left))
    if torque.any() or not motors or not unknown:
        return []
    return [finding("zero_torque", {"left": left.share, "noise": left.noise}, {"motors": motors})]


def constant_angle(left: Misfit, measured: Measured) -> list[Finding]:
    """A finding where an angle is constant throughout, and the other joints move as if it moved."""
    span = [np.ptp(r.angle.value, axis=0) for r in measured.dataset.recordings]
    still = np.flatnonzero(np.max(span, axis=0) == 0.0)
    if not len(still) or left.share < max(NOISE * left.noise, MISFIT):
        return []
    numbers = {"left": left.share, "noise": left.noise}
    return [finding("constant_angle", numbers, joint=int(still[0]) + 1)]


def findings_of(left: Misfit, coarse: bool = False) -> list[Finding]:
    """The finding that the misfit deserves: a cause, causes that look the same, or none known.

    coarse : whether samples are so far apart that they leave a misfit without any other cause
    """
    causes = _singled_out(left) or _wrong_gain(left)
    if causes:
        several = [_cause([error], left.rival) for error in causes if error.beside]
        return several or [_cause(causes, left.rival)]
    if left.share < max(NOISE * left.noise, USUAL) or not left.errors:
        return []
    suspect = _suspect(left)
    free = left.free <= 0.5
    if free and left.free <= SINGLED_OUT and left.free**0.5 * left.share < LOCAL:
        best = left.errors[0]
        single = sentence(best.kind, {**best._asdict(), "also": ""})
        rival = f"; or {single}" if best.left <= ALIKE * left.free else ""
        words = {"removed": 1 - left.free, "rival": f"{rival}{left.rival}"}
        return [finding("nominal_mechanism", {"left": left.free}, words)]
    # no friction and no usual error of a model would leave so much
    beyond = left.there > max(LOCAL if left.where else MISFIT, 3.0 * left.noise)
    if not coarse and (suspect is not None or free or beyond):
        return [_unknown(left, suspect)]
    return []


def _singled_out(left: Misfit) -> list[ModelError]:
    """The suspects that the data single out, those that they cannot tell apart side by side."""
    best = _suspect(left)
    if best is None:
        return []
    enough = (NOISE * left.noise / max(left.share, 1e-300)) ** 2
    if best.left > max(SINGLED_OUT, enough):
        return []
    return [e for e in _possible(left.errors) if e.left <= ALIKE * best.left]


def _wrong_gain(left: Misfit) -> list[ModelError]:
    """A gain that is far off and explains the balance of its joint, and a rotor that does too.

    In an arm the other joints' balances leave more than a wrong gear of one of them.
    """
    possible = [e for e in _possible(left.errors) if e.left_in_row <= SINGLED_OUT]
    gains = [e for e in possible if e.kind == "gain" and GAINS[0] < e.size < GAINS[1]]
    best = min(gains, key=lambda e: e.left, default=None)
    if best is None or abs(best.share) < max(WRONG, ERRORS * best.error):
        return []
    return [best, *(e for e in possible if e.kind == "rotor" and e.left <= ALIKE * best.left)]


def _suspect(left: Misfit) -> ModelError | None:
    """The suspect that leaves least, if it matters."""
    possible = _possible(left.errors)
    if not possible or 1 - possible[0].left < EXPLAINS:
        return None
    best = possible[0]
    if best.kind == "gain" and not GAINS[0] < best.size < GAINS[1]:
        return None
    return best if _clearness(best) >= 1.0 else None


def _clearness(error: ModelError) -> float:
    """How many times as large an error is as one that matters and shows."""
    matters = LOADED if error.kind == "load" else LARGE
    off = abs(error.size - (error.kind == "gain"))
    return min(abs(error.share) / matters, off / max(ERRORS * error.error, 1e-300))


def _possible(errors: Sequence[ModelError]) -> list[ModelError]:
    return [e for e in errors if e.kind not in ("rotor", "load") or e.size > 0]


def _cause(causes: list[ModelError], rival: str) -> Finding:
    best = causes[0]
    others = "; ".join(sentence(e.kind, {**e._asdict(), "also": ""}) for e in causes[1:3])
    tail = f" (equally likely by the data: {others})" if others else ""
    tail = f" (beside {' and '.join(best.beside)})" if best.beside else tail
    numbers = {"size": best.size, "error": best.error, "explains": 1 - best.left}
    # load-dependent friction is no fault of the data
    level = "good" if all(e.kind == "load" for e in causes) else ""
    also = tail if level else f"{rival}{tail}"
    return finding(best.kind, numbers, {**best._asdict(), "also": also}, level=level)


def _unknown(left: Misfit, suspect: ModelError | None) -> Finding:
    """Causes that no column singles out."""
    best = min(left.free, suspect.left if suspect else 1.0)
    where = f", {100 * left.there:.0f} % in {left.where!r}" if left.where else ""
    least = (
        f"; other numbers of the mechanism or the motor would remove {100 * (1 - best):.0f} % of "
        "its square at most"
        if best < 0.7
        else ""
    )
    numbers = {"left": left.share, "noise": left.noise}
    words = {"where": where, "least": least, "rival": left.rival}
    return finding("unknown_cause", numbers, words)
