"""What shooting owes: exact derivatives, the machine's own numbers, and refusals of wrong data."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.changed_data import changed, one_changed
from fixtures.driven_pendulum import LEVEL, VISCOUS, driven_pendulum
from fixtures.refusals import assert_refused
from fixtures.slopes import assert_slopes
from fixtures.wrist import motion, wrist
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.plants import Calibration
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.fitting.parameter_block import values_of
from frictionid.fitting.parameters import (
    BiasBlock,
    DelayBlock,
    FrictionBlock,
    GainBlock,
    InertiaBlock,
    OffsetBlock,
)
from frictionid.fitting.shooting import Settings, refine
from frictionid.fitting.shooting.data_checks import angle_noise
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.fitting.shooting.stages import prepare_fit
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, LoadDependent
from frictionid.friction.laws import Stribeck as StribeckLaw
from frictionid.simulate import Camera, Curve, Noise, Run, Stribeck, simulate
from frictionid.simulate import Rig as Simulated

TRUE = np.array([[LEVEL, VISCOUS]])
BEGIN = Friction(CoulombViscous(), [[0.03, 0.001]])
SHORT = Settings(windows=(0.1, 0.33))


@pytest.fixture(scope="module")
def healthy():
    return driven_pendulum(150)


def acrobot():
    """Short recordings in which both joints move, and its torque is held between samples."""
    curve = Curve((0.165, 0.055), (0.165, 0.05), (0.004, 0.0008))
    runs = [Run(f"{k}", (2.0 - k, 0.5), (1.0, -2.0), (Noise(0.14, (0.5, 1.2)),)) for k in range(4)]
    rig = Simulated("a", {"kind": "acrobot"}, Stribeck(curve), Camera(90), tuple(runs), substeps=4)
    return simulate(rig, 1)


def test_derivatives_of_all_blocks_are_those_of_central_differences():
    level = [[0.16, 0.15, 0.01, 0.02, 6.0, 0.004], [0.05, 0.04, 0.02, 0.03, 8.0, 0.001]]
    calibration = replace(
        Calibration.ideal(2),
        gain=np.array([1.0, 1.05]),
        delay=np.asarray(0.007),
        bias=np.array([0.0, 0.01]),
        offset=np.array([0.02, -0.01]),
    )
    friction = Friction(StribeckLaw(symmetric=False), np.array(level), calibration=calibration)
    blocks = (
        *(FrictionBlock(), InertiaBlock(fixed=("gravity_2",)), DelayBlock()),
        *(GainBlock(), BiasBlock(), OffsetBlock()),
    )
    intervals = intervals_of(acrobot())
    problem, estimate = prepare_fit(friction, intervals, blocks, Settings())
    # a joint that meets w = 0 has a kink there
    rows = np.flatnonzero((np.abs(intervals.w) > 1.5).all(axis=1))[:60]
    assert len(rows) > 50
    # all but the offsets, which only the measured angle feels
    seen = assert_slopes(problem, estimate, rows)
    assert seen == len(values_of(estimate, problem.blocks)) - 2
    lines = problem.linearise(estimate, problem.initial_nodes(estimate), rows)
    assert_array_equal(lines.angle[-2:], np.eye(2))


def test_derivatives_by_fewer_parameters_are_those_of_a_problem_of_their_own():
    """The compiled step is that of the wider problem, and not compiled again."""
    friction = Friction(StribeckLaw(), [[0.16, 0.02, 6.0, 0.004], [0.05, 0.02, 8.0, 0.001]])
    intervals = intervals_of(acrobot())
    wide = FrictionBlock(), InertiaBlock(), DelayBlock()
    few = FrictionBlock(fixed=("peak",)), InertiaBlock(fixed=("inertia_12",)), DelayBlock()
    before, _ = prepare_fit(friction, intervals, wide, Settings())
    alone, estimate = prepare_fit(friction, intervals, few, Settings())
    within, _ = prepare_fit(friction, intervals, few, Settings(), before=before)
    assert within.directions == before.directions != alone.directions
    rows, nodes = np.arange(100), alone.initial_nodes(estimate)
    of_each = (problem.linearise(estimate, nodes, rows) for problem in (alone, within))
    for own, others in zip(*of_each, strict=True):
        assert_allclose(others, own, rtol=1e-9, atol=1e-12)


def test_a_gain_5_per_cent_wrong_is_found_where_one_mass_is_known():
    blocks = (FrictionBlock(), InertiaBlock(fixed=("gravity",)), GainBlock())
    found = refine(BEGIN, driven_pendulum(150, gain=1.05), blocks, SHORT)
    assert found.calibration.gain[0] == pytest.approx(1.05, rel=0.01)
    assert_allclose(found.friction.theta[:, 0], LEVEL, rtol=0.03)


def test_a_mass_10_per_cent_wrong_is_found_where_inertia_is_free_and_falsifies_friction_where_not():
    data = driven_pendulum(150, true={"mass": 0.33})
    free = refine(BEGIN, data, (FrictionBlock(), InertiaBlock()), SHORT)
    told = refine(BEGIN, data, (FrictionBlock(),), SHORT)
    assert_allclose(free.calibration.base, [0.33 * 0.04, 0.33 * 9.81 * 0.2], rtol=0.01)
    errors = [np.abs(f.friction.theta[0] / TRUE[0] - 1.0).max() for f in (free, told)]
    assert errors[0] < 0.05 and errors[1] > 4 * errors[0]
    assert told.diagnostics.angle_noise[0] > 2 * free.diagnostics.angle_noise[0]


def test_a_tighter_tolerance_goes_on_and_moves_nothing_by_more_than_the_looser_one(healthy):
    loose, tight = (
        refine(BEGIN, healthy, (FrictionBlock(),), replace(SHORT, tolerance=share))
        for share in (0.5, 1e-4)
    )
    assert loose.diagnostics.iterations < tight.diagnostics.iterations
    off = np.abs(tight.covariance.values - loose.covariance.values)
    assert (off <= 0.5 * tight.covariance.error).all()


def test_a_stretch_that_nothing_explains_is_named_and_moves_nothing(healthy):
    whole = refine(BEGIN, healthy, (FrictionBlock(), InertiaBlock()), SHORT)
    value = healthy.recordings[2].angle.value[60:70, 0]
    value = value + 0.3 * default_rng(0).normal(size=10)
    data = one_changed(healthy, "angle", 2, 0, slice(60, 70), value)
    found = refine(BEGIN, data, (FrictionBlock(), InertiaBlock()), SHORT)
    off = np.abs(found.covariance.values - whole.covariance.values)
    assert (off < 2 * whole.covariance.error).all()
    places = found.diagnostics.unexplained
    assert places and all(p.recording == "2" and p.begin < 70 / 60 < p.end + 0.2 for p in places)


def half_a_second_late(u):
    return u[np.maximum(np.arange(len(u)) - 30, 0)]


def short(data, count):
    def first(signal):
        return signal._replace(time=signal.time[:count], value=signal.value[:count])

    one = data.recordings[0]
    one = replace(one, angle=first(one.angle), torque=first(one.torque), truth=None)
    return replace(data, recordings=(one,))


def test_what_no_data_can_tell_apart_is_refused_with_a_way_out(healthy):
    both = (FrictionBlock(), InertiaBlock())
    passive = changed(healthy, "torque", lambda u: 0.0 * u)
    cases = (
        (passive, both, "only the ratios of inertia, gravity"),
        (healthy, (*both, GainBlock()), "a larger gain with larger inertias"),
    )
    for data, blocks, words in cases:
        way_out = f"{words}.*fix one base parameter that you are sure of, such as 'gravity'"
        with assert_refused(way_out):
            refine(BEGIN, data, blocks, SHORT)


NOISE = default_rng(1).normal(size=(150, 1))


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (lambda data: short(data, 10), "10 samples make 1 windows of 0.33 s, too few for 2 free"),
        (
            lambda data: changed(data, "angle", lambda q: 0.0 * q + 0.0016 * NOISE),
            "never moves by more than",
        ),
        (lambda data: changed(data, "angle", lambda q: 0.0 * q), "never moves by more than"),
        (
            lambda data: changed(data, "angle", lambda q: q % (2 * np.pi) - np.pi),
            "jumps by .* wrapped at half a turn; unwrap it",
        ),
    ],
    ids=["ten samples", "a joint at rest", "a dead sensor", "wrapped"],
)
def test_data_that_cannot_tell_friction_are_refused(fault, words, healthy):
    with assert_refused(words):
        refine(BEGIN, fault(healthy), (FrictionBlock(),), SHORT)


@pytest.mark.parametrize(
    "fault",
    [
        lambda data: changed(data, "torque", half_a_second_late),
        lambda data: changed(data, "torque", np.negative),
        lambda data: changed(data, "angle", np.negative),
    ],
    ids=["half a second late", "a flipped torque", "a flipped angle"],
)
def test_data_that_no_friction_explains_are_doubted_aloud(fault, healthy):
    for blocks in ((FrictionBlock(),), (FrictionBlock(), InertiaBlock(), DelayBlock())):
        warnings = " ".join(refine(BEGIN, fault(healthy), blocks, SHORT).diagnostics.warnings)
        assert "times worse than it is measured" in warnings or "as far as it may go" in warnings
        assert "`frictionid check` looks for wrong signs" in warnings


@pytest.mark.parametrize("sigma", [0.05, 1e-9])
def test_the_noise_of_angles_is_their_sensors_where_the_smoother_takes_off_less(sigma, healthy):
    sensed = [
        replace(r, angle=r.angle._replace(sigma=np.array([sigma]))) for r in healthy.recordings
    ]
    noise = angle_noise(intervals_of(replace(healthy, recordings=tuple(sensed))))
    assert_allclose(noise, np.maximum(angle_noise(intervals_of(healthy)), sigma))


def test_healthy_data_are_not_doubted(healthy):
    blocks = (FrictionBlock(), InertiaBlock(), DelayBlock())
    found = refine(BEGIN, healthy, blocks, SHORT)
    assert found.diagnostics.warnings == () and found.diagnostics.unexplained == ()


# --- A motor that turns with two joints -----------------------------------------------------------


TRUE_WRIST = np.array([[0.25, 0.05], [0.06, 0.02], [0.12, 0.03]])  # of bend, turn and motor
BEGIN_WRIST = Friction(CoulombViscous(), [[0.15, 0.02], [0.1, 0.01], [0.2, 0.01]])
DT, WRIST_NOISE = 0.01, 1e-4


@pytest.fixture(scope="module")
def wrist_data(tmp_path_factory):
    """Two recordings of a second at 100 Hz, in which all three parts come to rest at times."""
    rng, t = default_rng(0), DT * np.arange(101)
    recordings = []
    for k in range(2):
        u = np.stack(
            [2.5 * np.sin((1.9 + 0.5 * k) * t + k), 0.9 * np.sin((3.1 - 0.4 * k) * t)], axis=-1
        )
        q, _ = motion(TRUE_WRIST, [0.3 * k, -0.5], [0.0, 0.0], u[:-1], DT, step=4e-5)
        angle = Signal(t, q + rng.normal(scale=WRIST_NOISE, size=q.shape))
        recordings.append(Recording(f"{k}", angle, Signal(t, u)))
    return Dataset("wrist", wrist(tmp_path_factory.mktemp("wrist")), tuple(recordings))


def test_friction_of_all_parts_comes_out(wrist_data):
    found = refine(BEGIN_WRIST, wrist_data, (FrictionBlock(),), Settings(windows=(0.3,)))
    assert_allclose(found.friction.theta, TRUE_WRIST, rtol=0.003)
    off = (found.covariance.values - TRUE_WRIST.ravel()) / found.covariance.error
    assert (np.abs(off) < 3.5).all()


@pytest.mark.parametrize("law", [CoulombViscous(), LoadDependent()])
def test_derivatives_of_parts_are_those_of_central_differences(wrist_data, law):
    theta = np.abs(default_rng(0).normal(size=(3, len(law.names)))) * 0.1
    blocks = (FrictionBlock(), InertiaBlock(prior=0.3), DelayBlock())
    intervals = intervals_of(wrist_data)
    calibration = replace(Calibration.ideal(2), delay=np.asarray(0.003))  # at 0 it has a kink
    begin = Friction(law, theta, calibration=calibration)
    problem, estimate = prepare_fit(begin, intervals, blocks, Settings())
    # a part that meets rest has a kink there
    parts = intervals.w @ wrist_data.mechanism.friction_map.T
    smooth = np.flatnonzero((np.abs(parts) > 0.8).all(axis=1))[:50]
    assert len(smooth) == 50
    assert assert_slopes(problem, estimate, smooth) == len(values_of(estimate, problem.blocks))
