"""Answers to the classic questions, also where nothing is wrong: signs, energy, rest, commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import speeds_of
from frictionid.check.hypothesis_tests import Trial
from frictionid.check.passive import energy_rises, rest_loads
from frictionid.check.regression import Estimate
from frictionid.data.recordings import Recording


class Answer(NamedTuple):
    """A question to the data and its answer; `passed` is None where the data cannot answer."""

    question: str
    passed: bool | None
    words: str


def answers(
    trial: Trial, recordings: Sequence[Recording], told: Array, estimate: Estimate, found: set[str]
) -> list[Answer]:
    """Answers, in the order in which they are asked; `found` are the kinds of all findings."""
    out = [
        Answer(
            "is the torque measured",
            "commanded_torque" not in found,
            "it equals a gravity model"
            if "commanded_torque" in found
            else "it is no gravity model",
        )
    ]
    if not trial.judged:
        return out
    rises = energy_rises(trial.mechanism, recordings, trial.motions, told)
    return [
        *out,
        _conventions(trial),
        *_signs(trial),
        Answer(
            "energy falls without input",
            "energy" not in found if rises else None,
            f"rises by at most {100 * max(r[0] for r in rises):.2g} % of its range, "
            f"{len(rises)} passive phases"
            if rises
            else "no passive phase",
        ),
        *_rest(trial, told, estimate, found),
    ]


def _conventions(trial: Trial) -> Answer:
    """Signs, joints, frames and units: what is unexplained as given, and as the next best."""
    given, *others = trial.conventions
    best = min(others, key=lambda s: s.score)
    right = given.score < best.score
    return Answer(
        "signs, frames, units",
        right,
        f"as given {_percent(given.score)} of the torque stays unexplained; the best other reading "
        f'("{best.convention.words}") leaves {_percent(best.score)}',
    )


def _percent(score: float) -> str:
    return f"{100 * np.exp(score / 2):.2g} %"


def _signs(trial: Trial) -> list[Answer]:
    """Whether each torque pushes where the joint accelerates to."""
    gains = [s for s in trial.suspects if s.kind == "gain" and "all" not in s.words]
    return [
        Answer(
            f"sign of {s.words.removeprefix('gain of ')}",
            s.size > 0 if abs(s.size) > 3 * s.error else None,
            f"{s.size:.3f} +- {s.error:.3f} times what the acceleration needs",
        )
        for s in gains
    ]


def _rest(trial: Trial, told: Array, estimate: Estimate, found: set[str]) -> list[Answer]:
    out = []
    loads = rest_loads(trial.rows, trial.impulse, told, speeds_of(trial.motions).rest)
    for j, load in enumerate(loads):
        question = f"gravity at rest, joint {j + 1}"
        level = estimate.at(f"coulomb_{j + 1}")[0]
        if len(load) < 10:
            out.append(Answer(question, None, "it hardly rests under load"))
            continue
        out.append(
            Answer(
                question,
                "gravity_at_rest" not in found,
                f"|torque - gravity| up to {np.quantile(load, 0.9):.2g}, sliding level {level:.2g}",
            )
        )
    return out
