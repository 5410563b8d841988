"""Servos without a torque log: friction, late targets, backlash, envelopes, a leg."""

from functools import cache

import mujoco
import numpy as np
import pandas as pd
import pytest
from drive_logs import ServoPendulum
from fixtures.servo_logs import by_controller, by_torque
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import Servo, servo_torque
from frictionid.data.signals import Signal
from frictionid.fitting.shooting.settings import WINDOWS

SOFT, STIFF = {"soft": (4.0, 0.05)}, {"stiff": (10.0, 0.15)}
BACKLASH = np.radians(0.5)


def dataset(rig, gains=None, runs=2, seconds=4.0, **actuator):
    """Runs under each set of gains (P, D) by name; `actuator` may say otherwise."""
    gains = SOFT | STIFF if gains is None else gains
    logs = {
        f"{name} {run}": rig.log(*pair, seed=62 * k + 32 * run, seconds=seconds)
        for k, (name, pair) in enumerate(gains.items())
        for run in range(runs)
    }
    tables = {f"{name}*": dict(zip("PD", pair, strict=True)) for name, pair in gains.items()}
    first, *others = tables
    settings = tables[first] | {"recordings": {name: tables[name] for name in others}}
    return by_controller(rig, logs, **settings | actuator)


def fitted(data, *free):
    fit = fid.fit(data, "coulomb_viscous", method="shooting", free=list(free) or None)
    return fit, {(row.block, row.parameter): row.value for row in fit.frame.itertuples()}


def findings_of(verdict):
    return {row.kind: row for row in verdict.findings.itertuples()}


def friction_and_delay(found):
    """Coulomb and viscous friction, and the delay of the targets."""
    return [found["friction", "coulomb"], found["friction", "viscous"], found[LATE]]


LATE = ("target_delay", "target delay")
LOOSE = ServoPendulum(backlash=BACKLASH)


@pytest.fixture(scope="module")
def loose():
    return fitted(dataset(LOOSE), "target_delay", "backlash")


def test_friction_delay_and_backlash_are_found_from_targets_alone(loose):
    _, found = loose
    assert_found(LOOSE, friction_and_delay(found))
    assert found["backlash", "backlash"] == pytest.approx(BACKLASH, rel=0.2)


def test_without_the_backlash_the_fit_says_that_it_would_show():
    fit, found = fitted(dataset(LOOSE), "target_delay")
    assert any("Not free, and would show: 'backlash'" in w for w in fit.convergence.warnings)
    assert abs(found["friction", "coulomb"] / LOOSE.coulomb - 1) > 0.3


def test_a_gain_set_that_was_held_out_is_predicted_as_well_as_those_that_were_fitted(loose):
    fit, _ = loose
    other = dataset(LOOSE, {"other": (6.0, 0.1)}, runs=1, seconds=6.0)
    held_out = free_run_error(fit, other)
    usual = free_run_error(fit, dataset(LOOSE, runs=1))
    assert held_out < 1.5 * usual and held_out < np.radians(0.5)


@pytest.mark.parametrize(("late", "gains"), [(0.002, STIFF), (0.012, SOFT)])
def test_a_late_target_is_found_and_passes_for_no_viscous_friction(late, gains):
    rig = ServoPendulum(viscous=0.0, delay=late)
    coulomb, viscous, delay = friction_and_delay(fitted(dataset(rig, gains))[1])
    assert coulomb == pytest.approx(rig.coulomb, rel=0.05)
    assert delay == pytest.approx(late, abs=1e-3)
    assert abs(viscous) < 0.05 * rig.coulomb  # [N m] at 1 rad/s


def test_a_late_target_that_is_taken_for_a_late_torque_is_not_found():
    """The delay of a torque also takes off damping, which would be made up for by friction."""
    rig = ServoPendulum(viscous=0.0, delay=0.012)
    _, found = fitted(dataset(rig, STIFF), "delay")
    assert found["friction", "viscous"] > 0.3 * rig.coulomb


def assert_found(rig, found, rel=0.05):
    coulomb, viscous, delay = found
    assert coulomb == pytest.approx(rig.coulomb, rel=0.05)
    assert viscous == pytest.approx(rig.viscous, rel=rel)
    assert delay == pytest.approx(rig.delay, abs=1e-3)


