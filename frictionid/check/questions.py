"""Questions with their answers, what can be identified, and which recording to make next.

An answer is yes only where its test ran and could have failed; else no, or not tested and why.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .conventions import ALIKE, EXPLAINS, MARGIN, Scored
from .facts import JointFacts
from .findings import Finding, finding, percent, percent_unexplained
from .hypothesis_tests import UNUSABLE_DELAY, HypothesisTests
from .motion import MIN_WINDOWS, Measured, sliding_speeds
from .passive import energy_test, rest_tests
from .regression import Estimate, row_rms
from .torque_source import TorqueSource

# Findings beside which an estimate is only right if nothing else is wrong.
RIVALS = frozenset({"load", "unknown_cause", "exchanged_columns", "zero_torque", "constant_angle"})


class Question(NamedTuple):
    """A question to the data and its answer; `passed` is None where it could not be tested."""

    question: str
    passed: bool | None
    words: str


def questions(
    tests: HypothesisTests, estimate: Estimate, sources: Sequence[TorqueSource]
) -> list[Question]:
    """Questions in the order in which they are tested."""
    first = _measured(tests, sources)
    if not tests.done:
        return first
    energy, _ = energy_test(tests.measured)
    rest = [answer for answer, _ in rest_tests(tests, estimate)]
    return [
        *first,
        _conventions(tests.conventions),
        *_signs(tests),
        Question("energy falls without input", *energy),
        *(Question(f"gravity at rest, joint {j}", *a) for j, a in enumerate(rest, start=1)),
    ]


def _measured(tests: HypothesisTests, sources: Sequence[TorqueSource]) -> list[Question]:
    """Whether each motor's torque is measured; one question for all where they agree."""
    question = "is the torque measured"
    if not any(tests.measured.mechanism.driven):
        return [Question(question, None, "no joint has a motor")]
    if not sources:
        return [Question(question, None, "no torque acts")]
    if len({s.source for s in sources}) == 1:
        first, *others = sources
        also = f" (and torque {', '.join(str(s.joint) for s in others)})" if others else ""
        return [Question(question, _passed(first), f"{first.source}{also}: {first.words}")]
    return [
        Question(f"is torque {s.joint} measured", _passed(s), f"{s.source}: {s.words}")
        for s in sources
    ]


def _passed(source: TorqueSource) -> bool | None:
    return None if source.source == "cannot tell" else source.source == "measured"


def _conventions(scored: Sequence[Scored]) -> Question:
    """Signs, joints, frames and units: what is unexplained as given, and as the next best.

    Mirror images leave as much unexplained; these recordings cannot tell them from each other.
    """
    first, *others = scored
    advantages = [s.advantage(first) for s in others]
    mirrors = [s for s, a in zip(others, advantages, strict=True) if abs(a) < ALIKE]
    worse = [s for s, a in zip(others, advantages, strict=True) if abs(a) >= ALIKE]
    share = percent_unexplained(first.score)
    left = f"as given {share} of the torque stays unexplained, whatever the friction"
    # the first of those that look the same
    best = min(worse, key=lambda s: round(s.score, 6), default=None)
    if best is not None:
        words = best.convention.words
        left += f'; the best alternative ("{words}") leaves {percent_unexplained(best.score)}'
    if any(a > MARGIN for a in advantages):
        return Question("signs, frames, units", False, left)
    if mirrors:
        names = " and ".join(f'"{s.convention.words}"' for s in mirrors)
        left = f"{names} would look the same in these recordings; {left}"
    clear = best is not None and max(advantages) < -MARGIN / 2 and first.score < EXPLAINS
    return Question("signs, frames, units", True if clear else None, left)


def _signs(tests: HypothesisTests) -> list[Question]:
    """Whether each torque pushes where the joint accelerates to."""
    unless = ", if nothing else is wrong" if _rivals(tests) else ""
    out = []
    for e in sorted(tests.model_errors, key=lambda e: (len(e.words), e.words)):  # by joint
        if e.kind == "gain" and "all" not in e.words:
            size = f"{e.size:.2g} +- {e.error:.1g} times what the acceleration needs"
            question = f"sign of {e.words.removeprefix('gain of ')}"
            if abs(e.size) <= 3 * e.error:
                passed, words = None, f"cannot tell: {size}, too uncertain"
            elif not HALF < abs(e.size) < 1 / HALF:
                passed, words = None, f"cannot tell: {size}, which is far from once"
            else:
                passed, words = e.size > 0, f"{size}{unless}"
            out.append(Question(question, passed, words))
    return out


