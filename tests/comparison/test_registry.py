"""Kinds: settings are the fields of dataclasses; every law has a name, a file and a page."""

import inspect
import re
from dataclasses import MISSING, fields
from pathlib import Path

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from numpy.testing import assert_array_equal

from frictionid.comparison.registry import ESTIMATORS, IDENTIFIERS
from frictionid.comparison.suite import PROTOCOL, SPLIT
from frictionid.comparison.suite_recipes import SHOOTING
from frictionid.friction import Friction
from frictionid.friction.laws import check_law
from frictionid.friction.model_files import LAWS, load_model, save_model

REQUIRED = {"gear_load": {"moment": 0.1}, "sklearn": {"estimator": "knn"}}
KINDS = {
    **{name: kind for name, kind in IDENTIFIERS.items() if name != "published"},
    **ESTIMATORS,
    **{"split": SPLIT, "protocol": PROTOCOL, "shooting": SHOOTING},
}


def default_settings(name):
    """Defaults as a suite would write them, without those that TOML cannot write."""
    defaults = KINDS[name].defaults(REQUIRED.get(name, {}))
    return {k: v for k, v in defaults.items() if isinstance(v, bool | int | float | str | tuple)}


@pytest.mark.parametrize("name", KINDS)
def test_defaults_written_out_make_the_same(name):
    required = REQUIRED.get(name, {})
    written = KINDS[name].build({**required, **default_settings(name)}, name)
    assert repr(written) == repr(KINDS[name].build(required, name))


@pytest.mark.parametrize("name", KINDS)
def test_a_table_is_no_value_of_any_setting(name):
    for key in set(KINDS[name].settings) - {"settings"}:
        with assert_refused(key):
            KINDS[name].build({**REQUIRED.get(name, {}), key: {"x": 1}}, name)


def test_settings_of_parts_that_are_not_chosen_are_refused_with_the_choice():
    mlp = IDENTIFIERS["mlp"]
    with assert_refused('epochs = 5 needs solver = "adam"'):
        mlp.build({"epochs": 5}, "mlp")
    assert mlp.build({"epochs": mlp.build({"solver": "adam"}, "mlp").epochs}, "mlp")
    assert mlp.build({"epochs": 5, "inputs": "all"}, "mlp").epochs == 5
    with assert_refused('nodes = 9 needs solver = "levenberg_marquardt"'):
        mlp.build({"nodes": 9, "solver": "adam"}, "mlp")


@pytest.mark.parametrize("name", LAWS)
def test_every_law_satisfies_the_protocol_and_survives_its_file(name, tmp_path):
    needed = [f for f in fields(LAWS[name]) if f.default is MISSING]
    law = LAWS[name](*(0.5 for _ in needed))
    check_law(law, level=not name.startswith("state_"))
    theta = np.array([law.initial[0]] * 2) + 0.0
    save_model(Friction(law, theta), tmp_path / "model.json")
    again = load_model(tmp_path / "model.json")
    assert again.law == law
    assert_array_equal(again.theta, theta)


REFERENCES = Path(__file__).parents[2] / "docs/references.md"
OF_THEIR_LAWS = {"none", "per_joint"}  # no friction, and other laws: there is no source of theirs


@pytest.mark.parametrize("name", LAWS)
def test_every_law_has_its_equation_and_a_source(name):
    """In its own words or those of its file, and the source is in the list of references."""
    words = f"{inspect.getdoc(LAWS[name])} {inspect.getdoc(inspect.getmodule(LAWS[name]))}"
    assert re.search(r"\bTf(_j)? = ", words)
    sources = re.findall(r"\[([A-Z][A-Za-z]+\d{4})\]", words)
    assert sources or name in OF_THEIR_LAWS, "name a source in the docstring, as [Olsson1998]"
    listed = REFERENCES.read_text(encoding="utf-8")
    assert all(f"- [{source}]" in listed for source in sources)


def test_the_page_of_laws_has_every_law():
    page = REFERENCES.with_name("laws.md").read_text(encoding="utf-8")
    networks = REFERENCES.with_name("identifiers.md").read_text(encoding="utf-8")
    for name in LAWS:
        assert f"`{name}`" in page or f"`{name}`" in networks, name