def test_a_limit_of_the_torque_is_kept():
    rig = ServoPendulum(limit=0.8)
    data = dataset(rig, STIFF, seconds=6.0, limit=0.8)
    torque = data.recordings[0].torque.value
    assert np.mean(np.abs(torque) == 0.8) > 0.03
    assert_found(rig, friction_and_delay(fitted(data)[1]), rel=0.1)


def test_a_one_step_fit_says_that_it_takes_targets_as_logged():
    said = "targets are taken to act when they are logged"
    for late in (0.0, 0.01):
        data = dataset(LOOSE, delay=late)
        fit = fid.fit(data, "coulomb_viscous", method="one_step")
        assert any(said in s for s in fit.friction.provenance.torque) == (late == 0.0)
        assert (said in repr(fit)) == (said in fit._repr_html_()) == (late == 0.0)


def test_constants_of_a_motor_are_refused_where_the_controller_puts_out_a_torque():
    data = dataset(LOOSE)
    with pytest.raises(fid.InputError, match='output = "torque" knows no kt and R'):
        fitted(data, "actuator")


def test_a_backlash_or_late_target_needs_a_servo():
    data = by_torque(LOOSE, {"a": LOOSE.log(4.0, 0.05, seed=0, seconds=4.0)})
    for name in ("backlash", "target_delay"):
        with pytest.raises(fid.InputError, match=f"block '{name}': no recording knows the servo"):
            fitted(data, name)


def test_check_names_late_targets_backlash_and_what_one_payload_cannot_tell():
    verdict = fid.check(dataset(LOOSE))
    found = findings_of(verdict)
    assert found["late_targets"].numbers["delay"] == pytest.approx(LOOSE.delay, abs=1e-3)
    assert found["backlash"].numbers["backlash"] == pytest.approx(BACKLASH, rel=0.2)
    assert "grows with the load cannot be seen" in found["one_payload"].text
    assert any(line.startswith("one payload: add") for line in verdict.next)
    assert "one_gain_set" not in found and verdict.level == "good"


@pytest.mark.parametrize(("factor", "named"), [(0.5, 1), (0.8, 1), (1.0, 0), (4.0, 1)])
def test_check_names_a_wrong_position_gain_beside_other_causes(factor, named):
    """Of all recordings, and of one gain set alone."""
    rig, P = ServoPendulum(), 4.0 * factor
    stiff = {"recordings": {"stiff*": {"P": 10.0 * factor, "D": 0.15}}}
    for data in (dataset(rig, P=P, **stiff), dataset(rig, SOFT, P=P)):
        texts = fid.check(data).findings["text"]
        assert texts.str.contains("a wrong position gain may be the cause").sum() == named


def two_payloads(**friction):
    """One gain set, two masses at the end of the arm."""
    rigs = {"light": ServoPendulum(**friction), "heavy": ServoPendulum(mass=0.8, **friction)}
    logs = {name: rig.log(4.0, 0.05, seed=rig.mass > 0.6) for name, rig in rigs.items()}
    return by_controller(rigs["light"], logs, {"heavy": {"mass": 0.8}}, P=4.0, D=0.05)


def test_check_asks_for_another_gain_set_but_for_no_other_payload_where_there_are_two():
    verdict = fid.check(two_payloads())
    kinds = set(verdict.findings["kind"])
    assert "one_gain_set" in kinds and not kinds & {"one_payload", "backlash", "load"}
    assert any(line.startswith("one gain set: add") for line in verdict.next)


def test_two_payloads_show_friction_that_grows_with_the_load():
    data = two_payloads(load=0.15)
    found = findings_of(fid.check(data))
    assert found["load"].numbers["size"] == pytest.approx(0.15, rel=0.1)
    assert "one_payload" not in found
    fit = fid.fit(data, "motor_load", method="shooting", free=["gain", "target_delay"])
    loss = fit.frame.set_index("parameter").loc["loss"]
    assert loss["value"] == pytest.approx(0.15, rel=0.05)
    assert loss["low_95"] > 0.1 and loss["high_95"] < 0.2


K, R, SUPPLY = 0.4, 3.0, 7.4
CONTROLLERS = [
    dict(output="voltage", P=5.0 * R / K, kt=K / 20, R=R, gear=20.0),
    dict(output="duty", P=5.0 * R / K / SUPPLY, kt=K, R=R, supply="vin", limit=100.0),
    dict(output="current", P=5.0 / 0.8 / K, D=K / R / 0.8, kt=K, efficiency=0.8),
    dict(output="torque", P=5.0, D=K * K / R, target_velocity="rate", feedforward="more"),
]


