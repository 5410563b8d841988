"""Servos in shooting: torque follows from voltage and predicted motion, and kt and R come out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from fixtures.slopes import assert_slopes
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.integrals import pieces_of
from frictionid.data.plants import Calibration
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import Servo, servo_torque
from frictionid.data.signals import Signal, sample, taken
from frictionid.data.state_estimators import States
from frictionid.evaluation import Protocol, prepare
from frictionid.evaluation.prepared import with_calibration
from frictionid.fitting.parameter_block import values_of
from frictionid.fitting.parameters import (
    ActuatorBlock,
    BiasBlock,
    DelayBlock,
    FrictionBlock,
    GainBlock,
    InertiaBlock,
    OffsetBlock,
)
from frictionid.fitting.shooting import Settings, refine
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.fitting.shooting.servo import ServoMotion, drive_of, torque_signal
from frictionid.fitting.shooting.stages import prepare_fit
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, MotorLoad

KT, R = 0.39, 4.0
TRUE = np.array([[0.013, 0.0037]])
INERTIA, GRAVITY = 0.0067, 0.48
MECHANISM = {
    "kind": "pendulum",
    "parameters": {"mass": 0.49, "length": 0.1, "rotor": INERTIA - 0.0049, "g": GRAVITY / 0.049},
}
RATE, SECONDS, FINE = 200, 3.0, 20
SHORT = Settings(windows=(0.05, 0.15))


@cache
def simulated(enabled, kt=KT, R=R, noise=2e-4, loss=0.0, seed=0):
    """A servo's pendulum, by drift and kick, friction as what stops it within a kick at most.

    enabled (T,) is when the motor is connected; one recording for each of three goals
    """
    time = np.arange(int(RATE * SECONDS)) / RATE
    on = np.array([1.0 if e else 0.0 for e in enabled(time)])
    h = 1.0 / RATE / FINE
    each = np.arange(3)

    def goals(t):
        return 1.2 * np.sin((3 + each) * t + each) * np.cos(1.1 * t)

    q, w, out = np.array([0.2, 1.0, -0.8]), np.zeros(3), []
    coulomb, viscous = TRUE[0]
    for k, t in enumerate(time):
        out.append(q.copy())
        for part in range(FINE):
            q = q + h / 2 * w
            duty = np.clip(3.0 * (goals(t + (part + 0.5) * h) - q), -1.0, 1.0)
            volts = 7.0 * duty * on[k]
            emf = kt**2 / R * on[k]
            u = kt / R * volts - emf * w
            push = kt / R * volts - GRAVITY * np.sin(q) - (viscous + emf) * w / 2
            wanted = (w + h / INERTIA * push) / (1 + h / INERTIA * (viscous + emf) / 2)
            most = h / INERTIA * (coulomb + loss * np.abs(u))
            w = np.sign(wanted) * np.maximum(np.abs(wanted) - most, 0.0)
            q = q + h / 2 * w
    reads = np.stack(out) + noise * np.random.default_rng(seed).normal(size=(len(time), 3))
    goal = np.stack([goals(t) for t in time])
    recordings = []
    for k in range(3):
        servo = Servo(
            Signal(time, goal[:, [k]]),
            Signal(time, on[:, None], hold="previous"),
            **dict(gain=3.0, limit=1.0, supply=7.0, kt=kt, R=R),
        )
        angle = Signal(time, reads[:, [k]])
        recordings.append(
            Recording(f"{on.mean():g} {k}", angle, servo_torque(servo, angle), servo=servo)
        )
    return recordings


def believed(recordings, kt, R):
    """The recordings with other motor constants, and the torque that follows from them."""
    servos = [r.servo.with_motor(kt, R) for r in recordings]
    pairs = zip(recordings, servos, strict=True)
    return Dataset(
        "servo",
        MECHANISM,
        tuple(replace(r, servo=s, torque=servo_torque(s, r.angle)) for r, s in pairs),
    )


def driven():
    return simulated(np.isfinite)


def dropped():
    """Lifted by the motor, then dropped."""
    return simulated(one_second)


def one_second(t):
    return t < 1.0


@cache
def both():
    return believed([*driven(), *dropped()], 1.1 * KT, 0.9 * R)


START = Friction(CoulombViscous(), [[0.02, 0.006]])


@pytest.fixture(scope="module")
def found():
    return refine(START, both(), (FrictionBlock(), ActuatorBlock()), SHORT)


def test_wrong_motor_constants_are_found_where_the_motor_is_disconnected_for_a_while(found):
    assert_allclose(found.calibration.motor, [KT, R], rtol=0.02)
    assert_allclose(found.friction.theta[0, 0], TRUE[0, 0], rtol=0.03)
    assert_allclose(found.friction.theta[0, 1], TRUE[0, 1], rtol=0.15)
    covariance = found.covariance
    assert [e.name for e in covariance.parameters[-2:]] == ["kt", "R"]
    ends = covariance.interval(0.95)
    assert covariance.identified.all()
    width = ends[:, 1] - ends[:, 0]
    true = np.array([*TRUE[0], KT, R])
    assert (np.abs(covariance.values - true) < width).all()


def test_the_torque_of_the_found_motor_is_judged_and_runs_free(found):
    protocol = Protocol(horizons=(0.25,), whole=True)
    view = with_calibration(prepare(both(), protocol), found.calibration)
    for servo, recording in zip(view.trajectory.servos, view.dataset.recordings, strict=True):
        assert_array_equal([servo.kt, servo.R], found.calibration.motor)
        assert_allclose(
            recording.torque.value, servo_torque(servo, recording.angle).value, atol=1e-12
        )


@pytest.mark.parametrize(
    ("fixed", "law"), [(("kt",), CoulombViscous()), (("R",), MotorLoad())], ids=["kt", "R"]
)
def test_one_constant_is_found_with_the_other_known(fixed, law):
    loss = 0.1 if isinstance(law, MotorLoad) else 0.0
    logs = simulated(np.isfinite, loss=loss)
    known = {"kt": (KT, 1.1 * R), "R": (1.1 * KT, R)}[fixed[0]]
    theta = np.array([[0.02, 0.006, 0.05][: len(law.names)]])
    own = refine(
        Friction(law, theta),
        believed(logs, *known),
        (FrictionBlock(), ActuatorBlock(fixed=fixed)),
        SHORT,
    )
    assert_allclose(own.calibration.motor, [KT, R], rtol=0.02)
    assert_allclose(own.friction.theta[0, 0], TRUE[0, 0], rtol=0.05)
    if loss:
        assert_allclose(own.friction.theta[0, 2], loss, rtol=0.05)


def test_a_known_motor_gives_what_its_torque_along_the_measured_motion_gives():
    """Two routes to one answer, as long as angles have little noise and few gaps."""
    logs = believed(driven(), KT, R)
    by_voltage = refine(START, logs, (FrictionBlock(), ActuatorBlock(fixed=("kt", "R"))), SHORT)
    by_torque = refine(START, logs, (FrictionBlock(),), SHORT)
    assert_allclose(by_voltage.friction.theta, by_torque.friction.theta, rtol=0.02)
    assert_array_equal(by_voltage.calibration.motor, [KT, R])


@pytest.mark.parametrize("law", [CoulombViscous(), MotorLoad()])
def test_derivatives_are_the_slopes_of_the_ends(law):
    theta = np.array([[0.02, 0.006, 0.1][: len(law.names)]])
    motor = ActuatorBlock(prior=0.1)
    blocks = (FrictionBlock(), InertiaBlock(), DelayBlock(), BiasBlock(), OffsetBlock(), motor)
    data = believed([driven()[0], dropped()[1]], KT, R)
    problem, estimate = prepare_fit(Friction(law, theta), intervals_of(data), blocks, SHORT)
    intervals = problem.intervals
    u = np.concatenate([r.torque.value[:-1, 0] for r in data.recordings])
    kink = (u != 0.0) & (np.abs(u) < 0.01)  # of |u|
    away = np.flatnonzero((np.abs(intervals.w[:, 0]) > 1.0) & ~kink)[::9]
    B = drive_of(intervals, estimate.calibration, estimate.mechanism).loop.feedback[away, 1]
    assert (B == 0).any() and (B > 0).any()  # disconnected and connected
    seen = assert_slopes(problem, estimate, away, time=1 / RATE)
    assert seen == len(values_of(estimate, problem.blocks))


def feedback(B):
    return np.stack([0.0 * B, B], axis=1)


def moving(recordings):
    angle = recordings[0].angle
    rate = np.gradient(angle.value, angle.time, axis=0)
    return recordings[0].servo, angle, angle.time, rate


def test_voltage_falls_at_once_where_the_motor_is_switched_off():
    servo, angle, time, rate = moving(dropped())
    emf = KT**2 / R * servo.connected((time[1:] + time[:-1]) / 2)
    motion = ServoMotion(angle, Signal(time, rate))
    torque = torque_signal(servo.with_motor(KT, R), motion, time[:-1], feedback(emf))
    volts = torque._replace(value=R / KT * torque.value)  # what remains without the motion
    off = angle.time[np.argmin(servo.enabled.value[:, 0])]
    before, after = sample(volts, [off - 2e-5, off])[:, 0]
    assert after == 0.0
    assert before == pytest.approx(
        servo.voltage(np.array([off]), sample(angle, [off]))[0, 0], rel=0.05
    )
    assert_allclose(
        sample(volts, angle.time), servo.voltage(angle.time, angle.value)
        * servo.connected(angle.time), atol=1e-12,
    )  # fmt: skip


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_part_that_follows_velocity_changes_at_once_up_and_down(way):
    servo, angle, time, rate = moving(driven())
    middle = len(time) // 2
    B = np.where(np.arange(len(time) - 1) < middle, 0.5 - 0.1 * way, 0.5 + 0.1 * way)[:, None]
    motion = ServoMotion(angle, Signal(time, rate + 1.0))
    torque = torque_signal(servo, motion, time[:-1], feedback(B))
    beside = torque_signal(servo, motion, time[:-1], feedback(0.0 * B))
    edge = time[middle]
    for at, share in ((edge - 1e-4, B[0, 0]), (edge, B[-1, 0])):
        own = sample(torque, [at]) - sample(beside, [at])
        assert_allclose(own, share * sample(motion.w, [at]), rtol=1e-3)


def test_between_samples_the_controller_sees_a_cubic_and_no_chord():
    """Angles and velocities of a cubic polynomial give back its angles at any time."""
    time = np.linspace(0.0, 1.0, 11)
    cubic = np.polynomial.Polynomial([0.3, -1.0, 2.0, 5.0])
    q, w = cubic(time)[:, None], cubic.deriv()(time)[:, None]
    recording = replace(driven()[0], angle=Signal(time, q, "linear"))
    data = Dataset("cubic", MECHANISM, (recording,))
    intervals = intervals_of(data, states=(States(time, q, w),))
    motion = intervals.servos[0].motion
    fine = np.linspace(0.0, 1.0, 201)
    assert_allclose(motion.at(fine)[0][:, 0], cubic(fine), atol=1e-12)


def test_torques_of_recordings_together_are_those_of_each():
    """With late targets and torques, backlash, held targets, and clocks of different lengths."""
    late = {"target_delay": 0.03, "delay": -0.01, "backlash": 0.02}
    recordings = []
    for k, recording in enumerate((*driven(), *dropped()[:2])):
        held = recording.servo.goal._replace(hold="previous")
        servo = replace(recording.servo, goal=held, gain=2.0 if k == 1 else 3.0, **late)
        angle = taken(recording.angle, np.arange(20 * k, int(RATE * SECONDS)))
        recordings.append(replace(recording, name=str(k), angle=angle, servo=servo))
    together = believed(recordings, KT, R)
    calibration = replace(Calibration.ideal(1), delay=np.array(0.004))

    def driving(intervals):
        drive = drive_of(intervals, calibration, together.mechanism)
        edges = np.stack([intervals.time, intervals.time + intervals.dt], axis=1) - 0.004
        pieces = pieces_of(drive.torque, intervals.recording, edges)
        return [np.concatenate([*pieces.mean, *pieces.moment], axis=1), *drive.loop[1:3]]

    every = intervals_of(together)
    assert [group.members for group in every.servos] == [[0, 2, 3, 4], [1]]
    for r, recording in enumerate(together.recordings):
        states = (every.states[r],)
        each = intervals_of(replace(together, recordings=(recording,)), states=states)
        for ours, theirs in zip(driving(every), driving(each), strict=True):
            assert_allclose(ours[every.recording == r], theirs, rtol=1e-9, atol=1e-10)


def test_what_no_data_can_tell_is_refused_in_one_line():
    motor, first, *rest = ActuatorBlock(), *both().recordings
    without = [replace(r, servo=None) for r in (first, *rest)]
    other = replace(first, name="other")
    for recordings, blocks, words in (
        (without, (motor,), "no recording knows the servo .* leave the block out"),
        ((first, *without[1:]), (motor,), "has a torque and no servo"),
        (driven(), (motor,), r"only kt/R and the sum of viscous friction and kt\^2/R"),
        (driven(), (InertiaBlock(), ActuatorBlock(("kt",))), "all base parameters free: a smaller"),
        (both().recordings, (GainBlock(), motor), "a gain of the torque is one of kt/R"),
        ((*driven(), other), (motor,), "2 different motors"),
    ):
        intervals = intervals_of(replace(both(), recordings=tuple(recordings)))
        with assert_refused(words):
            prepare_fit(START, intervals, (FrictionBlock(), *blocks), SHORT)


def test_an_unknown_constant_to_fix_is_named():
    with assert_refused("no constant 'Kt' to fix; known are kt, R"):
        ActuatorBlock(fixed=("Kt",))
