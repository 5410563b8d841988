"""Blocks of sensors that show nothing are left out of a fit, and those that show something stay."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures import tiny_pendulums as tiny
from fixtures.changed_data import changed
from fixtures.true_curves import plain_friction

from frictionid.comparison.suite_recipes import RecipeEntry, recipe_of
from frictionid.data.servo import Servo
from frictionid.data.signals import Signal
from frictionid.fitting.covariance import least_significant
from frictionid.fitting.fit import Covariance
from frictionid.fitting.parameters import BiasBlock, DelayBlock, FrictionBlock
from frictionid.fitting.parameters.parameter_block import Parameter
from frictionid.fitting.shooting import Settings, Shooting, refine
from frictionid.fitting.shooting.settings import DEFAULT_BLOCKS, applicable
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.simulate import Camera, Rig, Run, simulate

START = Friction(CoulombViscous(), np.array([[0.02, 0.002]]))
SHORT = Settings(windows=(0.1, 0.3))
LATE = 0.012  # [s]


def covariance_of(values, error, freedom=9, prior=np.inf):
    """Covariance of a torque delay and the torque biases of two joints."""
    parameters = (
        Parameter("delay", "torque delay", "s", values[0], tolerance=prior),
        Parameter("bias", "torque bias of joint 1", "N m", values[1], place=(0,)),
        Parameter("bias", "torque bias of joint 2", "N m", values[2], place=(1,)),
    )
    D = len(parameters)
    return Covariance(
        *(parameters, np.array(values), np.diag(np.square(error)), freedom, np.ones(D)),
        *((), np.zeros(D, dtype=bool), freedom + 1, np.zeros(D, dtype=bool)),
    )


def test_the_least_significant_block_is_named():
    blocks = (BiasBlock(), DelayBlock())
    found = least_significant(covariance_of((0.01, 0.1, 0.1), (0.02, 0.08, 0.2)), blocks, 0.05)
    assert found.block == "delay"
    assert found.p_value == pytest.approx(0.629, abs=0.001)  # two-sided t(9) beyond 0.5
    assert least_significant(covariance_of((0.1, 1.0, 0.0), (0.02, 0.1, 0.1)), blocks, 0.05) is None
    lost = covariance_of((0.1, 1.0, 0.0), (0.02, np.inf, 0.1))
    assert least_significant(lost, blocks, 0.05) == ("bias", 1.0)
    known = covariance_of((0.0, 1.0, 0.0), (0.02, 0.1, 0.1), prior=0.001)
    assert least_significant(known, blocks, 0.05) is None


def test_p_values_of_ideal_sensors_are_uniform():
    """Of estimates that scatter by their own standard errors, 400 draws."""
    rng = np.random.default_rng(0)
    p = []
    for _ in range(400):
        scale = np.sqrt(rng.chisquare(9) / 9)
        own = covariance_of(tuple(rng.standard_normal(3)), scale * np.ones(3))
        p.append(least_significant(own, (BiasBlock(),), -1.0).p_value)
    assert abs(np.mean(np.array(p) < 0.05) - 0.05) < 0.03
    assert abs(np.mean(p) - 0.5) < 0.05


def test_what_shows_nothing_is_left_out_as_if_it_had_never_been_offered():
    data = tiny.dataset()
    offered = (FrictionBlock(), BiasBlock())
    found = refine(START, data, offered, SHORT)
    assert [own.block for own in found.diagnostics.dropped] == ["bias"]
    alone = refine(START, data, (FrictionBlock(),), SHORT)
    off = np.abs(found.friction.theta - alone.friction.theta).ravel()
    assert (off < 0.1 * alone.covariance.error).all()  # two ways there, each to 0.05
    kept = refine(START, data, offered, replace(SHORT, significance=1.0))
    assert not kept.diagnostics.dropped
    assert len(kept.covariance.parameters) == 3


def test_by_default_the_delay_is_offered_where_a_torque_is_sampled_and_stays_where_it_is_late():
    late = tiny.dataset(recordings=tiny.late(LATE))
    found = refine(START, late, settings=SHORT)
    assert float(found.calibration.delay) == pytest.approx(LATE, abs=1e-3)
    assert "bias" in [own.block for own in found.diagnostics.dropped]
    recipe = recipe_of(RecipeEntry(name="shooting", by="shooting"))
    assert recipe.blocks == Shooting().blocks == DEFAULT_BLOCKS
    offered = [b.name for b in applicable(DEFAULT_BLOCKS, late)]
    assert offered == ["friction", "inertia", "delay", "bias"]


def test_by_default_nothing_is_offered_that_no_recording_shows():
    still = tiny.still()
    goal, on = (Signal(r.angle.time, np.ones((len(r.angle.time), 1))) for r in still[:2])
    servo = Servo(goal, on, gain=4.0, limit=1.0, supply=7.0, kt=0.4, R=4.0)
    driven = tuple(replace(r, servo=servo) for r in tiny.recordings())
    off = replace(servo, enabled=on._replace(value=0.0 * on.value))
    loose = tuple(replace(r, servo=off) for r in still)
    for recordings, beside in ((still, ["offset"]), (driven, []), (loose, ["offset"])):
        offered = applicable(DEFAULT_BLOCKS, tiny.dataset(recordings=recordings))
        assert [b.name for b in offered] == ["friction", "inertia", *beside]


@pytest.mark.parametrize("zero", [0.0, 0.01], ids=str)
def test_where_no_motor_drives_a_zero_that_is_off_is_found_by_default(zero):
    """It would be a torque of gravity that changes sides with no velocity, as levels by side do."""
    machine = {"kind": "pendulum", "driven": False, "parameters": tiny.PENDULUM["parameters"]}
    runs = tuple(Run(f"{k}", (0.5 + 0.3 * k,)) for k in range(4))
    friction, camera = plain_friction(0.03, 0.004), Camera(300, 60.0, 1e-3)
    data = simulate(Rig("p", machine, friction, camera, runs, substeps=8))
    data = changed(data, "angle", lambda q: q + zero)
    fit = refine(START, data, settings=SHORT)
    blocks = [p.block for p in fit.covariance.parameters]
    assert ("offset" in blocks) == (zero > 0.0)
    names = [p.name for p in fit.covariance.parameters if p.block == "inertia"]
    assert names == ["inertia"]  # only its ratio to gravity shows
    off = np.abs(float(fit.calibration.offset[0]) - zero)
    assert off == 0.0 or off < 3.0 * fit.covariance.error[blocks.index("offset")]
    errors = fit.covariance.error[[block == "friction" for block in blocks]]
    assert (np.abs(fit.friction.theta[0] - [0.03, 0.004]) < 4.0 * errors).all()


def test_no_bias_is_offered_beside_levels_of_each_direction():
    """Both say the same: u + b, and levels that differ by 2 b."""
    names = {
        symmetric: [b.name for b in applicable(DEFAULT_BLOCKS, tiny.dataset(), law)]
        for symmetric in (True, False)
        for law in [CoulombViscous(symmetric=symmetric)]
    }
    assert set(names[True]) - set(names[False]) == {"bias"}
