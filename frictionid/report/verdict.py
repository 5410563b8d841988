"""The verdict: which model the evidence supports, by a stated rule, and how sure that is.

Models that were fitted by one recipe are compared with the best of them by their predictions from
the same held-out starts, half a second ahead or at the nearest reported horizon; fits of arms to
their torques by the torque that they leave. The simplest that is not practically worse is
recommended, refined by shooting where it was (`frictionid.evaluation.reference_model`).
"""

import json
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.evaluation.reference_model import CERTAIN, WITHIN, Choice, Factor
from frictionid.evaluation.statistics import FEWEST, REGION
from frictionid.files import plain

from .candidates import Candidate, Measure, candidates_of, contrast, judged, recipe_to_judge, under
from .numbers import added, factor
from .plausibility import FAILED, NOT_EVALUATED
from .questions import QUESTIONS, Asked, Question, questions_to, unanswered
from .sections import ANY, Model, Section, SummaryData, rollout
from .tables import lines_of, render

HORIZON = 0.5  # [s]
RECOMMENDED, SIMPLE, UNDECIDED = "recommended", "simple_enough", "undecided"
KINDS = (RECOMMENDED, SIMPLE, UNDECIDED, NOT_EVALUATED)
STRAY = 10.0  # times as far off as in most recordings: one that needs a look
MANY = 10  # times as many recordings: beyond that their number says little
MODEL = "Which friction model do these data support?"
WHOLE = "At least three recordings, so that each can be held out as a whole."


class Verdict(NamedTuple):
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
    horizon : [s] of the predictions that are compared, NaN where the torque left is
    error, unit : median error of the provisional model's predictions, or the share of torque left
    region : a tenth of the reference's error, in the same unit
    recipe : by which the models that are compared were fitted
    folds, recordings : how many there are behind it
    candidates : all models that can be recommended, from the simplest to the most complex
    identified : what richer laws show beyond the recommended one that makes no practical difference
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
    recipe: str = ANY
    folds: int = 0
    recordings: int = 0
    candidates: tuple[Candidate, ...] = ()
    identified: str = ""
    main_doubt: str = ""
    record_next: str = WHOLE
    questions: tuple[Question, ...] = ()

    @property
    def measure(self) -> Measure:
        """What models are judged by."""
        return Measure(self.horizon, self.unit)

    @property
    def failed(self) -> dict[Model, tuple[str, ...]]:
        """Names of the checks that models fail, see `frictionid.report.plausibility.Check`."""
        names = {
            c.model: tuple(k.name for k in c.checks if k.outcome == FAILED) for c in self.candidates
        }
        return {model: checks for model, checks in names.items() if checks}

    @property
    def compared(self) -> tuple[Candidate, ...]:
        """The candidates that are compared: those of the recipe."""
        return tuple(c for c in self.candidates if c.standing)

    def candidate(self, name: str | None) -> Candidate | None:
        """The candidate of a name; None where there is none."""
        return next((c for c in self.candidates if c.name == name), None)


@lru_cache(maxsize=4)  # each picture and table asks for it
def verdict_of(section: Section) -> Verdict:
    """The verdict on the models that were fitted to a data set."""
    data, choice = section.fitted, Choice()
    measure = measure_of(data)
    candidates = candidates_of(data, measure)
    folds = max((len(c.by_fold) for c in candidates), default=0)
    groups = max((len(np.unique(c.errors.group)) for c in candidates), default=0)
    recipe = recipe_to_judge(candidates)
    if not data.reported and not groups:
        reason = "the comparison predicts no motion"
    elif groups < FEWEST:
        reason = f"errors are known of {groups} recordings or folds, and {FEWEST} are needed"
    else:
        reason = "no model's predictions are finite in every recording"
        of_recipe = [c for c in under(candidates, recipe) if len(c.errors.group)]
        others = [c for c in candidates if c not in of_recipe]
        choice, compared = judged(of_recipe, others)
        candidates = [*compared, *others]
    verdict = Verdict(
        dataset=data.dataset,
        horizon=measure.horizon,
        unit=measure.unit,
        recipe=recipe,
        folds=folds,
        recordings=data.description.recordings,
        candidates=tuple(sorted(candidates, key=lambda c: (c.complexity, c.error))),
    )
    if choice.best is not None:
        return _decided(section, verdict, choice, [c for c in candidates if c.standing])
    sentence = f"No verdict: {reason}."
    question = Question("model", MODEL, NOT_EVALUATED, sentence, {})
    return verdict._replace(
        sentence=sentence,
        main_doubt=f"{reason[0].upper()}{reason[1:]}.",
        questions=(question, *unanswered(reason)),
    )


