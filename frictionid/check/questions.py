"""The classic questions with their answers: yes, no, or not tested and why.

An answer is yes only where its test ran and could have failed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.conventions import ALIKE, EXPLAINS, MARGIN, Scored
from frictionid.check.facts import JointFacts
from frictionid.check.findings import percent
from frictionid.check.hypothesis_tests import UNUSABLE_DELAY, HypothesisTests, percent_unexplained
from frictionid.check.motion import sliding_speeds
from frictionid.check.passive import Answered, energy_answer, rest_answers
from frictionid.check.regression import Estimate
from frictionid.check.rivals import RIVALS
from frictionid.check.torque_source import TorqueSource


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
    rest = rest_answers(tests, estimate)
    return [
        *first,
        _conventions(tests.conventions),
        *_signs(tests),
        _question("energy falls without input", energy_answer(tests.measured)),
        *(_question(f"gravity at rest, joint {j}", a) for j, a in enumerate(rest, start=1)),
    ]


def _question(words: str, answer: Answered) -> Question:
    return Question(words, answer.passed, answer.words)


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
    given, *others = scored
    advantages = [s.advantage(given) for s in others]
    mirrors = [s for s, a in zip(others, advantages, strict=True) if abs(a) < ALIKE]
    worse = [s for s, a in zip(others, advantages, strict=True) if abs(a) >= ALIKE]
    left = f"as given {percent_unexplained(given.score)} of the torque stays unexplained"
    # of some that look the same the first
    best = min(worse, key=lambda s: round(s.score, 6), default=None)
    if best is not None:
        words = best.convention.words
        left += f'; the best alternative ("{words}") leaves {percent_unexplained(best.score)}'
    if any(a > MARGIN for a in advantages):
        return Question("signs, frames, units", False, left)
    if mirrors:
        names = " and ".join(f'"{s.convention.words}"' for s in mirrors)
        left = f"{names} would look the same in these recordings; {left}"
    clear = best is not None and max(advantages) < -MARGIN / 2 and given.score < EXPLAINS
    return Question("signs, frames, units", True if clear else None, left)


def _signs(tests: HypothesisTests) -> list[Question]:
    """Whether each torque pushes where the joint accelerates to."""
    rivals = {f.kind for f in tests.findings} & RIVALS
    unless = ", if nothing else is wrong" if rivals else ""
    gains = [e for e in tests.model_errors if e.kind == "gain" and "all" not in e.words]
    return [
        Question(
            f"sign of {e.words.removeprefix('gain of ')}",
            e.size > 0 if abs(e.size) > 3 * e.error else None,
            f"{e.size:.3f} +- {e.error:.3f} times what the acceleration needs{unless}"
            + (", too uncertain to tell" if abs(e.size) <= 3 * e.error else ""),
        )
        for e in gains
    ]


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
) -> list[Identifiable]:
    """Friction of each joint, inertia combinations, gain and delay."""
    mechanism = tests.measured.mechanism
    terms = _terms(tests)
    out = [
        _friction(estimate, fact, unit, float(terms[fact.joint - 1]))
        if not (reason := _hidden(tests, fact.joint - 1))
        else Identifiable(f"friction of joint {fact.joint}", False, reason)
        for fact, unit in zip(facts, mechanism.velocity_units, strict=True)
    ]
    out += _parts(tests, estimate)
    out.append(_base(mechanism.base_names, estimate))
    return [*out, _gain(tests), _delay(tests)] if any(mechanism.driven) else out


def _hidden(tests: HypothesisTests, j: int) -> str:
    """Why the torque of a joint shows no friction, or ""."""
    if j in tests.measured.dead:
        return "its torque shows nothing"
    if tests.measured.dataset.torque_at == "link":
        return "a sensor at the link does not feel friction of motor and gear"
    return ""


def _terms(tests: HypothesisTests) -> Array:
    """Root mean square (n,) of the largest term of each joint's balance [N m]."""
    rows = tests.rows.at(tests.measured.nominal)
    each = (rows.inertia[..., 0], rows.gravity[..., 0], tests.rows.means(tests.measured.torque))
    squares = [np.where(rows.moving, x, 0.0) ** 2 for x in each]
    count = np.maximum(rows.moving.sum(0), 1)
    return np.asarray(np.sqrt(np.max([x.sum(0) / count for x in squares], axis=0)))


