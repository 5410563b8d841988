"""Every law has a name for model files, and suites choose between its forms."""

from dataclasses import MISSING, fields

import numpy as np
import pytest

from frictionid.comparison.registry import LAWS
from frictionid.comparison.suite_identifiers import identifier_named
from frictionid.friction import Friction
from frictionid.friction.laws import (
    AsymmetricCoulombViscous,
    AsymmetricFilmLag,
    AsymmetricLuGre,
    Dahl,
    FilmLag,
    LoadDependent,
    LoadDependentStribeck,
    LuGre,
    Quadratic,
    check_law,
)
from frictionid.friction.model_files import load_model, save_model
from frictionid.identifiers import LeastSquares


@pytest.mark.parametrize("name", LAWS)
def test_every_law_satisfies_the_protocol_and_survives_its_file(name, tmp_path):
    needed = [f for f in fields(LAWS[name]) if f.default is MISSING]
    law = LAWS[name](*(0.5 for _ in needed))
    check_law(law, level=not name.startswith("state_"))
    theta = np.array([law.initial[0]] * 2) + 0.0
    save_model(Friction(law, theta), tmp_path / "model.json", LAWS)
    again = load_model(tmp_path / "model.json", LAWS)
    assert again.law == law
    np.testing.assert_array_equal(again.theta, theta)


@pytest.mark.parametrize(
    ("kind", "settings", "law"),
    [
        ("coulomb_viscous", {"symmetric": False}, AsymmetricCoulombViscous()),
        ("load_dependent", {"width": 0.1}, LoadDependent(0.1)),
        ("load_dependent", {"stribeck": True}, LoadDependentStribeck()),
        ("quadratic", {"shape": "arctan"}, Quadratic(shape="arctan")),
        ("film_lag", {}, FilmLag()),
        ("film_lag", {"symmetric": False}, AsymmetricFilmLag()),
        ("dahl", {"width": 0.05}, Dahl(0.05)),
        ("lugre", {}, LuGre()),
        ("lugre", {"symmetric": False, "width": 0.1}, AsymmetricLuGre(0.1)),
    ],
)
def test_settings_choose_the_law(kind, settings, law):
    assert identifier_named(kind, settings) == LeastSquares(law)
