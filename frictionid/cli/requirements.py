"""What a script requires of a verdict: exit status 0 where it is met, 1 where it is not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from frictionid.comparison.results import Results


def check_requirements(requirements: Sequence[str] | None) -> None:
    """Refuse requirements that no verdict could meet, before anything is computed."""
    from frictionid.report.verdict_document import check_requirement

    for requirement in requirements or ():
        check_requirement(requirement)


def exit_unless_met(results: Results, requirements: Sequence[str] | None) -> None:
    """Say on standard error which requirements the verdicts do not meet, and exit with 1."""
    from frictionid.report.sections import sections_of
    from frictionid.report.verdict import verdict_of
    from frictionid.report.verdict_document import unmet

    if not requirements:
        return
    verdicts = [verdict_of(section) for section in sections_of(results)]
    lines = [(wanted, line) for wanted in requirements for line in unmet(verdicts, wanted)]
    for wanted, line in lines:
        typer.echo(f"frictionid: {line}, not {wanted.rpartition('=')[2]}", err=True)
    if lines:
        raise typer.Exit(1)