def _friction(estimate: Estimate, fact: JointFacts, unit: str, terms: float) -> Identifiable:
    what = f"friction of joint {fact.joint}"
    _, error = estimate.at(f"coulomb_{fact.joint}")
    if not np.isfinite(error):
        return Identifiable(what, False, "the joint hardly slides")
    total, share = _precision(estimate, str(fact.joint), fact.fast)
    spread = float(estimate.spread[fact.joint - 1])
    if total < TERMS * terms and total < RESIDUALS * spread:
        reason = (
            f"{percent(total / max(terms, 1e-300))} of the terms of its balance, of which "
            f"{percent(spread / max(terms, 1e-300))} stay unexplained: only energy over long "
            "motions shows it"
        )
        return Identifiable(what, False, reason)
    return _known(what, share, fact.fast, unit)


def _parts(tests: HypothesisTests, estimate: Estimate) -> list[Identifiable]:
    """Friction of the parts that turn with several joints."""
    mechanism = tests.measured.mechanism
    fast = sliding_speeds(mechanism, tests.measured.motions).fast[mechanism.n :]
    units = mechanism.friction_units[mechanism.n :]
    out = []
    for (name, _), speed, unit in zip(mechanism.coupled, fast, units, strict=True):
        what = f"friction of {name}"
        if not np.isfinite(estimate.at(f"coulomb_{name}")[1]):
            out.append(Identifiable(what, False, "it hardly slides"))
            continue
        share = _precision(estimate, name, float(speed))[1]
        out.append(_known(what, share, float(speed), f"{unit}/s"))
    return out


def _precision(estimate: Estimate, label: str, fast: float) -> tuple[float, float]:
    """Friction [N m] at a speed, and its standard error over it; label : end of its names."""
    at = [estimate.names.index(f"{name}_{label}") for name in ("coulomb", "viscous")]
    gradient = np.array([1.0, fast])
    total = float(np.abs(estimate.value[at]) @ gradient)
    deviation = float(np.sqrt(gradient @ estimate.covariance[np.ix_(at, at)] @ gradient))
    return total, deviation / max(total, 1e-300)


def _known(what: str, share: float, fast: float, unit: str) -> Identifiable:
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
    more = " and ".join(name for name, share in direction if share * sign > 0)
    less = " and ".join(name for name, share in direction if share * sign < 0)
    return f"more {more}{f' with less {less}' if less else ''} changes nothing"


def _gain(tests: HypothesisTests) -> Identifiable:
    gains = [e for e in tests.model_errors if e.kind == "gain"]
    if not gains:
        return Identifiable("torque gain", False, "no torque acts")
    best = min(gains, key=lambda e: e.error)
    rivals = {f.kind for f in tests.findings} & RIVALS
    if rivals:
        other = "friction that grows with the torque" if "load" in rivals else "what is unexplained"
        reason = f"{best.size:.3f} +- {best.error:.3f}, but {other} may look the same"
        return Identifiable("torque gain", False, reason)
    reason = (
        f"{best.size:.3f} +- {best.error:.3f}, if the nominal mechanism is right: a gain and a "
        "common factor of all masses look the same"
    )
    return Identifiable("torque gain", best.error < GAIN, reason)


def _delay(tests: HypothesisTests) -> Identifiable:
    if tests.delay is None:
        return Identifiable("torque delay", False, "no torque varies")
    if abs(tests.delay.seconds) >= UNUSABLE_DELAY and tests.shift == 0.0:
        return Identifiable("torque delay", False, "no delay explains the motion clearly")
    low, high = tests.delay.interval
    reason = f"the torque acts {1e3 * low:.1f} to {1e3 * high:.1f} ms after it is logged (95 %)"
    if high < 0:
        reason = (
            f"the torque acts {-1e3 * high:.1f} to {-1e3 * low:.1f} ms before it is logged (95 %)"
        )
    return Identifiable("torque delay", tests.delay.error < DELAY, reason)