def measure_of(data: SummaryData) -> Measure:
    """What models of a data set are judged by: fits to torques by the torque that they leave."""
    fits = [m for m in data.models if m.scheme == "inverse dynamics" and m.role == "fitted"]
    if any(len(m.start_errors(Measure().horizon).group) for m in fits):
        return Measure()
    horizon = min(data.reported, key=lambda h: abs(h - HORIZON), default=float("nan"))
    return Measure(horizon, data.description.angle_unit)


def _decided(
    section: Section, verdict: Verdict, choice: Choice, compared: Sequence[Candidate]
) -> Verdict:
    """The verdict with what was chosen of the candidates, which are in the choice's order."""
    assert choice.best is not None and choice.simplest is not None and choice.adequate is not None
    simplest, adequate = compared[choice.simplest], compared[choice.adequate]
    provisional = _refined(adequate, verdict.candidates)
    kind, coarser = UNDECIDED, _coarser(simplest, provisional, verdict.candidates)
    if choice.recommended is not None or coarser:
        kind = SIMPLE if _is_simplest(adequate, compared) else RECOMMENDED
    recommended = None if kind == UNDECIDED else provisional.name
    error = verdict.measure.words(provisional.error)
    several = len({c.model.recipe for c in verdict.candidates} - {ANY}) > 1
    good = [c for c in compared if c.standing in ("best", "adequate") and c is not adequate]
    context = {
        "kind": kind,
        "model": provisional.name,
        "adequate": adequate.name,
        "simplest": simplest.name,
        "coarser": "" if choice.recommended is not None else coarser,
        "error": error,
        "within": f"by recipe {verdict.recipe}, " if several else "",
        "others": len(compared) - 1,
        "worse": sum(c.standing in ("worse", "diverged") for c in compared),
        "unfit": [c.name for c in good if c.implausible],
        "lacking": [compared[i].name for i in choice.lacking],
        "preferred": choice.preferred is not None,
        "degenerate": "" if choice.degenerate is None else compared[choice.degenerate].name,
        "contradicted": [c.name for c in compared if c.loss and c.loss.contradicted],
    }
    sentence = render("sentence.j2", context, markup=False).strip()
    evidence = {"error": provisional.error}
    question = Question("model", MODEL, recommended or UNDECIDED, sentence, evidence)
    asked = Asked(section, verdict.candidates, provisional, verdict.measure)
    doubt, remedy = _doubt(section, kind, provisional, simplest)
    return verdict._replace(
        kind=kind,
        recommended=recommended,
        provisional=provisional.name,
        sentence=sentence,
        error=provisional.error,
        region=REGION * compared[choice.best].error,
        identified="" if kind == UNDECIDED else _identified(provisional, verdict.candidates),
        main_doubt=doubt,
        record_next=remedy,
        questions=(question, *questions_to(asked)),
    )


def _refined(chosen: Candidate, candidates: Sequence[Candidate]) -> Candidate:
    """The same identifier fitted by shooting, where that is not shown to be practically worse."""
    twins = [c for c in candidates if c.model.label == chosen.model.label and c.model.refined]
    finer = [c for c in twins if c.is_finite and not c.unfit and not _farther(c, chosen)]
    return min(finer, key=lambda c: c.level, default=chosen)


def _farther(candidate: Candidate, other: Candidate) -> str:
    """By which factor a candidate is practically farther off than another; "" where it is not."""
    against = contrast([candidate], [other])
    return times(against.factor) if against and against.answer == "yes" else ""


def _coarser(simple: Candidate, refined: Candidate, candidates: Sequence[Candidate]) -> str:
    """By which factor a model that nothing refined is practically farther off than a refined one.

    "" where it is not, or was refined itself: then both are judged by the same recipe.
    """
    if refined.model.refined is None or _refined(simple, candidates) is not simple:
        return ""
    return _farther(simple, refined)


def _identified(chosen: Candidate, candidates: Sequence[Candidate]) -> str:
    """What richer laws by the same recipe show, see `added`."""
    if chosen.model.refined is None:
        return ""
    richer = [c for c in candidates if c.model.recipe == chosen.model.recipe and c is not chosen]
    others = {c.model.label: c.model.refined for c in richer if c.model.refined and not c.unfit}
    return added(chosen.model.refined, others)


