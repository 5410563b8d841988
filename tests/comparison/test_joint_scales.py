"""Whatever the unit of a slide, and however slow a machine: fits and predictions are the same."""

from functools import cache

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.check import check
from frictionid.data.joint_scales import joint_scales
from frictionid.data.plants import plant_of
from frictionid.data.readers.table import Table
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import Body, Joint, Parameter, from_bodies, linear_axis
from frictionid.quickstart.column_guesses import guess_columns
from frictionid.simulate import Camera, Curve, Rig, Run, Sine, Steps, Stribeck, simulate

MASS = 10.0


@cache
def slide(travel=1.0, times=1.0):
    """A carriage whose lengths are `travel`, and times `times`, as large as those of the first.

    The same forces act on a mass that makes them so.
    """

    def signal(s, factor):
        return s._replace(time=s.time * times, value=s.value * factor)

    recordings = tuple(
        Recording(r.name, signal(r.angle, travel), signal(r.torque, 1.0))
        for r in carriage().recordings
    )
    return Dataset("carriage", linear_axis(mass=MASS * times**2 / travel), recordings)


@cache
def carriage():
    coulomb, viscous, peak = (4.0,), (3.0,), (2.0,)
    runs = (
        Run("sine", (0.0,), torques=(Sine(12.0, 0.8),)),
        Run("steps", (0.0,), (0.5,), (Steps(14.0, 0.25),)),
        Run("slow", (0.0,), torques=(Sine(9.0, 0.4),)),
    )
    rig = Rig(
        name="carriage",
        mechanism=linear_axis(mass=MASS),
        friction=Stribeck(Curve(coulomb, coulomb, viscous, peak, peak, (0.1,))),
        camera=Camera(samples=150, rate=60.0, angle_noise=1e-6),
        recordings=runs,
        substeps=4,
    )
    return simulate(rig)


SCALES = [(1e-3, 1.0), (1e3, 1.0), (1.0, 4.0), (1e-2, 0.1)]


@cache
def fitted(method, travel, times):
    """Friction of a slide in units of the first, its windows as much longer as its times."""
    windows = {"windows": np.array([5, 10, 20]) / 60 * times} if method == "shooting" else {}
    fit = fid.fit(slide(travel, times), "stribeck", method=method, **windows)
    speed = travel / times  # coulomb, peak, Stribeck velocity and viscous friction
    return np.ravel(fit.friction.theta) * [1.0, 1.0, 1.0 / speed, speed]


# the weights of rows of a one-step fit are those of a coarse fit
@pytest.mark.parametrize("method, rel", [("one_step", 0.03), ("shooting", 2e-3)])
@pytest.mark.parametrize("travel, times", [(1e-3, 1.0), (10.0, 0.1)])
def test_a_fit_does_not_depend_on_how_long_a_slide_is_or_how_slow(travel, times, method, rel):
    first, other = fitted(method, 1.0, 1.0), fitted(method, travel, times)
    assert other == pytest.approx(first, rel=rel)


@pytest.mark.parametrize("travel, times", SCALES)
def test_a_prediction_is_the_same_in_units_of_the_slide(travel, times):
    theta, speed = np.array([[4.0, 3.0]]), travel / times
    motions = []
    for data, own in ((slide(), theta), (slide(travel, times), theta / [1.0, speed])):
        u = data.recordings[0].torque.value[:120, None]
        dt = np.diff(data.recordings[0].angle.time)[:120, None]
        start = State(np.zeros((1, 1)), np.zeros((1, 1)))
        motions.append(rollout(plant_of(data)[:1], Friction(CoulombViscous(), own), start, u, dt))
    one, other = motions
    size = np.ptp(one.q)
    assert np.abs(other.q / travel - one.q).max() < 2e-4 * size
    assert np.array_equal(other.w == 0.0, one.w == 0.0)  # it sticks at the same times
    assert (one.w[1:] == 0.0).any()


def test_scales_follow_the_unit_of_length_and_of_time():
    first = slide().scales
    for travel, times in SCALES:
        other = slide(travel, times).scales
        assert_allclose(other.size, travel * first.size)
        assert_allclose(other.fast, travel / times * first.fast)
        assert_allclose(other.slow, 0.02 * other.fast)


