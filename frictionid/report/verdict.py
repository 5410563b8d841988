"""The verdict: which model the evidence supports, by a stated rule, and how sure that is.

Every model is compared with the best one over identical folds; the simplest that is not practically
worse is recommended (`frictionid.evaluation.statistics.choose`). What is compared is the median
error of each fold's predictions, half a second ahead or at the nearest reported horizon.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frictionid.evaluation.statistics import FEWEST, Choice, CorrelatedTest, choose
from frictionid.report.candidates import Candidate, candidates_of, judged
from frictionid.report.numbers import percent, seconds, short
from frictionid.report.plausibility import FAILED
from frictionid.report.questions import (
    NOT_EVALUATED,
    Asked,
    Question,
    percent_of,
    questions_to,
    unanswered,
)
from frictionid.report.sections import Model, Section, SummaryData, rollout

HORIZON = 0.5  # [s]
RECOMMENDED, SIMPLE, UNDECIDED = "recommended", "simple_enough", "undecided"
KINDS = (RECOMMENDED, SIMPLE, UNDECIDED, NOT_EVALUATED)
MANY = 10  # times as many recordings: beyond that their number says little
MODEL = "Which friction model do these data support?"


@dataclass(frozen=True, eq=False)
class Verdict:
    """Which model of a data set the evidence supports.

    Attributes
    ----------
    dataset : the data set that was fitted
    kind : "recommended"; "simple_enough", no model beyond the simplest one with friction gains
        anything practical; "undecided", these data cannot tell; "not_evaluated"
    recommended : name of the recommended model, None where there is none
    provisional : name of the simplest model that is shown to be not practically worse: what to use
        until further data decide; it is the recommended one where there is one
    sentence : the verdict in one sentence
    horizon : [s] of the predictions that are compared, NaN where none are
    error, unit : mean over the folds of the provisional model's median errors
    region : half the width of the region of practical equivalence, in the same unit
    folds, recordings : how many there are behind it
    candidates : all models that can be recommended, from the simplest to the most complex
    main_doubt, record_next : what speaks against it most, and what to record next, a sentence each
    questions : all that the comparison is asked
    """

    dataset: str
    kind: str
    recommended: str | None
    provisional: str | None
    sentence: str
    horizon: float
    error: float
    unit: str
    region: float
    folds: int
    recordings: int
    candidates: tuple[Candidate, ...]
    main_doubt: str
    record_next: str
    questions: tuple[Question, ...]

    @property
    def failed(self) -> dict[Model, tuple[str, ...]]:
        """Names of the checks that models fail, see `frictionid.report.plausibility.Check`."""
        own = {
            c.model: tuple(k.name for k in c.checks if k.outcome == FAILED) for c in self.candidates
        }
        return {model: names for model, names in own.items() if names}

    def candidate(self, name: str | None) -> Candidate | None:
        """The candidate of a name; None where there is none."""
        return next((c for c in self.candidates if c.name == name), None)


def verdict_of(section: Section) -> Verdict:
    """The verdict on the models that were fitted to a data set."""
    data = section.fitted
    if not data.reported:
        reason = "the comparison predicts no motion"
        return _not_evaluated(data, float("nan"), candidates_of(data, ""), reason)
    horizon = min(data.reported, key=lambda h: abs(h - HORIZON))
    candidates = candidates_of(data, rollout(horizon))
    folds = max((len(c.errors) for c in candidates), default=0)
    if folds < FEWEST:
        reason = f"errors are known of {folds} folds, and {FEWEST} are needed"
        return _not_evaluated(data, horizon, candidates, reason)
    choice = choose(
        np.array([c.errors for c in candidates]),
        np.array([c.complexity for c in candidates]),
        np.array([bool(c.implausible) for c in candidates]),
    )
    if choice.best is None:
        reason = "no model's predictions are finite in every fold"
        return _not_evaluated(data, horizon, candidates, reason)
    return _decided(section, horizon, choice, candidates)


def _decided(
    section: Section, horizon: float, choice: Choice, candidates: Sequence[Candidate]
) -> Verdict:
    assert choice.simplest is not None and choice.adequate is not None
    data, own = section.fitted, judged(candidates, choice)
    by_model = {c.model: c for c in own}
    simplest = by_model[candidates[choice.simplest].model]
    provisional = by_model[candidates[choice.adequate].model]
    kind = UNDECIDED
    if choice.recommended is not None:
        kind = SIMPLE if _is_simplest(provisional, own) else RECOMMENDED
    recommended = None if kind == UNDECIDED else provisional.name
    unit = data.description.angle_unit
    sentence = _sentence(kind, provisional, simplest, own, horizon, unit)
    question = Question(
        "model", MODEL, recommended or UNDECIDED, sentence, {"error": provisional.error}
    )
    asked = Asked(section, own, provisional, rollout(horizon))
    doubt, remedy = _doubt(section, kind, provisional, simplest)
    return Verdict(
        dataset=data.dataset,
        kind=kind,
        recommended=recommended,
        provisional=provisional.name,
        sentence=sentence,
        horizon=horizon,
        error=provisional.error,
        unit=unit,
        region=choice.region,
        folds=len(provisional.errors),
        recordings=data.description.recordings,
        candidates=own,
        main_doubt=doubt,
        record_next=remedy,
        questions=(question, *questions_to(asked)),
    )


def _is_simplest(candidate: Candidate, candidates: Sequence[Candidate]) -> bool:
    """Whether no model with friction is simpler, and some model is more complex."""
    simpler = [c for c in candidates if c.complexity < candidate.complexity]
    more = any(c.complexity > candidate.complexity for c in candidates)
    return more and all(c.model.role == "none" for c in simpler)


def _sentence(
    kind: str,
    own: Candidate,
    simplest: Candidate,
    candidates: Sequence[Candidate],
    horizon: float,
    unit: str,
) -> str:
    error = f"{short(own.error)} {unit} off after {seconds(horizon)}"
    if kind == UNDECIDED:
        return (
            f"These data cannot tell whether {simplest.name} is enough or {own.name} is needed, "
            f"{error}."
        )
    if own.model.role == "none":
        return f"No friction is needed to predict this motion: {own.name} is {error}."
    worse = sum(c.standing in ("worse", "diverged") for c in candidates)
    rivals = f"{worse} of {len(candidates) - 1} other models are practically worse"
    if worse < len(candidates) - 1:
        rivals += f", {len(candidates) - 1 - worse} no better"
    unfit = [c.name for c in candidates if c.implausible and c.standing in ("best", "adequate")]
    spared = [name for name in unfit if name != own.name]
    if spared:
        rivals += f"; {', '.join(spared)} would do, but {'are' if spared[1:] else 'is'} implausible"
    if kind == SIMPLE:
        return f"The simple model is enough: {own.name} is {error}; {rivals}."
    return f"Use {own.name}, {error}" + (f"; {rivals}." if len(candidates) > 1 else ".")


def _doubt(section: Section, kind: str, own: Candidate, simplest: Candidate) -> tuple[str, str]:
    """What speaks most against the verdict, and what to record next, a sentence each."""
    data = section.fitted
    recordings, speeds = data.description.recordings, "Motion through the speeds at which it fails."
    if own.implausible:
        return f"{own.name} is not plausible: it {own.implausible[0]}.", speeds
    if kind == UNDECIDED and simplest.against_best is not None:
        low, high = (percent_of(v / own.error) for v in simplest.against_best[2:4])
        most = recordings_needed(recordings, simplest.against_best, 0.1 * own.error)
        words = f"about {most} recordings in place of {recordings}"
        if most > MANY * recordings:
            words = f"more than {MANY} times as many recordings, or longer ones"
        return (
            f"{simplest.name} is between {low} and {high} worse than the best model.",
            f"More of the same motion: {words}.",
        )
    if recordings < FEWEST:
        return (
            f"The folds are parts of {recordings} recording{'s' * (recordings > 1)}: another one "
            "may say something else.",
            "At least three recordings, so that each can be held out as a whole.",
        )
    share = data.value(own.model, rollout(data.reported[-1], "diverged"))
    if share >= 0.01:
        return (
            f"{percent(share)} of its predictions diverge within {seconds(data.reported[-1])}.",
            "Motion like that from which they start.",
        )
    if not section.tests:
        return (
            "The models are judged on motion like that which they were fitted to.",
            "A data set of other motion or another load that no fit sees, as a test.",
        )
    return (
        f"{len(section.tests)} data sets that no fit has seen give one number each: their chance "
        "is not known.",
        "More recordings of the motion that the model is for.",
    )


def recordings_needed(recordings: int, test: CorrelatedTest, region: float) -> int:
    """How many recordings make the interval of a difference as wide as the region, about.

    Its width falls with the square root of their number.

    >>> from frictionid.evaluation.statistics import correlated_test
    >>> test = correlated_test(np.array([0.05, 0.0, 0.01, 0.04]), region=0.02)
    >>> recordings_needed(4, test, 0.02)
    33
    """
    return max(recordings + 1, round(recordings * ((test.high - test.low) / (2 * region)) ** 2))


def _not_evaluated(
    data: SummaryData, horizon: float, candidates: Sequence[Candidate], reason: str
) -> Verdict:
    sentence = f"No verdict: {reason}."
    return Verdict(
        dataset=data.dataset,
        kind=NOT_EVALUATED,
        recommended=None,
        provisional=None,
        sentence=sentence,
        horizon=horizon,
        error=float("nan"),
        unit=data.description.angle_unit,
        region=float("nan"),
        folds=max((len(c.errors) for c in candidates), default=0),
        recordings=data.description.recordings,
        candidates=tuple(sorted(candidates, key=lambda c: c.complexity)),
        main_doubt=f"{reason[0].upper()}{reason[1:]}.",
        record_next="At least three recordings, so that each can be held out as a whole.",
        questions=(Question("model", MODEL, NOT_EVALUATED, sentence, {}), *unanswered(reason)),
    )