HALF = 0.5  # a torque that is smaller than this share of what is needed says nothing of its sign


def _rivals(tests: HypothesisTests) -> set[str]:
    return {f.kind for f in tests.findings} & RIVALS


def answer_of(passed: bool | None) -> str:
    """Word of an answer.

    >>> [answer_of(passed) for passed in (True, False, None)]
    ['yes', 'NO', 'not tested']
    """
    return {True: "yes", False: "NO", None: "not tested"}[passed]


# A number counts as identified where its standard error is below this share of it,
PRECISE = 0.3
# a torque gain below this one, and a delay below this one [s].
GAIN, DELAY = 0.05, 0.005
# Friction below this share of the balance's terms, and below so many of its residuals, may be what
# the mechanism gets wrong: accelerations do not show it.
TERMS, RESIDUALS = 0.05, 3.0


class Identifiable(NamedTuple):
    """Whether something can be identified, and why, or how well."""

    what: str
    possible: bool
    reason: str


def identifiable(
    tests: HypothesisTests, facts: Sequence[JointFacts], estimate: Estimate
) -> Iterator[Identifiable]:
    """Friction of each joint, inertia combinations, gain and delay."""
    measured, mechanism = tests.measured, tests.measured.mechanism
    rows = tests.rows.at(measured.nominal)
    each = (rows.inertia[..., 0], rows.gravity[..., 0], tests.rows.means(measured.torque))
    largest = np.max([row_rms(x, rows.moving) for x in each], axis=0)  # terms of the balances
    for fact, terms in zip(facts, largest, strict=True):
        reason = _hidden(tests, fact.joint - 1)
        if reason:
            yield Identifiable(f"friction of joint {fact.joint}", False, reason)
        else:
            unit = mechanism.velocity_units[fact.joint - 1]
            yield _friction(estimate, fact, unit, float(terms))
    yield from _parts(tests, estimate)
    yield _base(mechanism.base_names, estimate)
    if any(mechanism.driven):
        yield Identifiable("torque gain", *_gain(tests))
        yield Identifiable("torque delay", *_delay(tests))


def _hidden(tests: HypothesisTests, j: int) -> str:
    """Why the torque of a joint shows no friction, or ""."""
    if j in tests.measured.dead:
        return "its torque shows nothing"
    if tests.measured.dataset.torque_at == "link":
        return "a sensor at the link does not feel friction of motor and gear"
    return ""


def _friction(estimate: Estimate, fact: JointFacts, unit: str, terms: float) -> Identifiable:
    what = f"friction of joint {fact.joint}"
    _, error = estimate.at(f"coulomb_{fact.joint}")
    if not np.isfinite(error):
        return Identifiable(what, False, "the joint hardly slides")
    total, share = _precision(estimate, str(fact.joint), fact.fast)
    spread = float(estimate.spread[fact.joint - 1])
    if total < TERMS * terms and total < RESIDUALS * spread:
        shown, left = (percent(torque / max(terms, 1e-300)) for torque in (total, spread))
        reason = (
            f"{shown} of the terms of its balance, of which {left} stay unexplained: only energy "
            "over long motions shows it"
        )
        return Identifiable(what, False, reason)
    return _precise(what, share, fact.fast, unit)


def _parts(tests: HypothesisTests, estimate: Estimate) -> Iterator[Identifiable]:
    """Friction of the parts that turn with several joints."""
    mechanism = tests.measured.mechanism
    fast = sliding_speeds(mechanism, tests.measured.motions).fast[mechanism.n :]
    units = mechanism.friction_units[mechanism.n :]
    for (name, _), speed, unit in zip(mechanism.coupled, fast, units, strict=True):
        what = f"friction of {name}"
        if np.isfinite(estimate.at(f"coulomb_{name}")[1]):
            share = _precision(estimate, name, float(speed))[1]
            yield _precise(what, share, float(speed), f"{unit}/s")
        else:
            yield Identifiable(what, False, "it hardly slides")


