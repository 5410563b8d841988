"""Joints that slide beside joints that turn: no score, fit or limit adds metres to radians."""

import numpy as np
import pytest
from fixtures.cart_poles import TRUE, cart_pole, cart_pole_data
from fixtures.shared import shared
from numpy.testing import assert_allclose

from frictionid.check import check
from frictionid.check.hypotheses import hypotheses
from frictionid.comparison.fit_model import fit_model
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset, Recording, TrueMotion
from frictionid.evaluation import Protocol, prepare, score_model
from frictionid.excitation import Experiment, Search, design_signals, limits_of, prior_friction_of
from frictionid.fitting.fit import own_base
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, problem_of, training_problem
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.friction.model_files import load_model, save_model
from frictionid.mechanics import Plant
from frictionid.report.experiment_design import described

FRICTION = Friction(CoulombViscous(), TRUE, position_units=("m", "rad"))
PROTOCOL = Protocol(horizons=(0.25,), whole=True)


@shared
def scores():
    return score_model(FRICTION, prepare(cart_pole_data(), PROTOCOL)).scores


def pick(frame, score, joint, statistic):
    (row,) = frame[
        (frame["score"] == score) & (frame["joint"] == joint) & (frame["statistic"] == statistic)
    ].itertuples()
    return row.value, row.unit


def test_each_joint_has_its_own_unit_and_the_norm_has_none(scores):
    for score, statistic, units in (
        ("one_step_integral", "rms", ("m/s", "rad/s", "1/s")),
        ("rollout_angle", "median", ("m", "rad", "1")),
        ("free_run", "rms", ("m", "rad", "1")),
    ):
        found = [pick(scores, score, joint, statistic)[1] for joint in ("1", "2", "all")]
        assert tuple(found) == units


def test_the_norm_is_that_of_errors_in_units_of_the_joints_sizes(scores):
    travel, turn = cart_pole_data().scales.size
    positions = np.concatenate([r.angle.value[:, 0] for r in cart_pole_data().recordings])
    assert (travel, turn) == (np.ptp(positions) / 4, 1.0)
    cart, pole, both = (pick(scores, "one_step_integral", j, "rms")[0] for j in ("1", "2", "all"))
    assert both == pytest.approx(np.hypot(cart / travel, pole / turn))


def test_a_fit_is_the_same_whatever_the_unit_of_the_track():
    """The one-step problem of a cart in m has rows in shares of its travel."""
    data = cart_pole_data()
    given, fitted = (f(data, plant_of(data), INTEGRAL) for f in (problem_of, training_problem))
    sizes = data.scales.size
    moving = (fitted.G != 0).all(axis=(1, 2))
    assert moving.mean() > 0.5
    assert_allclose(fitted.r[moving], given.r[moving] / sizes)
    assert_allclose(fitted.G[moving], given.G[moving] / sizes[:, None])


def test_models_of_both_kinds_of_joints_are_saved_and_read(tmp_path):
    fitted = fit_model(cart_pole_data(), LeastSquares(CoulombViscous()))
    assert fitted.units_at(0) == ("N", "N s/m") and fitted.units_at(1) == ("N m", "N m s/rad")
    save_model(fitted, tmp_path / "model.json")
    again = load_model(tmp_path / "model.json")
    assert again.position_units == ("m", "rad") and np.array_equal(again.theta, fitted.theta)


def scaled(data, joint, factor):
    """The data with one joint's positions in another unit than is said."""

    def wrong(signal):
        value = np.array(signal.value)
        value[:, joint] *= factor
        return signal._replace(value=value)

    recordings = []
    for r in data.recordings:
        truth = TrueMotion(wrong(r.truth.angle), wrong(r.truth.velocity))
        recordings.append(Recording(r.name, wrong(r.angle), r.torque, truth=truth))
    return Dataset(data.name, data.mechanism, tuple(recordings))


def test_check_finds_nothing_wrong_and_names_units_that_are():
    verdict = check(cart_pole_data())
    assert verdict.level == "good"
    reasons = [e.reason for e in verdict.identifiable]
    assert reasons[0].endswith(" m/s") and reasons[1].endswith(" rad/s")
    kinds = {f.kind for f in check(scaled(cart_pole_data(), 1, 180 / np.pi)).findings}
    assert "degrees" in kinds
    kinds = {f.kind for f in check(scaled(cart_pole_data(), 0, 1000.0)).findings}
    assert "millimetres" in kinds


def test_wrong_units_are_asked_for_each_kind_of_joint():
    by_kind = {c.kind: c.angle for c in hypotheses((True, False), ("m", "rad"))}
    assert_allclose(by_kind["degrees"], np.diag([1.0, np.pi / 180]))
    assert_allclose(by_kind["millimetres"], np.diag([1e-3, 1.0]))
    assert not {"absolute_angle", "swapped_angles"} & set(by_kind)  # metres are no radians


def test_suggestions_keep_limits_in_the_unit_of_each_joint():
    machine = cart_pole().with_defaults()
    limits = limits_of("torque=6, velocity=[1.5, 12], angle=[0.8, 6]", machine)
    plant = Plant.from_parameters(machine, machine.nominal())
    experiment = Experiment(
        plant,
        prior_friction_of("", limits),
        limits,
        length=1.0,
        recordings=1,
        angle_noise=(1e-4, 2e-3),
    )
    design = design_signals(experiment, Search(pool=20, generations=0))
    w, q = np.abs(design.motions.w), np.abs(design.motions.q)
    assert (w.max((0, 1, 2)) <= limits.velocity).all() and (q.max((0, 1, 2)) <= limits.angle).all()
    text = described(design)
    assert "0.0001 m, 0.115 deg" in text and "m/s" in text and "rad/s" in text


def test_results_hold_the_base_parameters_of_a_model_with_parameters_of_its_own():
    machine = cart_pole()
    expected = machine.base({**machine.nominal(), "cart": 0.9})
    found = own_base(cart_pole_data(), {"cart": 0.9})
    assert found == pytest.approx(dict(zip(machine.base_names, expected, strict=True)))
    assert own_base(cart_pole_data(), {}) == {}
