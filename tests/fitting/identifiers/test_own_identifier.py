"""The documentation's identifier of one's own: short, whole, and as good as ours on its own law."""

import sys
from importlib import import_module

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.compared import compare
from fixtures.paths import ROOT

from frictionid.comparison.registry import LAWS
from frictionid.comparison.suite import IdentifierEntry, identifier_of
from frictionid.comparison.tasks import prepare_benchmarks, run_tasks
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.files import read_json
from frictionid.fitting.identifiers import Frictionless, check_identifier
from frictionid.fitting.one_step.formulation import INTEGRAL, STUDY, problem_of
from frictionid.friction import Friction, along
from frictionid.friction.laws import check_law

FILE = ROOT / "comparisons" / "own_friction.py"


@pytest.fixture
def own(monkeypatch):
    """The identifier as a suite in comparisons/ names it."""
    monkeypatch.setattr(sys, "path", list(sys.path))  # a suite adds its folder to it
    table = IdentifierEntry.model_validate({"kind": "own_friction:quadratic", "width": 0.01})
    name, identifier, only = identifier_of(table, FILE.parent, [STUDY, INTEGRAL], trust=True)
    assert (name, only) == ("quadratic", None)
    return identifier


def test_the_page_shows_this_file_and_it_has_under_forty_lines():
    text = FILE.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 40
    assert f"```python\n{text}```" in (ROOT / "docs" / "python" / "own_law.md").read_text("utf-8")


def test_the_identifier_of_the_documentation_keeps_to_the_protocol(tmp_path, monkeypatch):
    page = (ROOT / "docs" / "identifiers.md").read_text(encoding="utf-8")
    code = page.split("```python\n")[1].split("```")[0]
    (tmp_path / "viscous_of_the_docs.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    check_identifier(import_module("viscous_of_the_docs").Viscous())


def test_it_keeps_to_the_contracts(own):
    check_identifier(own)
    check_law(own.law)  # type: ignore[attr-defined]


def test_it_finds_the_numbers_of_its_own_law(own):
    """On real rows of the acrobot whose residuals are made of a known quadratic friction."""
    dataset = load_dataset(ROOT / "data" / "acrobot_clean")
    problem = problem_of(dataset, plant_of(dataset), INTEGRAL)
    true = np.array([[0.16, 0.01, 0.003], [0.05, 0.002, 0.0004]])
    law = own.law  # type: ignore[attr-defined]
    pulled = problem.r - problem.residual(along(Friction(law, true), problem.nodes))
    exact = type(problem)(**{**vars(problem), "r": pulled})
    fitted = own.fit(exact, np.ones((1, len(pulled))), 0)
    np.testing.assert_allclose(fitted.theta[0], true, rtol=1e-6)


def test_it_takes_part_in_a_comparison_side_by_side_with_ours(own):
    dataset = tiny.dataset()
    folds = make_folds(dataset.recordings, Split(count=3))
    protocol = Protocol(horizons=(0.1, 0.3))
    results = compare(dataset, {"none": Frictionless(), "own": own}, folds, protocol=protocol)
    theirs, ours = (results[name, "integral"] for name in ("none", "own"))
    assert ours.friction.theta.shape == (3, 1, 3)
    far = [r.value("rollout_angle", "median", 0.3) for r in (ours, theirs)]
    assert far[0] < far[1] / 2


def test_a_suite_beside_its_file_runs_it_in_worker_processes(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "own_friction", raising=False)
    (tmp_path / FILE.name).write_text(FILE.read_text(encoding="utf-8"), encoding="utf-8")
    entries = [{"kind": "own_friction:quadratic"}, {"kind": "none"}]
    tiny.write_suite(tmp_path, [("identifiers", entries), ("recipes", [{"name": "integral"}])])
    tasks = tiny.tasks_in(tmp_path / "suite.toml")
    run_tasks(tasks, prepare_benchmarks(tasks), tmp_path / "tasks", LAWS, jobs=2)
    own = tmp_path / "tasks" / "tiny--quadratic--integral--seed0.json"
    model = read_json(own)["model"]
    assert model["law"] == {"kind": "Quadratic", "width": 0.02}
    assert model["joints"][0]["drag"]["unit"] == "N m s^2/rad^2"
    assert model["joints"][0]["coulomb"]["value"] > 0.01
