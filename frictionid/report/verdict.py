"""The verdict: which model the evidence supports, by a stated rule, and how sure that is.

Every model is compared with the best one over identical folds; the simplest that is not practically
worse is recommended (`frictionid.evaluation.statistics.choose`). What is compared is the median
error of each fold's predictions, half a second ahead or at the nearest reported horizon.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.evaluation.statistics import FEWEST, Choice, CorrelatedTest, choose
from frictionid.report.candidates import Candidate, candidates_of, judged_by
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
from frictionid.report.sections import Model, Section, rollout

HORIZON = 0.5  # [s]
RECOMMENDED, SIMPLE, UNDECIDED = "recommended", "simple_enough", "undecided"
KINDS = (RECOMMENDED, SIMPLE, UNDECIDED, NOT_EVALUATED)
MANY = 10  # times as many recordings: beyond that their number says little
MODEL = "Which friction model do these data support?"
WHOLE = "At least three recordings, so that each can be held out as a whole."


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
    kind: str = NOT_EVALUATED
    recommended: str | None = None
    provisional: str | None = None
    sentence: str = ""
    horizon: float = float("nan")
    error: float = float("nan")
    unit: str = ""
    region: float = float("nan")
    folds: int = 0
    recordings: int = 0
    candidates: tuple[Candidate, ...] = ()
    main_doubt: str = ""
    record_next: str = WHOLE
    questions: tuple[Question, ...] = ()

    @property
    def failed(self) -> dict[Model, tuple[str, ...]]:
        """Names of the checks that models fail, see `frictionid.report.plausibility.Check`."""
        names = {
            c.model: tuple(k.name for k in c.checks if k.outcome == FAILED) for c in self.candidates
        }
        return {model: checks for model, checks in names.items() if checks}

    def candidate(self, name: str | None) -> Candidate | None:
        """The candidate of a name; None where there is none."""
        return next((c for c in self.candidates if c.name == name), None)


def verdict_of(section: Section) -> Verdict:
    """The verdict on the models that were fitted to a data set."""
    data, choice = section.fitted, None
    horizon = min(data.reported, key=lambda h: abs(h - HORIZON), default=float("nan"))
    candidates = candidates_of(data, rollout(horizon) if data.reported else "")
    folds = max((len(c.errors) for c in candidates), default=0)
    if not data.reported:
        reason = "the comparison predicts no motion"
    elif folds < FEWEST:
        reason = f"errors are known of {folds} folds, and {FEWEST} are needed"
    else:
        reason = "no model's predictions are finite in every fold"
        choice = choose(
            np.array([c.errors for c in candidates]),
            np.array([c.complexity for c in candidates]),
            np.array([bool(c.implausible) for c in candidates]),
        )
    verdict = Verdict(
        dataset=data.dataset,
        horizon=horizon,
        unit=data.description.angle_unit,
        folds=folds,
        recordings=data.description.recordings,
        candidates=tuple(sorted(candidates, key=lambda c: c.complexity)),
    )
    if choice is not None and choice.best is not None:
        return _decided(section, verdict, choice, candidates)
    sentence = f"No verdict: {reason}."
    question = Question("model", MODEL, NOT_EVALUATED, sentence, {})
    return replace(
        verdict,
        sentence=sentence,
        main_doubt=f"{reason[0].upper()}{reason[1:]}.",
        questions=(question, *unanswered(reason)),
    )


def _decided(
    section: Section, verdict: Verdict, choice: Choice, candidates: Sequence[Candidate]
) -> Verdict:
    """The verdict with what was chosen of the candidates, which are in the choice's order."""
    assert choice.simplest is not None and choice.adequate is not None
    judged = judged_by(choice, candidates)
    by_model = {c.model: c for c in judged}
    simplest, provisional = (
        by_model[candidates[i].model] for i in (choice.simplest, choice.adequate)
    )
    kind = UNDECIDED
    if choice.recommended is not None:
        kind = SIMPLE if _is_simplest(provisional, judged) else RECOMMENDED
    recommended = None if kind == UNDECIDED else provisional.name
    error = f"{short(provisional.error)} {verdict.unit} off after {seconds(verdict.horizon)}"
    sentence = _sentence(kind, provisional, simplest, judged, error)
    evidence = {"error": provisional.error}
    question = Question("model", MODEL, recommended or UNDECIDED, sentence, evidence)
    asked = Asked(section, judged, provisional, rollout(verdict.horizon))
    doubt, remedy = _doubt(section, kind, provisional, simplest)
    return replace(
        verdict,
        kind=kind,
        recommended=recommended,
        provisional=provisional.name,
        sentence=sentence,
        error=provisional.error,
        region=choice.region,
        candidates=judged,
        main_doubt=doubt,
        record_next=remedy,
        questions=(question, *questions_to(asked)),
    )


def _is_simplest(candidate: Candidate, candidates: Sequence[Candidate]) -> bool:
    """Whether no model with friction is simpler, and some model is richer complex."""
    simpler = [c for c in candidates if c.complexity < candidate.complexity]
    richer = any(c.complexity > candidate.complexity for c in candidates)
    return richer and all(c.model.role == "none" for c in simpler)


def _sentence(
    kind: str,
    model: Candidate,
    simplest: Candidate,
    candidates: Sequence[Candidate],
    error: str,
) -> str:
    """The verdict in one sentence; `error` says how far off the model is."""
    if kind == UNDECIDED:
        return (
            f"These data cannot tell whether {simplest.name} is enough or {model.name} is needed, "
            f"{error}."
        )
    if model.model.role == "none":
        return f"No friction is needed to predict this motion: {model.name} is {error}."
    others = len(candidates) - 1
    worse = sum(c.standing in ("worse", "diverged") for c in candidates)
    rivals = f"{worse} of {others} other models are practically worse"
    rivals += f", {others - worse} no better" if worse < others else ""
    good = [c for c in candidates if c.standing in ("best", "adequate") and c is not model]
    unfit = [c.name for c in good if c.implausible]
    if unfit:
        rivals += f"; {', '.join(unfit)} would do, but {'are' if unfit[1:] else 'is'} implausible"
    if kind == SIMPLE:
        return f"The simple model is enough: {model.name} is {error}; {rivals}."
    return f"Use {model.name}, {error}" + (f"; {rivals}." if others else ".")


def _doubt(section: Section, kind: str, model: Candidate, simplest: Candidate) -> tuple[str, str]:
    """What speaks most against the verdict, and what to record next, a sentence each."""
    data = section.fitted
    recordings = data.description.recordings
    if model.implausible:
        doubt = f"{model.name} is not plausible: it {model.implausible[0]}."
        return doubt, "Motion through the speeds at which it fails."
    if kind == UNDECIDED and simplest.against_best is not None:
        low, high = (percent_of(v / model.error) for v in simplest.against_best[2:4])
        most = recordings_needed(recordings, simplest.against_best, 0.1 * model.error)
        words = f"about {most} recordings in place of {recordings}"
        if most > MANY * recordings:
            words = f"more than {MANY} times as many recordings, or longer ones"
        doubt = f"{simplest.name} is between {low} and {high} worse than the best model."
        return doubt, f"More of the same motion: {words}."
    if recordings < FEWEST:
        parts = f"The folds are parts of {recordings} recording{'s' * (recordings > 1)}"
        return f"{parts}: another one may say something else.", WHOLE
    share = data.value(model.model, rollout(data.reported[-1], "diverged"))
    if share >= 0.01:
        horizon = seconds(data.reported[-1])
        doubt = f"{percent(share)} of its predictions diverge within {horizon}."
        return doubt, "Motion like that from which they start."
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