@pytest.mark.parametrize("actuator", CONTROLLERS, ids=lambda table: table["output"])
def test_all_outputs_of_a_controller_lead_to_the_same_friction(actuator):
    """The same motion, as the log of each controller that would have made it."""
    rig = ServoPendulum()
    log = pd.DataFrame(rig.log(5.0, K * K / R, seed=4, seconds=4.0)).assign(vin=SUPPLY)
    log = log.assign(rate=0.7 * np.cos(3 * log["t"]), more=0.05 * np.sin(log["t"]))
    if "feedforward" in actuator:
        log["target"] -= (K * K / R * log["rate"] + log["more"]) / 5.0
    data = by_controller(rig, {"a": log}, **actuator)
    assert_found(rig, friction_and_delay(fitted(data, "target_delay")[1]))


def test_what_another_fit_found_of_the_servo_is_held(loose):
    """Its delay and backlash in the torques where friction alone is free, else as priors."""
    known, _ = loose
    data = dataset(LOOSE, runs=1)
    for free in (["friction"], ["friction", "backlash"]):
        fit = fid.fit(data, "coulomb_viscous", method="shooting", free=free, calibration=known)
        found = fit.frame.set_index("parameter")["value"]
        assert list(found.index) == ["coulomb", "viscous", "backlash"][: len(free) + 1]
        assert found["coulomb"] == pytest.approx(LOOSE.coulomb, rel=0.05)
        assert found["viscous"] == pytest.approx(LOOSE.viscous, rel=0.05)


def test_check_says_where_a_controller_is_too_fast_for_its_samples():
    rig = ServoPendulum()
    for P, D in ((10.0, 0.15), (20.0, 0.5), (100.0, 1.0)):
        data = dataset(rig, {"one": (P, D)}, runs=1, seconds=6.0)
        found = findings_of(fid.check(data))
        assert ("fast_loop" in found) == (D > 0.15)
        if D > 0.15:  # J/D over the time of a sample
            assert found["fast_loop"].numbers["samples"] == pytest.approx(0.01125 / D * 200)
        else:
            assert found["late_targets"].numbers["delay"] == pytest.approx(0.010, abs=1e-3)
            assert all(row.level == "good" for row in found.values())


def test_gains_of_a_fast_controller_that_are_too_large_are_no_wrong_sign():
    """Its torques, of noise for the most part, would change their sign with the angle's."""
    data = dataset(ServoPendulum(), {"one": (100.0, 1.0)}, runs=6, seconds=3.0, P=300.0, D=3.0)
    found = findings_of(fid.check(data))
    assert "fast_loop" in found and all(row.level != "unusable" for row in found.values())
    assert found["gain"].numbers["size"] == pytest.approx(1 / 3, rel=0.3)


# --- Envelopes ------------------------------------------------------------------------------------

MOTOR = (0.4, 2.0, 5.0)
NAMES = ("peak_torque", "knee_speed", "no_load_speed")
TORN = ServoPendulum(**dict(zip(("peak", "knee", "no_load"), MOTOR, strict=True)))


def torn(rig, given):
    logs = {f"{k}": rig.log(10.0, 0.15, seed=k, seconds=6.0) for k in range(3)}
    envelope = {} if given is None else dict(zip(NAMES, given, strict=True))
    return by_controller(rig, logs, P=10.0, D=0.15, delay=rig.delay, **envelope)


def free_run_error(fit, data):
    run = fit.predict(data, whole=True)
    return float(np.sqrt(np.mean((run["q1"] - run["measured_q1"]) ** 2)))


@pytest.fixture(scope="module")
def envelope_fit():
    data = torn(TORN, (0.5, 1.6, 5.5))
    free = ["target_delay", "envelope"]
    return fid.fit(data, "coulomb_viscous", method="shooting", free=free)


def test_peak_knee_and_no_load_speed_follow_from_the_motion(envelope_fit):
    rows = envelope_fit.frame[envelope_fit.frame.block == "envelope"]
    assert rows.value.to_numpy() == pytest.approx(MOTOR, rel=0.01)
    assert rows.identified.all() and ((rows.high_95 - rows.low_95) < 0.03 * rows.value).all()
    friction = envelope_fit.frame[envelope_fit.frame.block == "friction"].value.to_numpy()
    assert friction == pytest.approx([TORN.coulomb, TORN.viscous], rel=0.02)


