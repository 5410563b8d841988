"""Envelopes of motors from measured torques: found where these saturate, not reached elsewhere.

Motion and torque are of a simulated servo whose motor has an envelope, by code of its own.
"""

from functools import cache
from itertools import product

import numpy as np
import pandas as pd
import pytest
from drive_logs import ServoPendulum

import frictionid as fid
from frictionid.check.motion import motions_of
from frictionid.check.torque_speed import limit_findings

RIG = fid.mechanisms.pendulum(mass=ServoPendulum.mass, length=ServoPendulum.length)


@cache
def check(noise=0.0, measured=True, given=None, **motor):
    rig, frames = ServoPendulum(**motor), {}
    for seed in range(3):
        log = pd.DataFrame(rig.log(10.0, 0.15, seed=seed, seconds=6.0))
        log["u"] += noise * np.random.default_rng(seed).normal(size=len(log))
        frames[f"{seed}"] = log if measured else log.drop(columns="u")
    columns = {"time": "t", "angle": "q"}
    if measured:
        return fid.check(
            fid.Dataset.from_frames(frames, RIG, **columns, torque="u", hold="previous")
        )
    actuator = dict(target="target", output="torque", P=10.0, D=0.15, delay=rig.delay)
    names = ("peak_torque", "knee_speed", "no_load_speed")
    actuator |= dict(zip(names, given, strict=True))
    return fid.check(fid.Dataset.from_frames(frames, RIG, **columns, actuator=actuator))


def said(verdict):
    findings = verdict.findings
    return findings.text[findings.kind.isin(["torque_speed", "motor_limit", "motor_below_limit"])]


MOTORS = [(0.4, 2.0, 5.0), (0.3, 2.0, 4.0), (0.35, 1.0, 6.0), (0.4, 3.0, 4.0), (0.3, 1.0, 8.0)]


@pytest.mark.parametrize(
    ("motor", "noise"), [*((m, 0.0) for m in MOTORS), *((m, 0.005) for m in MOTORS[:3])]
)
def test_peak_knee_and_no_load_speed_are_found(motor, noise):
    verdict = check(noise=noise, peak=motor[0], knee=motor[1], no_load=motor[2])
    (row,) = verdict.torque_speed.to_dict("records")
    for name, truth in zip(("peak", "knee", "no_load"), motor, strict=True):
        assert row[name] == pytest.approx(truth, rel=0.03)
        assert abs(row[name] - truth) < 3 * max(row[f"{name}_half"], 0.002 * truth)
    (text,) = said(verdict)
    assert text.startswith("torque 1 has a peak of")


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_torque_that_never_saturates_reaches_none(noise):
    verdict = check(noise=noise)
    (row,) = verdict.torque_speed.to_dict("records")
    assert np.isnan([row["peak"], row["knee"], row["no_load"]]).all()
    assert row["torque"] > 0.4 and row["speed"] > 5.0  # how near it came
    assert said(verdict).empty


def test_a_peak_alone_is_found_where_the_fall_is_not_reached():
    verdict = check(peak=0.35, knee=30.0, no_load=60.0)
    (row,) = verdict.torque_speed.to_dict("records")
    assert row["peak"] == pytest.approx(0.35, rel=0.01) and np.isnan(row["no_load"])
    assert "its fall is not reached" in said(verdict).iloc[0]


def test_of_servos_it_is_said_how_near_their_limit_they_come():
    (text,) = said(check(measured=False, given=MOTORS[0], peak=0.4, knee=2.0, no_load=5.0))
    assert "is at the limit of its motor in" in text
    (text,) = said(check(measured=False, given=(0.9, 9.0, 18.0)))
    assert "never reaches the limit of its motor" in text


@pytest.mark.parametrize("delay", [0.0198, 0.02, 0.0202])
def test_a_servo_is_at_its_limit_in_the_samples_in_which_its_duty_is(delay):
    """Also in braking, and whichever side of a sample the targets of two samples ago step."""
    t = np.arange(400) / 100
    target = 1.2 * np.sign(np.sin(9 * t) + 0.1)
    duty = 1.1 * (np.r_[target[[0, 0]], target[:-2]] - np.sin(9 * t))
    servo = dict(target="target", output="duty", P=1.1, kt=1.0, R=9.0, supply=12.0, delay=delay)
    frames = {"a": pd.DataFrame({"t": t, "q": np.sin(9 * t), "target": target})}
    data = fid.Dataset.from_frames(frames, RIG, time="t", angle="q", actuator=servo)
    (limit,) = limit_findings(data, [m.states for m in motions_of(data.recordings)], ())
    assert limit.numbers["at"] == (np.abs(duty) >= 0.98).mean()


def test_torques_that_step_between_two_levels_have_no_fall():
    """Three runs of each level and seed, simulated side by side."""
    rig = fid.mechanisms.pendulum(mass=0.4, length=0.25)
    friction = fid.Friction(fid.CoulombViscous(), [[0.03, 0.01]])
    simulator, t, runs = fid.Simulator(rig, friction, dt=1 / 480), np.arange(4801) / 480, []
    for level, seed in product([1.2, 3.0], [0, 1]):
        rng = np.random.default_rng(seed)
        for _ in range(3):
            u = level * np.repeat(rng.choice([-1, 1], 31), 160)[: len(t)]
            runs.append((u, rng.normal(0, 1e-3, len(t))))
    u, noise = np.array(runs).transpose(1, 2, 0)
    q = simulator.run(simulator.reset(q=np.zeros((12, 1))), u=u[:-1, :, None]).q[..., 0] + noise
    frames = [pd.DataFrame({"t": t, "q": q[:, k], "u": u[:, k]})[::4] for k in range(12)]
    for first in range(0, 12, 3):
        named = {f"{k}": frames[k] for k in range(first, first + 3)}
        verdict = fid.check(fid.Dataset.from_frames(named, rig, time="t", angle="q", torque="u"))
        assert verdict.torque_speed[["knee", "no_load"]].isna().all(axis=None)
        assert "its fall is not reached" in said(verdict).iloc[0]


@pytest.mark.usefixtures("real_data")
@pytest.mark.parametrize("name", ["dfki_c1", "tiago"])
def test_recordings_of_machines_within_their_limits_show_none(name):
    """Of the other machines, `test_real_checks` and `test_traps_of_arms` allow no such finding."""
    verdict = fid.check(name)
    assert verdict.torque_speed[["peak", "no_load"]].isna().all(axis=None)
