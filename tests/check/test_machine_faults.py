"""A joint that meets a stop, by MuJoCo: named with its angle; one that turns back freely is not.

Friction that changes from recording to recording, or within each, is named, by its size;
constant one is not.
"""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from fixtures.driven_pendulum import simulated

from frictionid.check import check
from frictionid.data.recordings import Dataset
from frictionid.simulate import Camera, Multisine, Run

XML = """<mujoco><compiler angle="radian"/><option timestep="0.0005"/><worldbody><body>
<joint axis="0 1 0" frictionloss="0.1" damping="0.02" limited="{limited}" range="-0.6 0.6"/>
<geom type="sphere" size="0.02" pos="0 0 -0.4" mass="0.5"/></body></worldbody></mujoco>"""
MACHINE = {"kind": "pendulum", "parameters": {"mass": 0.5, "length": 0.4}}


def recording(limited, seed):
    """Twelve seconds at 200 Hz of a periodic torque."""
    model = mujoco.MjModel.from_xml_string(XML.format(limited=limited))
    data, rng, steps = mujoco.MjData(model), np.random.default_rng(seed), 10
    time = 0.005 * np.arange(2400)
    torque = 1.8 * np.sin(2 * np.pi * rng.uniform(0.5, 0.7) * time)
    angle = np.zeros(len(time))
    for k, u in enumerate(torque):
        angle[k], data.qfrc_applied[0] = data.qpos[0], u
        mujoco.mj_step(model, data, steps)
    angle += 2e-4 * rng.standard_normal(len(time))
    return {"time": time, "angle": angle[:, None], "torque": torque[:, None]}


@pytest.mark.parametrize("limited", ["true", "false"])
def test_a_stop_is_named_with_its_angle(limited):
    runs = {f"r{k}": recording(limited, k) for k in range(3)}
    verdict = check(Dataset.from_arrays(runs, MACHINE, hold="previous"))
    stops = [f for f in verdict.findings if f.kind == "end_stop"]
    if limited == "false":
        assert not stops and verdict.level == "good"
        return
    # a stop of MuJoCo gives way
    assert sorted(f.numbers["angle"] for f in stops) == pytest.approx([-0.6, 0.6], abs=0.05)
    assert verdict.findings[0].kind == "end_stop" and all(f.joint == 1 for f in stops)


CAMERA = Camera(360, 60.0, 5e-4)


def warming(levels):
    """One recording of 6 s with each Coulomb level [N m]."""
    out = []
    for k, level in enumerate(levels):
        runs = (Run(f"r{k}", (0.2 * k,), torques=(Multisine(1.2, (0.4 + 0.05 * k, 0.9, 1.6)),)),)
        out.append(simulated(level, 0.001, CAMERA, runs, length=0.4, seed=k))
    first = out[0]
    return replace(first, recordings=tuple(data.recordings[0] for data in out))


@pytest.mark.parametrize("rise", [0.4, -0.4, 0.0])
def test_friction_that_grows_or_falls_is_named_by_how_much(rise):
    middle = (np.arange(6) + 0.5) / 6 - 0.5
    levels = 0.25 * (1.0 + rise * middle)
    verdict = check(warming(levels))
    named = [f for f in verdict.findings if f.kind == "friction_drift"]
    assert len(named) == (rise != 0.0)
    for f in named:
        assert f.joint == 1 and abs(f.numbers["change"] - rise) < 0.15 * abs(rise)
        assert ("grows" if rise > 0 else "falls") in f.text and verdict.level == "doubtful"


def warming_within(rise, late):
    """Five recordings of 8 s at 100 Hz, friction grown by the share `rise` at the end of each.

    The torque acts `late` samples after it is logged. Integrated in steps of .1 ms.
    """
    count, per = 800, 100
    time = np.arange(count) / 100
    rng = np.random.default_rng(7)
    phase, rate = rng.uniform(0, 6, (5, 3)), rng.uniform(0.4, 1.6, (5, 3))
    u = np.sin(2 * np.pi * rate[..., None] * time + phase[..., None]).sum(1) * 0.7
    acts = np.concatenate([np.zeros((5, late)), u], axis=1)[:, :count]
    q, w, h = np.zeros(5), np.zeros(5), 0.01 / per
    angle = np.zeros((5, count))
    for k in range(count):
        angle[:, k] = q
        for s in range(per):
            level = 0.3 * (1 + rise * ((k + s / per) / count - 0.5))
            friction = level * (np.tanh(w / 0.002) + 0.05 * w)
            w = w + h * (acts[:, k] - 1.962 * np.sin(q) - friction) / 0.08
            q = q + h * w
    angle += 2e-4 * rng.standard_normal(angle.shape)
    runs = {
        f"r{i}": {"time": time, "angle": a[:, None], "torque": b[:, None]}
        for i, (a, b) in enumerate(zip(angle, u, strict=True))
    }
    return Dataset.from_arrays(runs, MACHINE, hold="previous")


@pytest.mark.parametrize(("rise", "late"), [(0.4, 0), (-0.4, 2), (0.0, 0)])
def test_friction_that_changes_within_each_recording_is_named(rise, late):
    """Beside a late torque, too: a machine seldom has one fault alone."""
    verdict = check(warming_within(rise, late))
    named = [f for f in verdict.findings if f.kind == "friction_drift"]
    assert len(named) == (rise != 0.0) and (verdict.level == "good") == (rise == 0.0)
    for f in named:
        assert abs(f.numbers["change"] - rise) < 0.15 * abs(rise) and "within each" in f.text