def test_a_joint_that_turns_has_the_usual_scales_unless_it_moves_little():
    time = np.linspace(0.0, 5.0, 501)
    for amplitude in (40.0, 8.0, 1.0, 0.01):
        angle = Signal(time, amplitude * np.sin(3.0 * time)[:, None])
        scales = joint_scales(("rad",), [angle])
        fast = 3.0 * amplitude * np.cos(np.pi * 0.05 / 2)
        assert scales.fast[0] == pytest.approx(fast, rel=0.02)
        assert scales.size[0] == pytest.approx(min(1.0, amplitude / 2), rel=1e-3)
        assert scales.slow[0] == pytest.approx(min(0.1, 0.02 * fast), rel=0.02)


def test_noise_alone_is_no_motion():
    noise = 1e-4 * np.random.default_rng(0).standard_normal((400, 1))
    scales = joint_scales(("m",), [Signal(np.arange(400) / 100, noise)])
    assert scales.fast[0] == 0.0 and 5e-4 < scales.size[0] < 5e-3


# --- A slide of a few millimetres beside a joint that turns ---------------------------------------

TABLE = np.array([[3.0, 40.0], [0.05, 0.01]])  # Coulomb and viscous friction of slide and table


@cache
def stage():
    """A turntable with an eccentric weight on a slide that moves 4 mm, sampled at 200 Hz."""
    x, q, slide, mass, arm = sp.symbols("x q slide mass arm")
    machine = from_bodies(
        (Body(slide, x, 0, joint=0), Body(mass, x + arm * sp.sin(q), -arm * sp.cos(q), joint=1)),
        (Joint("slide", x, "m"), Joint("table", q, "rad")),
        (
            Parameter("slide", 60.0, "kg", "mass of the slide"),
            Parameter("mass", 0.6, "kg", "weight"),
            Parameter("arm", 0.1, "m", "from the axle to the weight"),
        ),
    )
    rig = Rig(
        name="stage",
        mechanism=machine,
        friction=Stribeck(Curve(*(tuple(c) for c in TABLE.T[[0, 0, 1]].tolist()))),
        camera=Camera(samples=400, rate=150.0, angle_noise=(5e-7, 2e-4)),
        recordings=(
            Run("fast", (0.0, 0.0), torques=(Sine(4.6, 0.7), Sine(0.3, 0.7))),
            Run("slow", (0.0, 1.0), torques=(Sine(3.5, 0.4), Sine(0.15, 0.4))),
            Run("other", (0.0, 1.0), torques=(Sine(4.0, 0.5), Steps(0.25, 0.3))),
        ),
        substeps=4,
    )
    return simulate(rig)


@pytest.mark.parametrize(
    "method, off", [("one_step", 0.2), ("shooting", 0.02), ("inverse_dynamics", 0.2)]
)
def test_the_friction_of_a_slide_of_millimetres_is_found_beside_a_joint_that_turns(method, off):
    assert stage().scales.size[0] < 2.5e-3
    free = {"free": "friction"} if method != "one_step" else {}
    fit = fid.fit(stage(), "coulomb_viscous", method=method, **free)
    torque = stage().scales.fast[:, None] ** [[0, 1]]
    size = (TABLE * torque).sum(axis=1)
    error = np.abs((fit.friction.theta - TABLE) * torque).sum(axis=1)
    assert (error < off * size).all(), error / size
    half = (fit.frame.high_95 - fit.frame.value)[: torque.size].to_numpy().reshape(torque.shape)
    assert (half * torque < off * size[:, None]).all()


def test_check_calls_a_stage_good_and_a_comparison_finds_its_friction():
    verdict = check(stage())
    assert verdict.level == "good", [f.text for f in verdict.findings]
    bench = fid.compare(stage(), ["none", "coulomb_viscous"], folds=3, horizons=[0.25])
    for joint in ("1", "2"):
        none, law = (
            bench[name].value("rollout_angle", "median", 0.25, joint)
            for name in ("none", "coulomb_viscous")
        )
        assert law < 0.3 * none, joint


def test_columns_of_slides_and_of_joints_that_turn_have_their_own_units():
    time = np.arange(300) / 100
    columns = {
        "t": time,
        "pos_1": 90.0 * np.sin(3 * time),
        "pos_2": 120.0 * np.cos(2 * time),
        "tau_1": np.cos(time),
        "tau_2": np.sin(time),
    }
    table = Table("a.csv", np.arange(300), columns)
    guesses = guess_columns(table, (True, True), ("m", "rad"))
    assert guesses.angle.unit == ("mm", "deg") and guesses.torque.unit == ("N", "N m")
    assert guesses.with_angle_unit("rad", "").angle.unit == ("mm", "rad")
    alike = guess_columns(table, (True, True), ("rad", "rad"))
    assert (alike.angle.unit, alike.torque.unit) == ("deg", "N m")