def _is_simplest(candidate: Candidate, compared: Sequence[Candidate]) -> bool:
    """Whether no fitted model with friction is simpler, and some model is more complex."""
    simpler = [c for c in compared if c.complexity < candidate.complexity]
    richer = any(c.complexity > candidate.complexity for c in compared)
    return richer and all(c.model.role != "fitted" for c in simpler)


def _doubt(section: Section, kind: str, model: Candidate, simplest: Candidate) -> tuple[str, str]:
    """What speaks most against the verdict, and what to record next, a sentence each."""
    data = section.fitted
    recordings = data.description.recordings
    last = data.reported[-1] if data.reported else float("nan")
    undecided = simplest.loss if kind == UNDECIDED else None
    means, which = model.errors.means, np.unique(model.errors.group)
    farther = float(means.max() / np.median(means))
    context = {
        "model": model,
        "simplest": simplest,
        "undecided": undecided and times(undecided.factor),
        "needed": undecided and recordings_needed(recordings, undecided.factor),
        "recordings": recordings,
        "stray": int(which[means.argmax()]) + 1 if farther > STRAY else None,
        "farther": factor(farther),
        "fewest": FEWEST,
        "many": MANY,
        "share": data.value(model.model, rollout(last, "diverged")),
        "last": last,
        "tests": len(section.tests),
        "whole": WHOLE,
    }
    doubt, remedy = lines_of(render("doubt.j2", context, markup=False))
    return doubt, remedy


def times(between: Factor) -> str:
    """The 80 % interval of a factor: "1.1 to 1.4"."""
    return f"{factor(between.low)} to {factor(between.high)}"


def recordings_needed(recordings: int, between: Factor) -> int:
    """How many recordings would decide, about: errors fall with the root of their number.

    >>> recordings_needed(10, Factor(1.15, 1.05, 1.27, 0.8, 0.0, 10))
    46
    """
    apart = abs(np.log(between.value) - WITHIN)
    half = 0.5 * np.log(between.high / between.low)
    return max(recordings + 1, round(min(recordings * (half / apart) ** 2, 1e6)))


def chosen_of(section: Section) -> Model | None:
    """The model that the verdict names; without one the fitted model that predicts best."""
    verdict = verdict_of(section)
    candidate = verdict.candidate(verdict.provisional)
    if candidate is not None:
        return candidate.model
    data = section.fitted
    return data.best(data.of_role("fitted"), data.last_rollout)


# --- As a document --------------------------------------------------------------------------------

FORMAT = "frictionid verdict 1"


def verdict_json(verdicts: Sequence[Verdict]) -> str:
    """Text of verdict.json: all data sets that were fitted; null for what is not finite."""
    document = {
        "format": FORMAT,
        "rule": {"region": REGION, "probability": CERTAIN},
        "datasets": [
            {
                **verdict._asdict(),
                "candidates": list(map(_candidate, verdict.candidates)),
            }
            for verdict in verdicts
        ],
    }
    document = plain(document, infinity=None)
    return json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)


def _candidate(candidate: Candidate) -> dict[str, Any]:
    model, fields = candidate.model, dict(vars(candidate))
    del fields["model"], fields["errors"]
    names = {key: getattr(model, key) for key in ("name", "identifier", "recipe", "role")}
    return {**names, "implausible": candidate.implausible, **fields}


# --- What scripts may require ---------------------------------------------------------------------


def check_requirement(requirement: str) -> None:
    """Check a requirement before anything is computed: a kind of verdict, or QUESTION=ANSWER."""
    question, equals, _ = requirement.partition("=")
    allowed = QUESTIONS if equals else KINDS
    if question not in allowed:
        rule = "no question" if equals else "no kind of verdict, nor QUESTION=ANSWER"
        raise InputError(f"--require {requirement}: is {rule}; {nearest(question, allowed)}")


def unmet(verdicts: Sequence[Verdict], requirement: str) -> list[str]:
    """What the verdicts say instead of a requirement, a line for each data set that does not meet.

    Every data set that was fitted has to meet it. A recommended model meets "recommended" even
    where it is the simplest one.
    """
    check_requirement(requirement)
    name, equals, wanted = requirement.partition("=")
    out = []
    for verdict in verdicts:
        if equals:
            answer = next(q.answer for q in verdict.questions if q.name == name)
            met = answer == wanted
        else:
            answer = verdict.kind
            met = answer == name or (name == RECOMMENDED and verdict.recommended is not None)
        if not met:
            out.append(f"{verdict.dataset}: {name if equals else 'verdict'} is {answer}")
    return out