def test_free_runs_with_the_envelope_are_at_the_noise_and_without_it_far_off(envelope_fit):
    assert free_run_error(envelope_fit, torn(TORN, MOTOR)) < 2 * TORN.noise
    plain = fid.fit(torn(TORN, None), "coulomb_viscous", method="one_step")
    assert free_run_error(plain, torn(TORN, None)) > 50 * TORN.noise


def test_mujoco_predicts_the_same_by_its_own_motor(envelope_fit, tmp_path):
    made = envelope_fit.export("mujoco", tmp_path / "rig.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "rig.xml"))
    assert model.actuator_dyntype[0] == mujoco.mjtDyn.mjDYN_DCMOTOR
    assert made.round_trip.mean_apart < 1e-3 and not made.lost


def test_where_no_motor_saturates_it_is_not_identified():
    data = torn(ServoPendulum(), (0.9, 9.0, 18.0))
    fit = fid.fit(data, "coulomb_viscous", method="shooting", free=["target_delay", "envelope"])
    rows = fit.frame[fit.frame.block == "envelope"]
    assert not rows.identified.any() and rows.value.tolist() == pytest.approx([0.9, 9.0, 18.0])
    assert any("never reaches the limit of its motor" in s for s in fit.friction.provenance.limits)


def test_without_an_envelope_to_begin_with_there_is_one_clear_line():
    with pytest.raises(fid.InputError, match="give the envelope that the fit begins with"):
        fid.fit(torn(TORN, None), "coulomb_viscous", method="shooting", free=["envelope"])


# --- A leg in the air -----------------------------------------------------------------------------

INERTIA, GRAVITY, COULOMB, VISCOUS = 0.024, 1.0, 0.2, 0.3
LEG_P, LEG_D = 20.0, 1.5
LEG_RATE, SECONDS, FINE = 200, 7.0, 50


@cache
def leg(peak=0.0):
    """One recording, simulated by drift and kick, friction as what stops the joint at most.

    peak : [N m] more of it below some 0.1 rad/s
    """
    time = np.arange(int(LEG_RATE * SECONDS)) / LEG_RATE
    turns = np.cumsum(0.3 + 0.02 * time) / LEG_RATE
    targets = 0.3 * (4.0 * np.abs(turns % 1.0 - 0.5) - 1.0)
    h, q, w, angles = 1.0 / LEG_RATE / FINE, targets[0], 0.0, []
    damped = 1.0 + h / INERTIA * (LEG_D + VISCOUS)
    for target in targets:
        angles.append(q)
        for _ in range(FINE):
            q += h / 2 * w
            wanted = (w + h / INERTIA * (LEG_P * (target - q) - GRAVITY * np.sin(q))) / damped
            most = h / INERTIA * (COULOMB + peak * np.exp(-((w / 0.1) ** 2))) / damped
            w = np.sign(wanted) * max(abs(wanted) - most, 0.0)
            q += h / 2 * w
    noise = 5e-4 * np.random.default_rng(0).normal(size=len(time))
    held = {"hold": "previous"}
    goal, on = Signal(time, targets[:, None], **held), Signal(time, np.ones((len(time), 1)), **held)
    servo = Servo(goal, on, gain=LEG_P, limit=50.0, damping=LEG_D, output="torque")
    angle = Signal(time, (np.array(angles) + noise)[:, None])
    recording = Recording("leg", angle, servo_torque(servo, angle), servo=servo)
    rig = {"mass": 0.5, "length": 0.1, "rotor": INERTIA - 0.005, "g": GRAVITY / 0.05}
    return Dataset("leg", {"kind": "pendulum", "parameters": rig}, (recording,))


@pytest.mark.parametrize("sample_time", [None, 0.02])
def test_samples_of_any_distance_give_the_same_leg(sample_time):
    free, fixed = ["friction", "inertia", "target_delay"], ["inertia.gravity"]
    settings = {"free": free, "fixed": fixed, "sample_time": sample_time}
    fit = fid.fit(leg(), "coulomb_viscous", method="shooting", **settings)
    values = fit.frame.set_index("parameter").value
    assert fit.convergence.settled
    assert values["coulomb"] == pytest.approx(COULOMB, rel=0.05)
    assert values["viscous"] == pytest.approx(VISCOUS, rel=0.07)
    assert values["inertia"] == pytest.approx(INERTIA, rel=0.02)


def test_windows_are_longer_where_many_are_lost():
    """Those that hold a reversal are lost, and with them what friction is like there."""
    data = leg(peak=1.35)
    fits = [
        fid.fit(data, "coulomb_viscous", method="shooting", free=["friction"], windows=windows)
        for windows in (None, tuple(w + 1e-9 for w in WINDOWS))
    ]
    longer, short = (fit.convergence.windows for fit in fits)
    assert short == 3 * longer
    errors = [np.square(f.q1 - f.measured_q1).mean() for f in (x.predict(whole=True) for x in fits)]
    assert errors[0] < errors[1]


ROTORS, LEVELS, SLOPES = (0.012, 0.015, 0.02), (0.25, 0.35, 0.45), (0.08, 0.12, 0.1)
BODIES = (  # of a quadruped's leg: place, axis, inertial
    ("0 0 0", "1 0 0", 'pos="-.005 .002 0" mass=".68" diaginertia=".0005 .0009 .0006"'),
    ("0 .095 0", "0 1 0", 'pos="-.004 -.022 -.033" mass="1.15" diaginertia=".0058 .0056 .001"'),
    ("0 0 -.213", "0 1 0", 'pos=".005 0 -.13" mass=".24" diaginertia=".0014 .0014 .00005"'),
)


def three_joints(true):
    """MJCF of the leg, with rotors and friction, or without."""
    text = ""
    for j, (place, axis, inertial) in enumerate(BODIES):
        more = f'armature="{ROTORS[j]}" frictionloss="{LEVELS[j]}" damping="{SLOPES[j]}"' * true
        joint = f'<joint name="j{j}" axis="{axis}" solreffriction="0.0004 1" {more}/>'
        text += f'<body pos="{place}">{joint}<inertial {inertial}/>'
    option = '<option timestep="0.0002" integrator="implicitfast"/>'
    return f"<mujoco>{option}<worldbody>{text}{'</body>' * 3}</worldbody></mujoco>"


def test_rotors_that_a_legs_file_lacks_are_found_also_where_bodies_have_them(tmp_path):
    """Of its 18 base parameters one alone is named after a rotor. MuJoCo moves the leg."""
    model = mujoco.MjModel.from_xml_string(three_joints(true=True))
    state, time = mujoco.MjData(model), np.arange(0, 5.0, 0.005)
    middle, rates = np.array([0.0, 0.8, -1.7]), np.array([[5.0, 4.0, 6.1], [9.0, 7.3, 3.3]])
    goals = middle + 0.4 * np.sin(time[:, None, None] * rates + [0.0, 1.0, 2.0]).sum(1)
    state.qpos[:], angles = goals[0], []
    for k in range(len(time)):
        angles.append(state.qpos.copy())
        for _ in range(25):
            state.qfrc_applied[:] = 40.0 * (goals[max(k - 2, 0)] - state.qpos) - state.qvel
            mujoco.mj_step(model, state)
    noise = 2e-4 * np.random.default_rng(0).normal(size=goals.shape)
    names = [[f"{kind}{j}" for j in range(3)] for kind in "qg"]
    frame = pd.DataFrame(np.hstack([np.array(angles) + noise, goals]), columns=sum(names, []))
    (tmp_path / "leg.xml").write_text(three_joints(true=False))
    rig, actuator = fid.mechanisms.mjcf(tmp_path / "leg.xml"), {"P": 40.0, "D": 1.0}
    actuator |= {"target": names[1], "output": "torque"}
    columns = {"time": "t", "angle": names[0], "actuator": actuator}
    data = fid.Dataset.from_frames({"air": frame.assign(t=time)}, rig, **columns)
    verdict = fid.check(data)
    found = findings_of(verdict)
    assert found["late_targets"].numbers["delay"] == pytest.approx(0.01, abs=5e-4)
    assert verdict.level == "good" and "missing_rotors" in found
    fit = fid.fit(data, "coulomb_viscous")
    added = fit.calibration.base - rig.nominal_base
    assert_allclose(added[added != 0], ROTORS, rtol=0.03)
    assert_allclose(fit.friction.theta, np.array([LEVELS, SLOPES]).T, rtol=0.05)
    assert fit.calibration.target_delay == pytest.approx(0.01, abs=2e-4)
