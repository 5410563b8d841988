"""The classic questions with their answers: yes, no, or not tested and why.

An answer is yes only where its test ran and could have failed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from frictionid.check.conventions import ALIKE, EXPLAINS, MARGIN, Scored
from frictionid.check.hypothesis_tests import HypothesisTests, percent_unexplained
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
