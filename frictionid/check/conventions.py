"""Tests of conventions: signs, order of the joints, units and frames, and the unit of time.

Each hypothesis is a linear map of the angles and one of the torques that would correct the
recordings. Its score says how much of the torque the nominal mechanism then leaves unexplained,
whatever the friction. A sign changes some joints of an arm only, so that the sum over the joints
decides; the sign of a gear, which turns angle and torque, may show in terms that are small beside
friction, and the joint whose balance it changes most decides. A time that is f times too long makes
accelerations f^2 times too small and leaves gravity, friction and the torque as they are.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from frictionid.arrays import Array
from frictionid.fitting.one_step.balances import Rows, balances_of

from .findings import Finding, finding
from .hypotheses import (
    ABSOLUTE,
    NO_TORQUE,
    SHIFTED,
    TORQUE_UNITS,
    UNIT_OF_ONE,
    Convention,
    hypotheses,
    of_columns,
)
from .motion import Measured, characteristic_speeds
from .regression import unit_columns

_FEW = ("flipped", "shifted", "pair", "unit_of")  # kinds that change some joints of an arm only
_NOT = [f"not {name}" for name in TORQUE_UNITS]  # or too small
# A convention is rejected where another one leaves less than e^-MARGIN of the squared residual, and
# explains the data at all. Healthy simulations keep a distance of 2.4 and more.
MARGIN, EXPLAINS = 1.0, np.log(0.25)
# Two maps whose scores are closer than this cannot be distinguished, as mirror images.
ALIKE = 0.05
# Below this share of its terms a balance is good; smaller differences mean nothing.
FLOOR = 0.02
# A wrong zero leaves this share of some joint's at least: else none is sought.
_WRONG = 0.1
# A hypothesis that makes the mechanism's terms smaller than this share of the torque explains
# nothing: free friction alone would take all of it.
MATTERS = 0.3
_MUCH = MARGIN - 2.0 * np.log(MATTERS)  # by which a unit of torques explains more than no torque
# Samples of all maps together whose balances are made in one go.
_SAMPLES = 500_000
# A gear has the other sign where that leaves e^-GEAR of the squares of the joint that it changes
# most, in this many windows at least. (A real arm of six joints: 0.53 and more.)
GEAR, SHOWN = 0.4, 40


class Scored(NamedTuple):
    """A convention with its score, a mean over the joints: lower fits better.

    each (n,) : mean log of the squared share of each joint's torque that stays unexplained ;
    matters (n,) : whether the mechanism's terms matter beside that torque ; windows (n,) of motion
    """

    convention: Convention
    score: float
    each: Array
    matters: Array
    windows: Array

    @property
    def of_gears(self) -> bool:
        """Whether it turns angle and torque."""
        return self.convention.kind in ("flipped_joint", "flipped_gear")

    def advantage(self, other: "Scored") -> float:
        """By how much it fits better than the data as given; beyond MARGIN these are wrong."""
        if not self.convention.kind.startswith(_FEW):
            # what explains nothing counts as nothing
            ours, theirs = (np.where(s.matters, s.each, 0.0) for s in (self, other))
            return float((theirs - ours).mean())
        less = other.each - self.each
        total, most = float(less.sum()), int(np.argmax(np.abs(less)))
        if not self.of_gears or self.windows[most] < SHOWN:
            return total / min(len(less), 2)
        clear = min(float(less[most]), total) if less[most] > 0 else float(less[most])
        return max(total, MARGIN * clear / GEAR, key=abs)


def scores(measured: Measured) -> list[Scored]:
    """All conventions with their scores, the data as given first."""
    acting = measured.dataset.actuated.copy()
    acting[list(measured.dead)] = False
    units, gears = measured.mechanism.position_units, measured.dataset.gears
    first, *others = _all_scored(measured, list(hypotheses(acting, units, gears)))
    # to turn a joint that nothing else depends on is no fault
    kept = [
        s
        for s in _with_torque(others)
        if not (s.of_gears and np.allclose(s.each, first.each, rtol=0.0, atol=1e-6))
    ]
    if (first.each < 2 * np.log(_WRONG)).all():
        return [first, *kept]
    (none,) = [s for s in others if s.convention.kind == NO_TORQUE]
    columns = list(_of_columns(measured, first, none, acting)) if len(acting) > 2 else []
    return [first, *kept, *shifted(measured, first, kept), *columns]


def _of_columns(measured: Measured, first: Scored, none: Scored, acting: Array) -> Iterator[Scored]:
    """Conventions of single columns of an arm; units only where they explain much more."""
    wrong = np.flatnonzero((first.each > 2 * np.log(_WRONG)) | ~first.matters)
    maps = list(of_columns(wrong.tolist(), acting))
    for s in _all_scored(measured, [first.convention, *maps]):
        j = int(np.argmax(np.diag(s.convention.torque) != 1.0))
        rival = np.minimum(none.each, np.where(s.matters, np.inf, first.each))[j]
        holds = s.each[j] < 2 * np.log(_WRONG) and rival - s.each[j] > _MUCH
        if s.convention.kind != UNIT_OF_ONE or holds:
            yield s


def _with_torque(scored: Sequence[Scored]) -> list[Scored]:
    """Conventions without units of torque that explain no more than no torque does.

    A wrong torque may be made small, or so large that friction takes it up: as large as `MATTERS`
    allows, which makes what is left a smaller share.
    """
    (none,) = [s for s in scored if s.convention.kind == NO_TORQUE]
    units = [*TORQUE_UNITS, *_NOT]
    return [
        s
        for s in scored
        if s is not none and (s.convention.kind not in units or (none.each - s.each).max() > _MUCH)
    ]


def _all_scored(measured: Measured, candidates: Sequence[Convention]) -> Iterator[Scored]:
    """Conventions with their scores; those of one map of the angles share its rows."""
    maps = {_key(c): c for c in candidates}
    rows = dict(zip(maps, rows_under(measured, list(maps.values())), strict=True))
    torque = next(iter(rows.values())).means(measured.torque)
    yield from (scored(c, rows[_key(c)], torque @ c.torque.T) for c in candidates)


def shifted(measured: Measured, first: Scored, others: Sequence[Scored]) -> Iterator[Scored]:
    """Wrong zeros of the angles, by quarter turns, as given and beside other signs or frames.

    An encoder's is anywhere, that of a pendulum that is balanced upright. One joint, or else one
    link, is turned after the other, as long as that leaves less.
    """
    signs = [s for s in others if s.of_gears]
    best = [min(signs, key=lambda s: s.score)] if signs else []
    frames = [s for s in others if s.convention.kind == ABSOLUTE]
    for start in (first, *best, *frames):
        end = _quarter_turns(measured, start)
        if end is not start:
            yield end


def _quarter_turns(measured: Measured, start: Scored) -> Scored:
    """The convention with those quarter turns of zeros that leave least, one after the other."""
    turns = np.flatnonzero([unit == "rad" for unit in measured.mechanism.position_units])
    joints = np.eye(measured.mechanism.n)[turns]
    # opposite turns of neighbours leave what the second one carries where it is
    links = joints[:-1] - joints[1:]
    best = start
    for _ in turns:
        for axes in (joints, links):
            tried = [
                _shifted(start.convention, best.convention.shift + quarter * np.pi / 2 * axis)
                for axis in axes
                for quarter in (-1, 1, 2)
            ]
            others = _all_scored(measured, tried) if tried else ()
            leaves = min(others, key=lambda s: float(s.each.sum()), default=best)
            if float((best.each - leaves.each).sum()) > ALIKE:
                best = leaves
                break
        else:
            return best
    return best


def _shifted(convention: Convention, shift: Array) -> Convention:
    """A convention whose angles are shifted as well."""
    degrees = np.round(np.degrees((shift + np.pi) % (2 * np.pi) - np.pi))
    degrees = np.where(degrees == -180, 180, degrees).astype(int)
    off = [f"{d:+d} degrees to angle {j + 1}" for j, d in enumerate(degrees.tolist()) if d]
    also = "" if convention.kind == "as_given" else f"{convention.words}, and "
    words = f"{also}the angles have another zero than the mechanism: add {', '.join(off)}"
    return convention._replace(kind=SHIFTED, words=words, shift=np.radians(degrees))


def scored(convention: Convention, rows: Rows, torque: Array) -> Scored:
    """A convention with its score; rows (K windows) and torque (K, n) [N m] as it corrects them."""
    each, matters = unexplained_shares(rows, torque)
    counts = convention.kind.startswith(("as_given", *_FEW)) | matters
    score = float(np.where(counts, each, 0.0).mean())
    return Scored(convention, score, each, matters, rows.moving.sum(0))


def _key(convention: Convention) -> tuple[bytes, bytes]:
    """Key of a convention's map of the angles."""
    return convention.angle.tobytes(), convention.offset.tobytes()


