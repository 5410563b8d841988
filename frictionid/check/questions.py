"""The classic questions with their answers, also where nothing is wrong: signs, energy, rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.check.hypothesis_tests import HypothesisTests, percent_unexplained
from frictionid.check.passive import FEWEST, energy_rises, rest_loads
from frictionid.check.regression import Estimate


class Question(NamedTuple):
    """A question to the data and its answer; `passed` is None where the data cannot answer."""

    question: str
    passed: bool | None
    words: str


def questions(tests: HypothesisTests, estimate: Estimate, kinds: set[str]) -> list[Question]:
    """Questions in the order in which they are tested; `kinds` are those of all findings."""
    measured = "commanded_torque" not in kinds
    words = "it is no gravity model" if measured else "it equals a gravity model"
    first = Question("is the torque measured", measured, words)
    if not tests.done:
        return [first]
    return [
        first,
        _conventions(tests),
        *_signs(tests),
        _energy(tests, kinds),
        *_rest(tests, estimate, kinds),
    ]


def _conventions(tests: HypothesisTests) -> Question:
    """Signs, joints, frames and units: what is unexplained as given, and as the next best."""
    given, *others = tests.conventions
    best = min(others, key=lambda s: s.score)
    return Question(
        "signs, frames, units",
        given.score < best.score,
        f"as given {percent_unexplained(given.score)} of the torque stays unexplained; the best "
        f'alternative ("{best.convention.words}") leaves {percent_unexplained(best.score)}',
    )


def _signs(tests: HypothesisTests) -> list[Question]:
    """Whether each torque pushes where the joint accelerates to."""
    gains = [e for e in tests.model_errors if e.kind == "gain" and "all" not in e.words]
    return [
        Question(
            f"sign of {e.words.removeprefix('gain of ')}",
            e.size > 0 if abs(e.size) > 3 * e.error else None,
            f"{e.size:.3f} +- {e.error:.3f} times what the acceleration needs",
        )
        for e in gains
    ]


def _energy(tests: HypothesisTests, kinds: set[str]) -> Question:
    rises = energy_rises(tests.measured)
    if not rises:
        return Question("energy falls without input", None, "no passive phase")
    return Question(
        "energy falls without input",
        "energy" not in kinds,
        f"rises by at most {100 * max(rises).share:.2g} % of its range, "
        f"{len(rises)} passive phases",
    )


def _rest(tests: HypothesisTests, estimate: Estimate, kinds: set[str]) -> list[Question]:
    out = []
    for j, load in enumerate(rest_loads(tests), start=1):
        passed, words = None, "it hardly rests under load"
        if len(load) >= FEWEST:
            passed = "gravity_at_rest" not in kinds
            level = estimate.at(f"coulomb_{j}")[0]
            words = f"|torque - gravity| up to {np.quantile(load, 0.9):.2g}, Coulomb {level:.2g}"
        out.append(Question(f"gravity at rest, joint {j}", passed, words))
    return out
