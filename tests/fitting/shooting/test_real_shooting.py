"""Public recordings by the shooting recipes of their suites: what they say of friction."""

import gzip
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from fixtures.paths import ROOT
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.comparison.suite import load_suite, tasks_of
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.formats.bam import XL330_GAIN
from frictionid.evaluation import Protocol, prepare, score_model, score_value, with_parameters
from frictionid.fitting.identifiers import Frictionless, LeastSquares, Published
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, training_problem
from frictionid.fitting.parameters import ActuatorBlock, FrictionBlock
from frictionid.fitting.shooting import Settings, Shooting, refine
from frictionid.friction.laws import MotorLoad
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
    """Stribeck friction of the acrobot C.1, whose gears follow another law: two of seven runs."""
    data, free = real_data / "dfki_double_pendulum", ("friction", "inertia")
    runs = [f"design_C.1/sys_id_20230629/20230629-{time}" for time in (144003, 154220)]
    _, found = fitted("dfki_c1", data, runs, only="stribeck", free=free)["stribeck"]
    assert found.diagnostics.settled
    place = found.friction.law.names.index("coulomb")
    assert found.friction.theta[1, place] == 0.0
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
    published = load_model(ROOT / "data/dfki_c1/model_1.0.json")
    swings = load_dataset(ROOT / "data/dfki_c1_swingup", data)
    prepared = prepare(swings, Protocol(horizons=(0.5, 1.0), sample_time=0.01))
    own, *_ = score_model(found.friction, prepared)
    other, *_ = score_model(published, with_parameters(prepared, published.parameters))
    for horizon, most in ((0.5, 0.45), (1.0, 0.55)):
        mine, theirs = (
            score_value(scores, "rollout_angle", "median", horizon) for scores in (own, other)
        )
        assert mine < most * theirs


# --- A servo --------------------------------------------------------------------------------------


SHORT = Settings(windows=(0.1, 0.33), iterations=5)


def test_the_resistance_lies_where_published_models_have_it(request, real_data):
    folder = request.config.rootpath / "data"
    logs = load_dataset(folder / "bam_xl330_whole", real_data / "bam_xl330")
    # all kinds of motion: lifted and dropped with the motor disconnected, and driven
    assert any("lift_and_drop" in r.name for r in logs.recordings)
    problem = training_problem(logs, plant_of(logs), INTEGRAL)
    start = LeastSquares(MotorLoad()).fit(problem, 1.0 + 0.0 * problem.dt[None], 0)[0]
    blocks = (FrictionBlock(), ActuatorBlock(fixed=("kt",)))
    found = refine(start, logs, blocks, SHORT, sample_time=0.01)
    kt, R = found.calibration.motor
    assert kt == logs.recordings[0].servo.kt and found.covariance.identified[-1]
    published = [load_model(folder / f"bam_xl330/{m}.json").parameters for m in ("m1", "m6")]
    low, high = sorted(kt / m["kt"] * m["R"] for m in published)  # with the same torque per volt
    assert 0.9 * low < R < 1.1 * high


TOML = f"""
name = "xl330"
[mechanism]
kind = "pendulum"
motor = true
parameters = {{ mass = 0.49, length = 0.1, rotor = 0.0018141672784458866, g = 9.80665 }}
[columns]
time = "timestamp"
angle = "position"
[actuator]
target = "goal_position"
enabled = "torque_enable"
hold = "linear"
output = "duty"
P = 100
scale = {XL330_GAIN!r}
supply = 7.4
kt = 0.3866957639281311
R = 4.017129222290597
[actuator.recordings]
"kp400*" = {{ P = 400 }}
[recordings]
patterns = ["*.csv"]
"""


@pytest.fixture(scope="module")
def logs(request, real_data, tmp_path_factory):
    """The logs of all motions by the reader bam, and as tables with [actuator]."""
    folder = tmp_path_factory.mktemp("xl330")
    for path in (real_data / "bam_xl330").glob("*.json.gz"):
        entries = pd.DataFrame(json.loads(gzip.decompress(path.read_bytes()))["entries"])
        entries[["position", "goal_position"]] += 0.030871000250528358  # zero hangs down
        entries["torque_enable"] = entries["torque_enable"].astype(int)
        name = path.name.removesuffix(".json.gz")
        entries.to_csv(folder / f"{name}.csv", index=False, float_format="%.17g")
    (folder / "dataset.toml").write_text(TOML)
    whole = request.config.rootpath / "data/bam_xl330_whole"
    return load_dataset(whole, real_data / "bam_xl330"), load_dataset(folder)


SERVO = ("gain", "limit", "supply", "kt", "R", "damping", "target_delay", "backlash", "delay")


def test_tables_with_an_actuator_are_the_logs_of_the_reader_bam(logs):
    """All that fits read: angles, torques, and servos by which torques follow the motion."""
    bam, tables = logs
    assert tables.mechanism.nominal() == bam.mechanism.nominal()
    assert [r.name for r in tables.recordings] == [r.name for r in bam.recordings]
    for own, other in zip(tables.recordings, bam.recordings, strict=True):
        assert_array_equal(own.angle.time, other.angle.time)
        assert_allclose(own.angle.value, other.angle.value, atol=1e-15)
        assert_allclose(own.torque.value, other.torque.value, atol=1e-12)
        for name in ("goal", "enabled"):
            a, b = (getattr(r.servo, name) for r in (own, other))
            assert_allclose(a.value, b.value, atol=1e-15)
        for name in SERVO:
            assert getattr(own.servo, name) == pytest.approx(getattr(other.servo, name))


def test_check_says_of_tables_with_an_actuator_what_it_says_of_the_reader_bam(logs):
    bam, tables = (fid.check(data).findings.set_index("kind")["text"] for data in logs)
    assert set(tables.index) == set(bam.index) >= {"one_payload", "load", "tied_constants"}
    for kind in set(tables.index) - {"modelled_torque"}:
        assert tables[kind] == bam[kind]