def rows_under(measured: Measured, maps: Sequence[Convention]) -> Iterator[Rows]:
    """Rows at the nominal parameters under each map, as many maps at once as memory allows."""
    mechanism, acts = measured.mechanism, measured.mechanism.friction_map
    whole, windows = measured.balances.samples, measured.windows
    noise = np.array([motion.velocity_noise for motion in measured.motions])
    count = max(_SAMPLES // len(whole.time), 1)
    for first in range(0, len(maps), count):
        part = maps[first : first + count]
        turn = np.swapaxes(np.array([c.angle for c in part]), 1, 2)
        offset = np.array([c.offset for c in part])
        q, w = whole.q @ turn + offset[:, None], whole.w @ turn
        scatter = np.sqrt(noise**2 @ turn**2 @ acts.T**2)
        speeds = characteristic_speeds(w @ acts.T, scatter)
        samples = whole._replace(q=q, w=w)
        for balances in balances_of(mechanism, samples, measured.nominal, *speeds).each():
            yield balances.rows(windows).without(measured.dead)


def log_unexplained(rows: Rows, torque: Array) -> float:
    """Mean log of the squared share of each joint's torque that stays unexplained.

    Mechanism and torque are given; friction may be anything of the shapes in `rows` that opposes
    motion (non-negative least squares). What remains, over the sum of squares of the terms of the
    balance, lies between 0 and about 1 whatever the units of a hypothesis. 0 where nothing fits,
    and where the mechanism's terms hardly matter.

    Parameters
    ----------
    rows : Rows, K windows, with the nominal parameters as first vector
    torque : array, shape (K, n) [N m]
    """
    each, matters = unexplained_shares(rows, torque)
    return float(np.where(matters, each, 0.0).mean())


def unexplained_shares(rows: Rows, torque: Array) -> tuple[Array, Array]:
    """What `log_unexplained` says of each joint (n,), and whether its terms matter (n,)."""
    inertia, gravity = rows.inertia[..., 0], rows.gravity[..., 0]
    out, matters = np.zeros(torque.shape[1]), np.zeros(torque.shape[1], dtype=bool)
    for j in range(len(out)):
        use = rows.moving[:, j]
        if use.sum() < 10:
            continue
        terms = np.stack([inertia[use, j], gravity[use, j], torque[use, j]])
        varying = terms.var(axis=1)  # friction's offset takes what is constant
        matters[j] = varying[:2].sum() >= MATTERS**2 * varying[2]
        target = terms[2] - terms[0] - terms[1]
        left = _residual_squares(rows.shapes(j)[use], target)
        out[j] = np.log(left / max(use.sum() * varying.sum(), 1e-300) + FLOOR**2)
    return out, matters


def _residual_squares(shapes: Array, target: Array) -> float:
    """Sum of squares that no friction opposing the motion explains."""
    columns = np.column_stack([shapes, -shapes[:, 2]])  # an offset may have either sign
    return float(nnls(unit_columns(columns)[0], target)[1] ** 2)


def better(scored: list[Scored], first: Scored) -> list[Scored]:
    """Conventions that fit clearly better than the data as given, equivalent ones together."""
    fitting = [s for s in scored if s.score < EXPLAINS and s.advantage(first) > MARGIN]
    best = min((s.score for s in fitting), default=0.0)
    alike = [s for s in fitting if s.score < best + ALIKE]
    return sorted(alike, key=lambda s: _order(s.convention))


def _order(convention: Convention) -> float:
    """Size of the maps: a change of one column comes before one of several."""
    eye = np.eye(len(convention.angle))
    return float(sum(np.abs(map_ - eye).sum() for map_ in (convention.angle, convention.torque)))


def convention_findings(fitting: Sequence[Scored], first: Scored) -> Iterator[Finding]:
    """A finding with the conventions that fit better, see `better`."""
    if not fitting:
        return
    best, *others = fitting
    names = [s.convention.words for s in others if s.convention.kind != "as_given"]
    also = f" (or, equivalently: {'; '.join(names)})" if names else ""
    # beside friction the mechanism's terms are small: a wrong ratio may look like a wrong sign
    weak = first.score - best.score < MARGIN and best.of_gears
    turns = np.linalg.inv(best.convention.angle)
    shift = np.broadcast_to(best.convention.shift, len(turns))
    zeros = ", ".join(f"{radians:.4f}" for radians in shift)
    also += ", or its ratio or coupling is wrong" if weak else ""
    straight = np.array_equal(turns, np.eye(len(turns)))
    coupling = f'angle = "motor" and coupling = {turns.astype(int).tolist()}'
    frame = "" if straight else f"write {coupling} where the columns are of the joints; "
    yield finding(
        "frame" if best.convention.kind in (SHIFTED, ABSOLUTE) else "convention",
        {"score": best.score, "given": first.score},
        {"convention": best.convention.words, "also": also, "zeros": zeros, "frame": frame},
        level="doubtful" if weak else "",
        kind=best.convention.kind,
    )


def conventions_of_recordings(measured: Measured) -> dict[int, Finding]:
    """A finding for each recording that clearly follows another convention than the rest."""
    every = set(range(len(measured.motions)))
    each = {i: convention_of_recording(measured.without(every - {i})) for i in every}
    odd = {i: said for i, said in each.items() if said is not None}
    return odd if len(odd) < len(every) else {}


def convention_of_recording(single: Measured) -> Finding | None:
    """A finding where one recording clearly follows another convention."""
    first, *others = scores(single)
    fitting = better(others, first)
    if not fitting or first.score - fitting[0].score <= MARGIN:
        return None
    words = {
        "recording": single.dataset.recordings[0].name,
        "convention": ", or ".join(s.convention.words for s in fitting),
    }
    values = {"score": fitting[0].score, "given": first.score}
    return finding("convention_of_recording", values, words)