def _precision(estimate: Estimate, label: str, fast: float) -> tuple[float, float]:
    """Friction [N m] at a speed, and its standard error over it; label : end of its names."""
    at = [estimate.names.index(f"{name}_{label}") for name in ("coulomb", "viscous")]
    gradient = np.array([1.0, fast])
    total = float(np.abs(estimate.value[at]) @ gradient)
    deviation = float(np.sqrt(gradient @ estimate.covariance[np.ix_(at, at)] @ gradient))
    return total, deviation / max(total, 1e-300)


def _precise(what: str, share: float, fast: float, unit: str) -> Identifiable:
    reason = f"known to {percent(share)} of its level at {fast:.2g} {unit}"
    return Identifiable(what, share < PRECISE, reason)


def _base(names: Sequence[str], estimate: Estimate) -> Identifiable:
    directions = [d for d in estimate.unidentifiable if any(name in names for name, _ in d)]
    reason = "; ".join(_direction(d) for d in directions[:3])
    kept = [name for name in names if not np.isfinite(estimate.at(name)[1])]
    if kept and len(kept) < len(names):
        ratios = f"ratios to {' and '.join(kept)} only, which no torque shows"
        reason = f"{reason}; {ratios}" if reason else ratios
    reason = reason or f"all {len(names)} base parameters"
    return Identifiable("inertia combinations", not directions, reason)


def _direction(direction: tuple[tuple[str, float], ...]) -> str:
    """Words for a direction that has no effect on the data.

    >>> _direction((("a", 0.8), ("b", -0.5)))
    'more a with less b changes nothing'
    >>> _direction((("a", 0.8),))
    'a has no effect'
    """
    if len(direction) == 1:
        return f"{direction[0][0]} has no effect"
    sign = np.sign(direction[0][1])
    up, down = (
        " and ".join(name for name, share in direction if share * sign * side > 0)
        for side in (1, -1)
    )
    return f"more {up}{f' with less {down}' if down else ''} changes nothing"


def _gain(tests: HypothesisTests) -> tuple[bool, str]:
    gains = [e for e in tests.model_errors if e.kind == "gain"]
    if not gains:
        return False, "no torque acts"
    best = min(gains, key=lambda e: e.error / max(abs(e.size), 1e-300))
    rivals = _rivals(tests)
    if not HALF < best.size < 1 / HALF:
        reason = f"{best.size:.2g} +- {best.error:.1g} is no gain: something else is wrong"
        return False, reason
    if rivals:
        other = "friction that grows with the torque" if "load" in rivals else "what is unexplained"
        reason = f"{best.size:.3f} +- {best.error:.3f}, but {other} may look the same"
        return False, reason
    reason = (
        f"{best.size:.3f} +- {best.error:.3f}, if the nominal mechanism is right: a gain and a "
        "common factor of all masses look the same"
    )
    return best.error < GAIN, reason


def _delay(tests: HypothesisTests) -> tuple[bool, str]:
    if tests.delay is None:
        return False, "no torque varies"
    if abs(tests.delay.seconds) >= UNUSABLE_DELAY and tests.shift == 0.0:
        return False, "no delay explains the motion clearly"
    low, high = (1e3 * end for end in tests.delay.interval)
    if tests.delay.error >= DELAY:
        reason = f"cannot tell: {low:+.0f} to {high:+.0f} ms, by what is held for known (95 %)"
        return False, reason
    when = f"{low:.1f} to {high:.1f} ms after"
    if low < 0:
        when = f"{-low:.1f} ms before to {high:.1f} ms after"
    if high < 0:
        when = f"{-high:.1f} to {-low:.1f} ms before"
    return True, f"the torque acts {when} it is logged (95 %)"


# Speed [rad/s] that shows viscous friction.
FAST = 2.0
# Free decay [s] that identifies the friction of joints without motor, and the least for any joint.
DECAY, SOME_DECAY = 20.0, 2.0
_SWINGING = 2  # joints of what swings freely without harm; arms with a motor at each of more fall


