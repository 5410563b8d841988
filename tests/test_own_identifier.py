"""The README's identifier of one's own: short, whole, and as good as ours on its own law."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from frictionid.friction import Friction, along
from frictionid.identifiers import Identifier, check_identifier
from frictionid.laws import check_law
from frictionid.mechanics import plant_of
from frictionid.readers.dataset import load_dataset
from frictionid.recipe import INTEGRAL, STUDY, problem_of
from frictionid.suite import IdentifierEntry, identifier_of

ROOT = Path(__file__).parents[1]
FILE = ROOT / "comparisons" / "own_friction.py"


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> Identifier:
    """The identifier as a suite in comparisons/ names it."""
    monkeypatch.setattr(sys, "path", list(sys.path))  # a suite adds its folder to it
    table = IdentifierEntry.model_validate({"kind": "own_friction:quadratic", "width": 0.01})
    name, identifier, only = identifier_of(table, FILE.parent, [STUDY, INTEGRAL])
    assert (name, only) == ("quadratic", None)
    return identifier


def test_the_readme_shows_this_file_and_it_has_under_forty_lines() -> None:
    text = FILE.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 40
    assert f"```python\n{text}```" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_it_keeps_to_the_contracts(own: Identifier) -> None:
    check_identifier(own)
    check_law(own.law)  # type: ignore[attr-defined]


def test_it_finds_the_numbers_of_its_own_law(own: Identifier) -> None:
    """On real rows of the acrobot whose residuals are made of a known quadratic friction."""
    dataset = load_dataset(ROOT / "data" / "acrobot_clean")
    problem = problem_of(dataset, plant_of(dataset), INTEGRAL)
    true = np.array([[0.16, 0.003], [0.05, 0.0004]])
    law = own.law  # type: ignore[attr-defined]
    pulled = problem.r - problem.residual(along(Friction(law, true), problem.nodes))
    exact = type(problem)(**{**vars(problem), "r": pulled})
    fitted = own.fit(exact, np.ones((1, len(pulled))), 0)
    np.testing.assert_allclose(fitted.theta[0], true, rtol=1e-6)
