"""Sensitivity studies: known effects of known mistakes, and nothing computed twice."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fixtures.mistakes import changes
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.shared import shared
from fixtures.tiny_pendulums import PENDULUM, QUICK, dataset, write_suite
from fixtures.true_curves import plain_friction

import frictionid as fid
from frictionid.api.sensitivity import sensitivity_of_suite
from frictionid.comparison.sensitivity_study import training_and_test, with_and_without_inertia
from frictionid.comparison.variations import (
    SensitivitySettings,
    Variation,
    sensitive_parameters,
    variations_of,
    varied,
)
from frictionid.fitting.shooting import Shooting
from frictionid.simulate import Camera, Rig, Run, noise_free, simulate

NONE = {key: [] for key in ("levels", "gain", "delay", "tilt", "noise", "rate", "recordings")}


@cache
def decays():
    """Free swings of a pendulum whose friction is unknown."""
    friction = plain_friction(0.004, 0.002)
    runs = tuple(Run(f"{i}", (0.6 + 0.2 * i,)) for i in range(6))
    rig = Rig("decays", PENDULUM, friction, Camera(121), runs, substeps=4)
    return replace(simulate(noise_free(rig)), truth=None)


def study(data, **settings):
    chosen = {**NONE, **settings}
    return fid.sensitivity(data, "coulomb_viscous", settings=chosen, jobs=1).frame


def test_a_passive_pendulum_with_a_wrong_mass_has_friction_wrong_by_the_same_share():
    # Tf = -(J a + m g l sin q): inertia and gravity are both proportional to the mass
    frame = study(decays(), parameters=["mass"], levels=[-0.1, 0.2])
    assert np.allclose(frame.curve_change_1, [0.0, 0.1, 0.2], atol=1e-6)
    assert np.allclose(frame.rollout, frame.rollout[0], rtol=1e-6)
    assert frame.curve_error_1.isna().all()  # no truth is known


def test_errors_of_the_torque_change_nothing_where_there_is_no_torque():
    frame = study(decays(), parameters=[], gain=[0.1], delay=[0.01])
    # there is no motor: neither is offered
    assert list(frame.cause) == ["nominal"]


def test_friction_grows_with_a_gain_and_errors_to_the_truth_with_it():
    frame = study(dataset(), parameters=[], gain=[-0.2, -0.1, 0.1, 0.2]).set_index("amount")
    assert frame.curve_change_1[-0.2] > frame.curve_change_1[-0.1] > 0.01
    assert frame.curve_change_1[0.2] > frame.curve_change_1[0.1] > 0.01
    assert frame.curve_error_1[[-0.2, 0.2]].min() > frame.curve_error_1[0.0]


@pytest.mark.parametrize("cause", ["delay", "gain", "tilt"])
def test_a_mistake_of_a_sensor_is_undone_by_the_opposite_one(cause):
    amount = 0.25
    back = 1 / (1 + amount) - 1 if cause == "gain" else -amount
    data = dataset()
    there = varied(data, Variation(cause, amount))
    again = varied(there, Variation(cause, back))
    for old, wrong, new in zip(data.recordings, there.recordings, again.recordings, strict=True):
        same = [
            np.array_equal(getattr(old, key).value, getattr(wrong, key).value)
            and np.array_equal(getattr(old, key).time, getattr(wrong, key).time)
            for key in ("angle", "torque")
        ]
        assert sorted(same) == [False, True]  # one signal is changed, the other left alone
        for key in ("angle", "torque"):
            assert np.allclose(getattr(old, key).value, getattr(new, key).value, atol=1e-12)
            assert np.allclose(getattr(old, key).time, getattr(new, key).time, atol=1e-12)


def test_noise_has_the_standard_deviation_and_depends_on_the_seed_only():
    data = dataset()
    one, same, other = (varied(data, Variation("noise", 0.5), seed) for seed in (1, 1, 2))
    added = [
        b.angle.value - a.angle.value for a, b in zip(data.recordings, one.recordings, strict=True)
    ]
    assert np.std(added) == pytest.approx(np.deg2rad(0.5), rel=0.1)
    assert len({float(x[0, 0]) for x in added}) == len(added)  # recordings draw their own
    values = [np.concatenate([r.angle.value for r in d.recordings]) for d in (one, same, other)]
    assert np.array_equal(values[0], values[1])
    assert not np.array_equal(values[0], values[2])


def test_held_out_recordings_train_nothing():
    data = dataset()
    train, test = training_and_test(data)
    names = {r.name for r in train.recordings}, {r.name for r in test.recordings}
    assert not names[0] & names[1]
    assert names[0] | names[1] == {r.name for r in data.recordings}
    one = replace(data, recordings=data.recordings[:1])
    early, late = (part.recordings[0].angle.time for part in training_and_test(one))
    assert early[-1] < late[0]
    assert len(early) + len(late) == len(one.recordings[0].angle.time)


def test_only_parameters_that_matter_are_varied():
    assert sensitive_parameters(dataset()) == ("mass", "length")
    names = {v.name for v in variations_of(dataset(), SensitivitySettings())}
    assert {"mass", "length", "torque delay", "recordings"} <= names


def test_shooting_comes_with_base_parameters_held_and_free():
    held, free = with_and_without_inertia(Shooting())
    blocks = [[block.name for block in recipe.blocks] for recipe in (held, free)]
    assert "inertia" not in blocks[0]
    assert "inertia" in blocks[1]
    again = with_and_without_inertia(free)
    assert [b.name for b in again[0].blocks] == blocks[0]


def test_wrong_settings_end_in_one_line():
    with assert_refused("levels"):
        study(dataset(), levels=[-2.0])
    with assert_refused(r"'lenght'.*'length'"):
        study(dataset(), parameters=["lenght"], levels=[0.1])
    with assert_refused("leaves fewer than 20"):
        study(dataset(), parameters=[], rate=[30])


@shared
def suite(shared_path):
    chosen = {**NONE, "parameters": ["mass"], "levels": [0.1], "delay": [-0.01, 0.01]}
    return write_suite(shared_path, {"sensitivity": chosen, **changes(QUICK)})


@shared
def studied(suite):
    """Frame and page of the suite's study."""
    return sensitivity_of_suite(suite, out=suite.parent / "report/small-sensitivity", jobs=1)


def test_the_command_writes_a_page_and_computes_nothing_twice(studied, suite, monkeypatch, run):
    folder = studied[1].parent
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file() and p.name[0] != "."}
    kinds = {p.suffix for p in before}
    assert {".md", ".csv", ".png", ".pdf", ".tex", ".json"} <= kinds
    times = {p: p.stat().st_mtime_ns for p in (folder / "fits").iterdir()}
    words = suite.parent, "sensitivity", suite.name
    code, out, _ = run(*words, "--json")
    assert code == 0
    assert len(json.loads(out)["fits"]) == len(times)
    assert {p: p.stat().st_mtime_ns for p in times} == times
    assert {p: p.read_bytes() for p in before} == before
    monkeypatch.setattr("frictionid.api.sensitivity.sensitivity_of_suite", lambda *_, **__: studied)
    code, out, _ = run(*words)
    assert code == 0 and "torque delay" in out


def test_unknown_names_end_in_one_line(suite, run):
    for option in ("--identifier", "--recipe"):
        outcome = run(suite.parent, f"sensitivity {suite.name} {option} nobody")
        assert_one_line(outcome, "'nobody' is unknown")
