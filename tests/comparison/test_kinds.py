"""Kinds: the settings of tables are the fields of dataclasses, with their types and defaults."""

import pytest

from frictionid.comparison.registry import ESTIMATORS, IDENTIFIERS
from frictionid.comparison.suite import LOOPS, PROTOCOL, SPLIT
from frictionid.comparison.suite_recipes import SHOOTING
from frictionid.errors import InputError

REQUIRED = {"gear_load": {"moment": 0.1}, "sklearn": {"estimator": "knn"}}
KINDS = {
    **{name: kind for name, kind in IDENTIFIERS.items() if name != "published"},
    **ESTIMATORS,
    **{"split": SPLIT, "loops": LOOPS, "protocol": PROTOCOL, "shooting": SHOOTING},
}


def default_settings(name):
    """Defaults as a suite would write them, without those that TOML cannot write."""
    defaults = KINDS[name].defaults(REQUIRED.get(name, {}))
    plain = {k: list(v) if isinstance(v, tuple) else v for k, v in defaults.items()}
    return {
        key: value
        for key, value in plain.items()
        if isinstance(value, bool | int | float | str | list)
    }


@pytest.mark.parametrize("name", KINDS)
def test_defaults_written_out_make_the_same(name):
    required = REQUIRED.get(name, {})
    written = KINDS[name].build({**required, **default_settings(name)}, name)
    assert repr(written) == repr(KINDS[name].build(required, name))


@pytest.mark.parametrize("name", KINDS)
def test_a_table_is_no_value_of_any_setting(name):
    for key in set(KINDS[name].settings) - {"settings"}:
        with pytest.raises(InputError, match=key):
            KINDS[name].build({**REQUIRED.get(name, {}), key: {"x": 1}}, name)


def test_settings_of_parts_that_are_not_chosen_are_refused_with_the_choice():
    mlp = IDENTIFIERS["mlp"]
    with pytest.raises(InputError, match='epochs = 5 needs solver = "adam"'):
        mlp.build({"epochs": 5}, "mlp")
    assert mlp.build({"epochs": mlp.build({"solver": "adam"}, "mlp").epochs}, "mlp")
    assert mlp.build({"epochs": 5, "inputs": "all"}, "mlp").epochs == 5
    with pytest.raises(InputError, match='nodes = 9 needs solver = "levenberg_marquardt"'):
        mlp.build({"nodes": 9, "solver": "adam"}, "mlp")
