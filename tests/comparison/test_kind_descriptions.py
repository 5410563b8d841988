"""Descriptions of kinds say what the program itself uses, and leave nothing unsaid."""

import inspect
import json

import pytest
import sympy as sp
from fixtures.refusals import assert_one_line
from numpy.testing import assert_allclose

from frictionid.comparison.kind_descriptions import identifiers, laws, mechanisms
from frictionid.comparison.registry import IDENTIFIERS
from frictionid.friction.model_files import LAWS
from frictionid.mechanics import mechanism_of
from frictionid.mechanics.mechanism_table import mechanism_kinds

KINDS = {"mechanisms": mechanisms, "laws": laws, "identifiers": identifiers}


@pytest.mark.parametrize("kinds", KINDS.values(), ids=KINDS)
def test_nothing_is_without_a_meaning(kinds):
    for kind in kinds():
        assert kind.summary and "\n" not in kind.summary
        for entry in (*kind.parameters, *kind.settings, *kind.base):
            assert entry.meaning, (kind.name, entry.name)
            assert not entry.meaning.startswith("as in"), (kind.name, entry.name)


def test_all_kinds_are_there_under_the_names_that_files_use():
    assert [kind.name for kind in laws()] == list(LAWS)
    assert [kind.name for kind in mechanisms()] == list(mechanism_kinds())
    for kind, (name, known) in zip(identifiers(), IDENTIFIERS.items(), strict=True):
        assert kind.name == name
        assert [setting.name for setting in kind.settings] == list(known.settings)


def test_defaults_are_those_with_which_an_identifier_is_built():
    for kind in identifiers():
        known = IDENTIFIERS[kind.name]
        shown = {setting.name: setting.default for setting in kind.settings}
        for name, value in known.defaults({}).items():
            if isinstance(value, bool | int | float | str):
                assert json.loads(shown[name]) == value, (kind.name, name)
        given = {choice.key: shown[choice.key] for choice in known.choices if shown[choice.key]}
        assert all(known.values({k: json.loads(v)}) is not None for k, v in given.items())


def test_parameters_of_a_law_are_those_of_its_class():
    for kind in laws():
        if kind.parameters:
            law = LAWS[kind.name]()
            assert [p.name for p in kind.parameters] == list(law.names)
            assert [p.unit for p in kind.parameters] == list(law.units)
    shown = {kind.name for kind in laws() if kind.parameters}
    assert {"stribeck", "lugre", "spline", "ripple", "dahl"} <= shown


def test_base_parameters_are_what_the_mechanism_makes_of_its_defaults():
    for kind in mechanisms():
        mechanism = mechanism_of({"kind": kind.name})
        assert [p.name for p in kind.parameters] == list(mechanism.defaults)
        shown = {p.name: float(p.default) for p in kind.parameters if p.default}
        values = {**mechanism.defaults, **shown}
        base = [
            sp.sympify(b.meaning).subs({sp.Symbol(k): v for k, v in values.items()})
            for b in kind.base
        ]
        assert_allclose(list(map(float, base)), mechanism.base(mechanism.defaults), rtol=1e-4)
        required = {p.name for p in mechanism.parameters if p.required}
        assert {p.name for p in kind.parameters if not p.default} == required


def test_the_point_of_every_inertia_is_said():
    for kind in mechanisms():
        for parameter in kind.parameters:
            if parameter.unit == "kg m^2":
                words = ("about", "rotor", "shaft", "clamp", "bush")
                assert any(word in parameter.meaning for word in words), parameter


@pytest.mark.parametrize("command", KINDS)
def test_the_commands_list_all_and_show_one(run, tmp_path, command):
    names = [kind.name for kind in KINDS[command]()]
    code, out, err = run(tmp_path, command)
    assert (code, err) == (0, "")
    assert [line for line in out.splitlines() if line in names] == names
    code, out, _ = run(tmp_path, command, names[-2])
    assert code == 0 and out.startswith(f"{names[-2]}\n") and ">>>" not in out
    code, out, _ = run(tmp_path, command, "--json")
    assert [kind["name"] for kind in json.loads(out)] == names
    outcome = run(tmp_path, command, f"{names[-2]}x")
    assert_one_line(outcome, f"x' is unknown; did you mean {names[-2]!r}")


def test_options_of_a_mechanism_are_its_arguments():
    for kind in mechanisms():
        build = mechanism_kinds()[kind.name]
        arguments = inspect.signature(build).parameters.values()
        options = [a.name for a in arguments if a.kind is not a.KEYWORD_ONLY]
        assert [s.name for s in kind.settings] == options
