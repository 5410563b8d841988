"""Work on small data that compiles what fits and predictions run as machine code."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from frictionid.data.recordings import Dataset
from frictionid.mechanics import pendulum, urdf
from frictionid.progress import Done

from .check import check
from .fit import fit

_ARM = """<robot name="arm"><link name="base"/>
<link name="a"><inertial><origin xyz="0 0 .2"/><mass value="2"/>
<inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><origin xyz="0 0 .2"/><mass value="1"/>
<inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="k" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 .4"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>"""


def _motion(joints: int) -> dict[str, np.ndarray]:
    t = np.arange(600) / 100.0
    phase = np.arange(joints)
    angle = np.sin(2 * np.pi * (0.7 + 0.2 * phase) * t[:, None] + phase)
    noise = np.random.default_rng(0).normal(0.0, 1e-3, angle.shape)
    return {"time": t, "angle": angle + noise, "torque": 0.3 * np.cos(3.0 * t)[:, None] + 0 * angle}


def _joint() -> None:
    """A joint: check, state estimation, shooting, prediction."""
    data = Dataset.from_arrays({"a": _motion(1), "b": _motion(1)}, pendulum(mass=1.0, length=0.3))
    check(data)
    fit(data, "coulomb_viscous", free=["inertia"], iterations=2).predict()


def _arm() -> None:
    """Rigid bodies: their derivatives, their balance of torques, and a prediction."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "arm.urdf"
        file.write_text(_ARM, encoding="utf-8")
        arm = urdf(file)
        arm.partials(arm.base({}), *np.zeros((3, 1, 2)))  # for shooting
        data = Dataset.from_arrays({"a": _motion(2), "b": _motion(2)}, arm)
        check(data)
        fit(data, "coulomb_viscous", method="inverse_dynamics", free=["inertia"]).predict()


STEPS: tuple[tuple[str, Callable[[], None]], ...] = (("a joint", _joint), ("an arm", _arm))


def warm_up(done: Done) -> None:
    """Do each of the `STEPS`, and say with `done` which one is finished."""
    for name, work in STEPS:
        work()
        done(name)
