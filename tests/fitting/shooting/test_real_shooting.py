"""Public recordings by the shooting recipes of their suites: what they say of friction."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fixtures.paths import ROOT

from frictionid.comparison.suite import load_suite
from frictionid.comparison.suite_tasks import tasks_of
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.evaluation import Protocol, prepare, score_model, score_value, with_parameters
from frictionid.fitting.identifiers import Frictionless, Published
from frictionid.fitting.one_step.formulation import STUDY, training_problem
from frictionid.fitting.shooting import Shooting, refine
from frictionid.friction.model_files import load_model

pytestmark = pytest.mark.real

COMPARISONS = ROOT / "comparisons"
Given = Frictionless | Published


@cache
def tasks(name, data):
    """What the suite of a data set compares."""
    file = COMPARISONS / f"{name}_shooting.toml"
    return tasks_of(load_suite(file), file, data)


def fitted(name, data, names=None, only=None, free=None):
    """By identifier: friction by the study's recipe, and what the suite's shooting finds."""
    out = {}
    for task in tasks(name, data):
        if not isinstance(task.recipe, Shooting) or isinstance(task.identifier, Given):
            continue
        if only not in (None, task.name):
            continue
        dataset, apart = task.benchmark.dataset, task.benchmark.protocol.sample_time
        if names is not None:
            some = tuple(r for r in dataset.recordings if r.name in names)
            dataset = replace(dataset, recordings=some)
        begins = []
        for recipe in (STUDY, task.recipe.start):
            problem = training_problem(dataset, plant_of(dataset), recipe, apart, 0.15)
            begins.append(task.identifier.fit(problem, np.ones((1, len(problem.r))), 0)[0])
        blocks = [b for b in task.recipe.blocks if free is None or b.name in free]
        found = refine(begins[1], dataset, blocks, task.recipe.settings, sample_time=apart)
        out[task.name] = begins[0], found
    return out


def identified(found):
    """Names of friction's parameters that are identified, their intervals without zero."""
    covariance = found.covariance
    low = covariance.interval(0.95)[:, 0]
    return {
        entry.name
        for entry, known, end in zip(covariance.parameters, covariance.identified, low, strict=True)
        if entry.block == "friction" and known and end > 0
    }


def test_a_string_pendulum_is_slowed_by_drag_and_not_by_coulomb_friction(real_data):
    found = fitted("phy180", real_data / "phy180_camera_pendulum")
    _, quadratic = found["quadratic"]
    _, levels = found["coulomb_viscous"]
    assert identified(quadratic) == {"drag of joint 1"}
    assert identified(levels) == {"viscous of joint 1"}
    assert quadratic.diagnostics.angle_noise < levels.diagnostics.angle_noise


@pytest.mark.parametrize("law", ["coulomb_viscous", "asymmetric"])
def test_a_carriage_that_stops_in_every_window_converges(real_data, law):
    """Where predictions have kinks, steps lead to and fro."""
    _, found = fitted("emps", real_data / "emps", only=law)[law]
    assert found.diagnostics.settled


def test_friction_that_falls_off_over_all_speeds_converges_and_says_so(real_data):
    """Stribeck friction of the acrobot C.1, whose gears follow another law."""
    data = real_data / "dfki_double_pendulum"
    _, found = fitted("dfki_c1", data, only="stribeck", free=("friction", "inertia"))["stribeck"]
    assert found.diagnostics.settled
    place = found.friction.law.names.index("coulomb")
    assert np.asarray(found.friction.theta)[1, place] == 0.0
    said = " ".join(found.diagnostics.warnings)
    assert "Coulomb of joint 2 ends at 0: friction falls off over all speeds" in said


def test_shooting_sees_friction_that_differences_of_velocities_do_not(real_data):
    """Two of the six recordings of a passive double pendulum."""
    found = fitted("ibm", real_data / "ibm_double_pendulum_chaotic", ("0", "3"))
    study, solution = found["coulomb_viscous"]
    viscous = study.law.names.index("viscous")
    assert not study.theta[:, viscous].any()
    assert "viscous of joint 2" in identified(solution)


def test_swing_ups_never_seen_are_predicted_twice_as_well_as_by_the_published_model(real_data):
    data = real_data / "dfki_double_pendulum"
    _, found = fitted("dfki_c1", data, only="motor_load")["motor_load"]
    published = load_model(ROOT / "data" / "dfki_c1" / "model_1.0.json")
    swings = load_dataset(ROOT / "data" / "dfki_c1_swingup", data)
    prepared = prepare(swings, Protocol(horizons=(0.5, 1.0), sample_time=0.01))
    own, *_ = score_model(found.friction, prepared)
    other, *_ = score_model(published, with_parameters(prepared, published.parameters))
    for horizon, most in ((0.5, 0.45), (1.0, 0.55)):
        mine, theirs = (
            score_value(scores, "rollout_angle", "median", horizon) for scores in (own, other)
        )
        assert mine < most * theirs
