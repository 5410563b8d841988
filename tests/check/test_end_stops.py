"""A joint that meets a stop, by MuJoCo: named with its angle; one that turns back freely is not."""

import mujoco
import numpy as np
import pytest

from frictionid.check import check
from frictionid.data.recordings import Dataset

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