def still_joints(tests: HypothesisTests, facts: Sequence[JointFacts]) -> Iterator[Finding]:
    """Findings of joints that hardly move in any recording."""
    windows = tests.as_given.moving.sum(0)
    level = "" if (windows >= MIN_WINDOWS).any() else "unusable"
    units = tests.measured.mechanism.velocity_units
    for fact, count, unit in zip(facts, windows, units, strict=True):
        if count < MIN_WINDOWS and fact.joint - 1 not in tests.measured.dead:
            numbers = {"fast": fact.fast, "windows": float(count)}
            words = {"unit": unit, "noise": fact.velocity_noise}
            yield finding("missing_excitation", numbers, words, fact.joint, level=level)


def advice(
    tests: HypothesisTests, facts: Sequence[JointFacts], passive: float, estimate: Estimate
) -> Iterator[str]:
    """Sentences that say which recording to make next, the most useful first.

    passive : [s] of motion without torque
    """
    measured, mechanism = tests.measured, tests.measured.mechanism
    yield from _faster(measured, facts)
    if _may_fall(measured):
        yield from _decay(passive, unmoved=not all(mechanism.driven))
    delay = tests.delay
    if any(mechanism.driven) and (delay is None or delay.error >= DELAY):
        what = f"the delay is known to {1e3 * delay.error:.0f} ms" if delay else "no torque varies"
        yield f"{what}: add torque steps or a chirp, which show delay and gain"
    names = {name for direction in estimate.unidentifiable for name, _ in direction}
    base = sorted(names & set(mechanism.base_names))
    if base:
        rest = f" and {len(base) - 3} more" if len(base) > 4 else ""
        listed = " and ".join(base[:3] if rest else base)
        yield f"{listed}{rest} not identified: add faster, wider motion of all joints"


def _faster(measured: Measured, facts: Sequence[JointFacts]) -> Iterator[str]:
    mechanism = measured.mechanism
    for fact, joint, unit in zip(facts, mechanism.joints, mechanism.position_units, strict=True):
        if unit == "rad" and fact.top < FAST:
            swing = _swing(measured, fact.joint - 1)
            yield f"{joint} never exceeds {max(fact.top, 0.1):.1f} rad/s: add {swing}"
        elif fact.at_rest < 0.9 and not 0.15 < fact.forward < 0.85:
            direction = "forward" if fact.forward < 0.5 else "backward"
            yield f"{joint} hardly moves {direction}: add motion in that direction"


def _may_fall(measured: Measured) -> bool:
    """Whether gravity moves the mechanism when its motors are off, and breaks no arm or hoist."""
    mechanism = measured.mechanism
    if mechanism.n > _SWINGING and all(mechanism.driven):
        return False
    q = np.linspace(-1.0, 1.0, 5)[:, None] * np.ones(mechanism.n)
    weight = mechanism.dynamics(measured.nominal[0], q, 0 * q)[1]
    slides = np.array([unit == "m" for unit in mechanism.position_units])
    return bool(weight.any()) and not weight[:, slides].any()


def _decay(passive: float, *, unmoved: bool) -> Iterator[str]:
    if passive < SOME_DECAY:
        reason = " (it shows the friction of the joint without motor)" if unmoved else ""
        yield f"no free decay: add one of {DECAY:.0f} s, torque off{reason}"
    elif unmoved and passive < DECAY:
        yield f"only {passive:.0f} s of free decay: add one of {DECAY:.0f} s"


def _swing(measured: Measured, j: int) -> str:
    """A swing that reaches twice the speed, by the energy of the nominal mechanism."""
    angles = np.linspace(0.0, 2.8, 141)
    q = np.outer(angles, np.eye(measured.mechanism.n)[j])
    terms = measured.mechanism.terms(measured.nominal[0], q, 0 * q)
    speed = np.sqrt(2 * np.maximum(terms.energy - terms.energy[0], 0) / terms.M[:, j, j])
    enough = np.flatnonzero(speed > 2 * FAST)
    if len(enough) and _may_fall(measured):
        degrees = int(np.ceil(np.degrees(angles[enough[0]]) / 10) * 10)
        return f"a swing of this joint from {degrees} degrees"
    return f"driven motion of this joint above {FAST:g} rad/s"
