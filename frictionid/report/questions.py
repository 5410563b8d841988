"""Questions that a comparison answers, each by the rule of the verdict, or says why it cannot.

Models are compared with models of the same recipe: another one corrects the data otherwise.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import rms
from frictionid.evaluation.curves import torque_size

from .candidates import Candidate, Measure, contrast, family, under
from .memory import has_memory
from .numbers import MINUS, factor, percent
from .plausibility import FAILED, NOT_EVALUATED, NOTED, PASSED
from .sections import ANY, EULER, Model, Section

NEAR = 0.1  # curve error up to which a friction curve is trusted
DISSIPATION = ("dissipation", "cycle_work")  # checks
LEVELS_ONLY = ("coulomb_viscous",)  # laws, by their names in files


class Question(NamedTuple):
    """A question to the comparison: its answer, or "not_evaluated", and the reason in a sentence.

    evidence : numbers behind the answer, by their names
    """

    name: str
    question: str
    answer: str
    reason: str
    evidence: Mapping[str, float]


class Asked(NamedTuple):
    """What the questions are put to.

    candidates : of the fitted data; recommended : the one that is used until further data decide
    measure : by what they are compared
    """

    section: Section
    candidates: Sequence[Candidate]
    recommended: Candidate
    measure: Measure

    def group(self, traits: set[str]) -> list[Candidate]:
        """Candidates with all of these traits."""
        return [c for c in self.candidates if traits <= traits_of(c.model)]


def traits_of(model: Model) -> set[str]:
    """What groups of candidates are made of: role, family, and what its friction is like.

    "mechanics" : textbook or learned friction within physics; "friction" : the same, if it has any
    "levels" : Coulomb and viscous friction alone, else "beyond"; "memory" or "no memory"
    """
    name, law = family(model), model.document.get("law", {}).get("kind")
    traits = {model.role, name, "memory" if has_memory(model) else "no memory"}
    traits.add("levels" if law in LEVELS_ONLY else "beyond")
    if name in ("physics", "hybrid"):
        traits |= {"mechanics"} if model.role == "none" else {"mechanics", "friction"}
    return traits


Answer = tuple[str, str, Mapping[str, float]]


def questions_to(asked: Asked) -> tuple[Question, ...]:
    """All questions with their answers."""
    return tuple(
        Question(name, words, *answer(asked)) for name, (words, answer) in _QUESTIONS.items()
    )


def unanswered(reason: str) -> tuple[Question, ...]:
    """All questions where nothing could be compared, with the reason."""
    return tuple(
        Question(name, words, NOT_EVALUATED, reason, {}) for name, (words, _) in _QUESTIONS.items()
    )


def _nothing(reason: str) -> Answer:
    return NOT_EVALUATED, reason, {}


def _contrast(
    asked: Asked, first: Sequence[Candidate], second: Sequence[Candidate], missing: str
) -> Answer:
    """Whether the best of the second group is practically better than the best of the first.

    Within the recipe that fitted both, of several that of the lowest error.
    """
    # what no recipe changes belongs to each of them
    recipes = dict.fromkeys(c.model.recipe for c in (*first, *second))
    shared = [r for r in recipes if under(first, r) and under(second, r)]
    contrasts = {r: contrast(under(first, r), under(second, r)) for r in shared}
    judged = {r: c for r, c in contrasts.items() if c is not None}
    if not judged:
        apart = first and second and not shared
        return _nothing("no recipe fitted both: fit them by the same one." if apart else missing)
    recipe = min(judged, key=lambda r: min(judged[r].first.level, judged[r].second.level))
    a, b, between = judged[recipe].first, judged[recipe].second, judged[recipe].factor
    several = len({c.model.recipe for c in asked.candidates} - {ANY}) > 1
    within = f"by recipe {recipe} " if several and recipe else ""
    worse, better, shown = (a, b, between) if between.value >= 1 else (b, a, between.turned)
    middle, low, high = map(factor, shown[:3])
    names = [c.model.label if within else c.name for c in (worse, better)]
    errors = " and ".join(asked.measure.size(c.level) for c in (worse, better))
    reason = (
        f"{within}{names[0]} is {middle} times (80 %: {low} to {high}) as far off as {names[1]}; "
        f"geometric means of errors: {errors}."
    )
    return judged[recipe].answer, reason, between._asdict()


def _between(first: set[str], second: set[str], missing: str) -> Callable[[Asked], Answer]:
    """The answer of the contrast of two groups, by their traits."""
    return lambda asked: _contrast(asked, asked.group(first), asked.group(second), missing)


def _turned(answer: Answer) -> Answer:
    return {"yes": "no", "no": "yes"}.get(answer[0], answer[0]), *answer[1:]


def percent_of(share: float) -> str:
    """A share with its sign in per cent, two significant digits below ten.

    >>> percent_of(0.123), percent_of(-0.012), percent_of(4.5)
    ('12 %', '−1.2 %', '450 %')
    """
    size = 100 * abs(share)
    return f"{MINUS if share < 0 else ''}{size:.{int(size < 10)}f} %"


# --- More than a contrast of two groups -----------------------------------------------------------


def _loss(asked: Asked) -> Answer:
    """Whether the lowest one-step loss of the recipe with most models is that of a good model."""
    data, fitted = asked.section.fitted, [c for c in asked.group({"fitted"}) if c.is_finite]
    groups = [under(fitted, recipe) for recipe in {c.model.recipe: None for c in fitted}]
    rivals = max(groups, key=lambda g: (len(g), -min(c.level for c in g)), default=[])
    if len(rivals) < 2:
        return _nothing("needs two models that were fitted by one recipe.")
    lowest = data.best([c.model for c in rivals], EULER)
    first = [c for c in rivals if c.model is lowest]
    if not first:
        return _nothing("no loss is finite.")
    others = [c for c in rivals if c is not first[0]]
    answer, reason, evidence = _turned(_contrast(asked, first, others, "no other is finite."))
    return answer, f"Of the lowest one-step loss is {first[0].name}; {reason}", evidence


def _dissipative(asked: Asked) -> Answer:
    """Whether friction opposes motion at all speeds that were measured, and over closed cycles."""
    model = asked.recommended
    checks = [c for c in model.checks if c.name in DISSIPATION and c.outcome != NOT_EVALUATED]
    if not checks:
        return _nothing(f"{model.name} has no friction torque.")
    evidence = {check.name: check.value for check in checks}
    worst = min(checks, key=lambda check: (check.outcome != FAILED, check.outcome != NOTED))
    answer = {FAILED: "no", NOTED: "undecided"}.get(worst.outcome, "yes")
    return answer, f"{model.name} {worst.statement}.", evidence


def _hysteresis(asked: Asked) -> Answer:
    """Whether models with memory show hysteresis that a control without memory does not explain.

    Those of the verdict's recipe, where it has some: a clock that is off looks like memory.
    """
    remembering = [c for c in asked.candidates if has_memory(c.model)]
    compared = [c for c in remembering if c.standing] or remembering
    judged = {
        c.name: check
        for c in compared
        for check in c.checks
        if check.name == "hysteresis" and check.outcome != NOT_EVALUATED
    }
    if not judged:
        return _nothing("needs a model with memory, and one without as its control.")
    evidence = {name: check.value for name, check in judged.items()}
    open_ones = [name for name, check in judged.items() if "shows hysteresis of" in check.statement]
    if not open_ones:
        return "no", "no model with memory shows hysteresis beyond its folds.", evidence
    shown = [name for name in open_ones if judged[name].outcome == PASSED]
    name = (shown or open_ones)[0]
    answer = "yes" if shown else "no" if judged[name].outcome == FAILED else "undecided"
    return answer, f"{name} {judged[name].statement}.", evidence


def _curve(asked: Asked) -> Answer:
    data, model = asked.section.fitted, asked.recommended.model
    folds = model.curves[:-1]
    if not np.isfinite(model.curves).all() or len(folds) < 2:
        return _nothing(f"{model.name} has no friction curve.")
    middle = folds.mean(axis=0)
    scatter = float(np.max(rms(folds - middle, (0, 1)) / torque_size(middle)))
    errors = [e for e in data.curve_errors(model) if np.isfinite(e)]
    evidence = {"scatter": scatter} | {f"error_{j}": e for j, e in enumerate(errors, 1)}
    if errors:
        worst = max(errors)
        answer = "yes" if worst <= NEAR else "no"
        return answer, f"{model.name} is {percent_of(worst)} off the true curve at most.", evidence
    if scatter > NEAR:
        return "no", f"the folds' curves of {model.name} scatter by {percent(scatter)}.", evidence
    return (
        NOT_EVALUATED,
        f"no truth: the folds' curves agree within {percent(scatter)}, which bounds no bias.",
        evidence,
    )


def _truth(asked: Asked) -> Answer:
    data = asked.section.fitted
    if not data.of_role("truth"):
        return _nothing("no truth is known.")
    model = data.of_role("truth")[0]
    errors = model.start_errors(asked.measure.horizon)
    # its errors alone are compared
    truth = [Candidate(model, float("nan"), np.empty(0), errors, 0.0)]
    missing = "the truth has no scores of its own."
    return _turned(_contrast(asked, [asked.recommended], truth, missing))


def _unseen(asked: Asked) -> Answer:
    """Whether the recommended model is within 10 % of the best one on every data set never seen."""
    model, evidence = asked.recommended.model, {}
    for data in asked.section.tests:
        rivals = [c.model for c in asked.candidates if c.model in data.models]
        column = asked.measure.column if data.reported else ""
        best = data.best(rivals, column)
        if best is not None:
            evidence[data.dataset] = data.value(model, column) / data.value(best, column) - 1.0
    if not evidence:
        return _nothing("no held-out data set: every recording was part of the fits.")
    worst = max(evidence, key=lambda name: evidence[name])
    answer = "yes" if evidence[worst] <= NEAR else "no"
    return (
        answer,
        f"on {worst} {model.name} is {percent_of(evidence[worst])} worse than the best model "
        "there; one number each, so that chance is not known.",
        evidence,
    )


def _recordings(asked: Asked) -> Answer:
    count = asked.section.description.recordings
    if count < 2:
        return _nothing("one recording: its parts say nothing about another one.")
    folds = float(len(asked.recommended.by_fold))
    return "yes", f"{count} recordings are behind the folds.", {"recordings": count, "folds": folds}


_QUESTIONS: Mapping[str, tuple[str, Callable[[Asked], Answer]]] = {
    "friction": (
        "Does friction matter for these predictions?",
        _between(
            {"none"},
            {"friction"},
            "no model without friction was compared, or none with it.",
        ),
    ),
    "beyond_coulomb_viscous": (
        "Does friction depend on velocity beyond Coulomb and viscous levels?",
        _between(
            {"friction", "no memory", "levels"},
            {"friction", "no memory", "beyond"},
            "needs Coulomb and viscous friction, and a law beyond it.",
        ),
    ),
    "memory": (
        "Does friction with memory predict better than friction without?",
        _between(
            {"friction", "no memory"},
            {"friction", "memory"},
            "needs a model with memory and one without.",
        ),
    ),
    "hysteresis": ("Is hysteresis in these data, beyond a control without memory?", _hysteresis),
    "hybrids": (
        "Do hybrids, physics with learned friction, beat textbook friction?",
        _between({"physics"}, {"hybrid"}, "needs textbook friction and learned friction."),
    ),
    "physics": (
        "Do models with physics beat models without?",
        _between({"black box"}, {"mechanics"}, "no model without physics was compared."),
    ),
    "published": (
        "Do the fitted models beat the published ones?",
        _between({"given"}, {"fitted"}, "no published model was compared."),
    ),
    "loss": ("Does the lowest one-step loss belong to a model that predicts well?", _loss),
    "dissipative": ("Does the recommended model only take energy?", _dissipative),
    "curve": ("Can the friction curve of the recommended model be trusted?", _curve),
    "truth": ("Does the recommended model predict as well as the true friction?", _truth),
    "unseen": ("Is it as good as the best model on data that no fit has seen?", _unseen),
    "recordings": ("Is the verdict about recordings, not about parts of one?", _recordings),
}
QUESTIONS = ("model", *_QUESTIONS)
