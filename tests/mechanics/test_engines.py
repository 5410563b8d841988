"""A physics engine that others wrote agrees with our equations of motion to 1e-8.

The machine moves in the x-y plane, gravity along -y, hinges along +z: q = 0 hangs down along -y and
counter-clockwise is positive, as in `frictionid.mechanics`.
"""

from typing import NamedTuple

import numpy as np
import pytest
from fixtures.random_machines import assert_close, drawn, moments_of_inertia

from frictionid.arrays import solve, times
from frictionid.mechanics import acrobot, double_pendulum, pendulum

REASON = "a physics engine to compare with; the test extra installs it"
MACHINES = {
    "acrobot": acrobot(),
    "double_pendulum-11": double_pendulum(),
    "double_pendulum-10": double_pendulum((True, False)),
    "double_pendulum-01": double_pendulum((False, True)),
    "pendulum": pendulum(),
}


class Part(NamedTuple):
    """A body as the engine wants it: on which link, how far from its joint, mass and inertia."""

    link: int
    distance: float
    mass: float
    inertia: float = 0.0


class Case(NamedTuple):
    """Random machines, states and inputs, one per row, and the accelerations that we compute."""

    parameters: list
    q: np.ndarray
    w: np.ndarray
    u: np.ndarray
    h: np.ndarray
    a: np.ndarray
    energy: np.ndarray
    load: np.ndarray


@pytest.fixture(params=MACHINES)
def name(request):
    return request.param


def case_of(name):
    mechanism = MACHINES[name]
    v, q, w, u = drawn(mechanism, 1)
    t, load = mechanism.terms(mechanism.base(v), q, w), mechanism.load(v, q, w, 0.3 * u)
    u = times(t.B, 0.3 * u)
    rows = [{k: float(x[i]) for k, x in v.items()} for i in range(len(q))]
    return Case(rows, q, w, u, t.h, solve(t.M, t.h + u), t.energy, load)


def parts_of(name, v):
    """The machine's bodies; link 1 has the inertia of what stands on its shaft, too."""
    if name.startswith("pendulum"):
        return [Part(0, v["length"], v["mass"], v["inertia"])]
    if name.startswith("double"):
        return [
            Part(0, v["r1"], v["m1"], v["I1"] - v["m1"] * v["r1"] ** 2),
            Part(1, v["r2"], v["m2"], v["I2"] - v["m2"] * v["r2"] ** 2),
        ]
    J1, J2 = moments_of_inertia(v)
    return [
        Part(0, v["L1"], v["m1"], J1),
        Part(0, v["L2"], v["m2"]),
        Part(1, v["L3"], v["m3"], J2),
        Part(1, v["L4"], v["m4"]),
    ]


def elbow(v):
    """Distance of joint 2 from joint 1."""
    return v.get("L2", v.get("l1", 0.0))


def rotors_of(name, v):
    """Rotor inertia that turns at gear w1, and that which turns at w1 - gear w2; gear ratio."""
    if name == "pendulum":
        return v["rotor"], 0.0, v["gear"]
    if name.startswith("acrobot"):
        return 0.0, v["rotor"], v["gear"]
    first, second = MACHINES[name].driven
    return first * v["Ir"], second * v["Ir"], v["gr"]


def mjcf(name, v):
    """The machine as MuJoCo reads it: each part a body of its own, welded to its link.

    A tendon with coefficients 1 and -gear moves at w1 - gear w2, so its armature is the second
    rotor; the first one is an armature of joint 1.
    """
    first, second, gear = rotors_of(name, v)
    parts = parts_of(name, v)

    def link(number, inside=""):
        bodies = "".join(
            f'<body pos="0 {-part.distance!r} 0"><inertial pos="0 0 0" mass="{part.mass!r}" '
            f'diaginertia="{part.inertia!r} {part.inertia!r} {part.inertia!r}"/></body>'
            for part in parts
            if part.link == number
        )
        at, armature = (elbow(v), 0.0) if number else (0.0, first * gear**2)
        return (
            f'<body name="link{number}" pos="0 {-at!r} 0">'
            f'<joint name="joint{number}" axis="0 0 1" armature="{armature!r}"/>'
            f"{bodies}{inside}</body>"
        )

    two = MACHINES[name].n == 2
    tendon = (
        f'<tendon><fixed armature="{second!r}"><joint joint="joint0" coef="1"/>'
        f'<joint joint="joint1" coef="{-gear!r}"/></fixed></tendon>'
    )
    return (
        f'<mujoco><compiler angle="radian"/><option gravity="0 {-v["g"]!r} 0">'
        f'<flag energy="enable"/></option>'
        f"<worldbody>{link(0, link(1) if two else '')}</worldbody>{tendon if two else ''}</mujoco>"
    )


def test_mujoco_agrees(name):
    """Accelerations, gravity and velocity terms, energy and bearing forces, rotors included."""
    mujoco = pytest.importorskip("mujoco", reason=REASON)
    case = case_of(name)
    a, h, energy, load = (np.zeros_like(x) for x in (case.a, case.h, case.energy, case.load))
    for i, v in enumerate(case.parameters):
        model = mujoco.MjModel.from_xml_string(mjcf(name, v))
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = case.q[i], case.w[i], case.u[i]
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        a[i], h[i], energy[i] = data.qacc, -data.qfrc_bias, data.energy.sum()
        for j in range(len(a[i])):
            force = data.cfrc_int[model.body(f"link{j}").id][3:]
            load[i, j] = np.linalg.norm(force)
    np.testing.assert_allclose(case.a, a, rtol=1e-8, atol=1e-8)
    assert_close(case.h, h, 1e-8)
    assert_close(case.energy, energy, 1e-8)
    assert_close(case.load, load, 1e-8)
