"""Equations of motion of many samples at once, beside Pinocchio sample by sample.

The loops call Pinocchio's algorithms (extra `engines`); ours has the results of all samples.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from acrobot_mjcf import mjcf
from case import Case, NotInstalledError, Part, Side
from over_samples import over_samples
from samples import RATE, acrobot

from frictionid.arrays import solve
from frictionid.data.plants import plant_of
from frictionid.fitting.one_step.recipe import STUDY, states_of
from frictionid.mechanics import RigidBodyTree, urdf

JOINTS, SAMPLES = (2, 3, 7), 10_000
_ERROR = "difference of the two, of the largest"


def pinocchio() -> Any:
    """The peer's module."""
    try:
        import pinocchio
    except ImportError:
        raise NotInstalledError("pinocchio (pip install pin)") from None
    return pinocchio


def one_step() -> Part:
    """Velocities one sample later, by an Euler step of the acrobot without friction."""
    pin, dataset = pinocchio(), acrobot()
    plant = plant_of(dataset)[0]
    states = states_of(dataset, STUDY.states, None)
    q, w = (np.concatenate([getattr(s, name) for s in states]) for name in "qw")
    # backward differences have no first sample
    u = np.concatenate([r.torque.value[1:] for r in dataset.recordings])
    model = _model(pin, mjcf({k: float(v) for k, v in plant.parameters.items()}))
    data, dt = model.createData(), 1 / RATE

    def ours() -> np.ndarray:
        M, h = plant.dynamics(q, w)
        return w + dt * solve(M, h + u * plant.mechanism.motors)

    def loop() -> np.ndarray:
        steps = zip(q, w, u * plant.mechanism.motors, strict=True)
        return np.array([v + dt * pin.aba(model, data, x, v, torque) for x, v, torque in steps])

    right = ours()

    own = Side("frictionid, all samples at once", lambda: _relative(ours(), right))
    peer = Side("Pinocchio's aba, sample by sample", lambda: _relative(loop(), right))
    return Part((Case(f"one-step physics, {len(q)} samples", own, peer, _ERROR, bar=15.0),), 8)


def _model(pin: Any, text: str) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "acrobot.xml"
        path.write_text(text)
        model = pin.buildModelFromMJCF(str(path))
    model.gravity.linear = np.array([0.0, -9.81, 0.0])  # it does not read that
    return model


def arms() -> Part:
    """M and h of serial arms of n joints."""
    pin = pinocchio()
    with tempfile.TemporaryDirectory() as folder:
        cases = [case for n in JOINTS for case in _arm_cases(pin, arm(Path(folder), n))]
    return Part(tuple(cases), 5)


def _arm_cases(pin: Any, mechanism: RigidBodyTree) -> list[Case]:
    model = pin.buildModelFromUrdf(str(mechanism.options["urdf"]))
    data, p, n = model.createData(), mechanism.base({}), mechanism.n
    q, w = np.random.default_rng(n).uniform(-2, 2, (2, SAMPLES, n))
    M, h = mechanism.dynamics(p, q, w)

    def off(inertia: np.ndarray, torque: np.ndarray) -> float:
        return max(_relative(inertia, M), _relative(torque, h))

    def loop() -> float:
        inertia, torque = np.empty_like(M), np.empty_like(h)
        for k in range(SAMPLES):
            inertia[k] = pin.crba(model, data, q[k])  # its upper triangle
            torque[k] = pin.nonLinearEffects(model, data, q[k], w[k])
        return off(np.triu(inertia) + np.swapaxes(np.triu(inertia, 1), 1, 2), -torque)

    own = Side("frictionid, compiled loops", lambda: off(*mechanism.dynamics(p, q, w)))
    name = f"M and h of an arm of {n} joints, {SAMPLES} samples"
    cases = [Case(name, own, Side("Pinocchio, sample by sample", loop), _ERROR)]
    if n == JOINTS[-1]:
        numpy = Side("NumPy, all samples at once", lambda: off(*over_samples(mechanism, q, w)))
        cases.append(Case(name, own, numpy, _ERROR))
    return cases


def _relative(found: np.ndarray, right: np.ndarray) -> float:
    return float(np.abs(found - right).max() / np.abs(right).max())


def arm(folder: Path, n: int) -> RigidBodyTree:
    """A serial arm of n revolute joints with random places and bodies."""
    rng = np.random.default_rng(n)

    def three(low: float, high: float) -> str:
        return " ".join(f"{x:.6f}" for x in rng.uniform(low, high, 3))

    lines = ['<robot name="arm"><link name="link_0"/>']
    for i in range(1, n + 1):
        lines.append(
            f'<link name="link_{i}"><inertial><origin xyz="{three(-0.1, 0.1)}"/><mass value="2"/>'
            '<inertia ixx="0.02" ixy="0.001" ixz="0.002" iyy="0.03" iyz="0.003" izz="0.025"/>'
            f'</inertial></link><joint name="joint_{i}" type="revolute">'
            f'<origin xyz="{three(-0.3, 0.3)}" rpy="{three(-1.5, 1.5)}"/>'
            f'<parent link="link_{i - 1}"/><child link="link_{i}"/><axis xyz="0 0 1"/>'
            '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>'
        )
    path = folder / f"arm_{n}.urdf"
    path.write_text("\n".join([*lines, "</robot>"]))
    return urdf(path)
