"""Friction that varies between the recordings of a simulated rig."""

import re
import tomllib
from dataclasses import replace

import pytest
from fixtures.paths import ROOT
from fixtures.refusals import assert_refused
from fixtures.true_curves import plain_friction
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.readers.dataset import load_dataset
from frictionid.simulate import (
    Camera,
    Curve,
    FilmLag,
    Rig,
    Run,
    Stribeck,
    Variation,
    simulate,
    write_dataset,
)
from frictionid.simulate.dataset_folder import rig_of

CURVE = Curve((0.02,), (0.02,), (0.001,))
RUNS = tuple(Run(f"r{i}", (2.0,)) for i in range(3))
RIG = Rig("p", {"kind": "pendulum"}, Stribeck(CURVE), Camera(30, 60.0), RUNS, substeps=8)


def test_each_recording_moves_as_a_rig_with_its_own_friction():
    """Batch equals alone: worn recordings are those of a rig with other numbers."""
    varied = simulate(replace(RIG, variation=Variation(wear=(0.5,), worn_from=1, sudden=True)))
    plain = simulate(RIG)
    worn = simulate(replace(RIG, friction=plain_friction(0.03, 0.001)))
    for own, other in zip(varied.recordings, (plain, worn, worn), strict=True):
        assert_allclose(own.truth.angle.value, other[own.name].truth.angle.value, atol=1e-12)


def test_wear_and_temperature_reach_what_they_say():
    variation = Variation(temperature=(20.0, 30.0, 25.0), per_kelvin=-0.01, wear=(0.4,))
    every, levels = variation.factors(("a", "b", "c"), 1, 0)
    assert_allclose(every[:, 0], (1.0, 0.9, 0.95))
    assert_allclose(levels[:, 0], (1.0, 1.2, 1.4))


def test_scatter_has_its_size_and_belongs_to_the_recording():
    names = [f"r{i}" for i in range(4000)]
    every, _ = Variation(scatter=0.03).factors(names, 2, 5)
    assert every.std(axis=0) == pytest.approx(0.03, rel=0.05)
    again, _ = Variation(scatter=0.03).factors(names[7:9], 2, 5)
    assert_array_equal(again, every[7:9])


def test_the_temperature_is_a_column_of_the_data(tmp_path):
    made = simulate(replace(RIG, variation=Variation(temperature=(20.0, 21.5, 30.25))))
    write_dataset(made, tmp_path / "warm")
    read = load_dataset(tmp_path / "warm")
    assert [r.covariates["temperature"].value.mean() for r in read.recordings] == [20, 21.5, 30.25]


def test_the_table_on_the_page_is_accepted_and_mistakes_are_named():
    text = (ROOT / "docs/monitoring.md").read_text("utf-8")
    (table,) = re.findall(r"^```toml\n(.*?)^```", text, flags=re.M | re.S)
    own = tomllib.loads(table)["variation"]
    Variation(**own | {"wear": tuple(own["wear"]), "temperature": tuple(own["temperature"])})
    with assert_refused("temperature has 2 numbers; it needs 3"):
        replace(RIG, variation=Variation(temperature=(1.0, 2.0)))
    with assert_refused("'film_lag' cannot vary"):
        replace(RIG, friction=FilmLag(CURVE, (0.1,)), variation=Variation(scatter=0.1))
    with assert_refused(r"rig.toml: variation: unknown key 'scater'"):
        rig_of({"variation": {"scater": 0.1}}, "rig.toml")
