"""The verdict as a document, verdict.json of a result folder, and what scripts may require."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.evaluation.statistics import CERTAIN, REGION
from frictionid.files import plain
from frictionid.report.candidates import Candidate
from frictionid.report.questions import QUESTIONS
from frictionid.report.verdict import KINDS, Verdict

FORMAT = "frictionid verdict 1"


def verdict_document(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Document of the verdicts on all data sets that were fitted; null for what is not finite."""
    document = {
        "format": FORMAT,
        "rule": {"region": REGION, "probability": CERTAIN},
        "datasets": [_dataset(verdict) for verdict in verdicts],
    }
    out: dict[str, Any] = plain(document, infinity=None)
    return out


def verdict_json(verdicts: Sequence[Verdict]) -> str:
    """Text of verdict.json."""
    return json.dumps(verdict_document(verdicts), indent=1, allow_nan=False, ensure_ascii=False)


def _dataset(verdict: Verdict) -> dict[str, Any]:
    fields = {name: value for name, value in vars(verdict).items()}
    fields["candidates"] = [_candidate(candidate) for candidate in verdict.candidates]
    fields["questions"] = [vars(question) for question in verdict.questions]
    return fields


def _candidate(candidate: Candidate) -> dict[str, Any]:
    model, fields = candidate.model, dict(vars(candidate))
    del fields["model"]
    for name in ("against_best", "against_provisional"):
        fields[name] = fields[name] and fields[name]._asdict()
    known = {"name": model.name, "identifier": model.identifier, "recipe": model.recipe}
    wrong = {"error": candidate.error, "implausible": candidate.implausible}
    return {**known, "role": model.role, **wrong, **fields}


# --- What scripts may require ---------------------------------------------------------------------


def check_requirement(requirement: str) -> None:
    """Check a requirement before anything is computed: a kind of verdict, or QUESTION=ANSWER.

    Raises
    ------
    InputError
        Where it is neither.
    """
    question, equals, _ = requirement.partition("=")
    known = QUESTIONS if equals else KINDS
    if question not in known:
        rule = "no question" if equals else "no kind of verdict, nor QUESTION=ANSWER"
        raise InputError(f"--require {requirement}: is {rule}; {nearest(question, known)}")


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
            found = next((q.answer for q in verdict.questions if q.name == name), "not_evaluated")
            met = found == wanted
        else:
            found = verdict.kind
            met = found == name or (name == "recommended" and verdict.recommended is not None)
        if not met:
            out.append(f"{verdict.dataset}: {name if equals else 'verdict'} is {found}")
    return out
