"""Predictions from many starts, beside MuJoCo's `rollout` on one thread.

The acrobot with Coulomb and viscous friction, which MuJoCo's joints have; four steps a sample. Our
physics step sticks and slips exactly, MuJoCo's dry friction is a soft constraint: that shows in
their errors, against steps eight times as fine of ours. The semi-implicit step of both, MuJoCo's
"Euler", has no such means.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from acrobot_mjcf import mjcf
from case import Case, NotInstalledError, Part, Side
from samples import RATE, acrobot

from frictionid.data.plants import plant_of
from frictionid.dynamics.compiled.loops import programs_of, row_of
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.dynamics.step_size import StepSize
from frictionid.evaluation import Protocol, prepare
from frictionid.friction import Friction
from frictionid.friction.laws import MLP, CoulombViscous

THETA = np.array([[0.165, 0.004], [0.055, 0.0008]])
STEPS = 4  # of a sample
COPIES = 10  # of each start, where there are many
ARITHMETIC = "add subtract multiply divide sqrt exp log tanh sin cos".split()
SIZE = 1500  # rows and columns of a matrix product, which comes near a processor's peak
ERROR = "median after 1 s, without camera noise [rad]"


def mujoco_rollout() -> Any:
    """The peer's module."""
    try:
        import mujoco
        import mujoco.rollout
    except ImportError:
        raise NotInstalledError("mujoco (pip install mujoco)") from None
    return mujoco


class Motions(NamedTuple):
    """Predictions to make: start states (S, 2), torques (T, S, 2) of the samples, and the plant."""

    plant: Any
    q: np.ndarray
    w: np.ndarray
    u: np.ndarray

    def times(self, count: int) -> Motions:
        """Each of them so many times."""
        q, w = (np.tile(x, (count, 1)) for x in (self.q, self.w))
        return Motions(self.plant, q, w, np.tile(self.u, (1, count, 1)))

    def predicted(self, friction: Friction, *, refine: int = 1) -> np.ndarray:
        """Angles at the end (S, 2), by the physics step."""
        dt = np.full(self.u.shape[:2], 1 / RATE)
        start = State(self.q, self.w)
        return rollout(self.plant, friction, start, self.u, dt, refine=refine).q[-1]

    def semi_implicit(self, friction: Friction) -> np.ndarray:
        """Angles at the end (S, 2), by semi-implicit steps."""
        u = np.repeat(self.u, STEPS, axis=0)
        dt = np.full(u.shape[:2], 1 / RATE / STEPS)
        start = State(self.q, self.w)
        return rollout(self.plant, friction, start, u, dt, method="semi_implicit").q[-1]


def motions() -> Motions:
    """A start in each quarter of a second of the recordings, and the torques of 1 s after it."""
    dataset = acrobot()
    starts = prepare(dataset, Protocol(horizons=(1.0,))).initial_states
    return Motions(plant_of(dataset)[0], starts.q, starts.w, starts.u)


def in_mujoco(mujoco: Any, motions: Motions, integrator: str) -> Callable[[], np.ndarray]:
    """Function that predicts angles at the end (S, 2) by MuJoCo."""
    spec = mujoco.MjSpec.from_string(
        mjcf({k: float(v) for k, v in motions.plant.parameters.items()})
    )
    for (coulomb, viscous), name in zip(THETA, ("joint1", "joint2"), strict=True):
        spec.joint(name).frictionloss = coulomb
        spec.joint(name).damping[0] = viscous
    spec.option.timestep = 1 / RATE / STEPS
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    model = spec.compile()
    data = mujoco.MjData(model)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.zeros((len(motions.q), size))  # time, then angles and velocities
    start[:, 1:3], start[:, 3:5] = motions.q, motions.w
    torque = np.repeat(np.swapaxes(motions.u, 0, 1)[..., 1:], STEPS, axis=1)
    return lambda: mujoco.rollout.rollout(model, data, start, torque)[0][:, -1, 1:3]


def smooth() -> Part:
    """Semi-implicit steps, with a parametric law and with a network."""
    mujoco, few = mujoco_rollout(), motions()
    many, friction, off = few.times(COPIES), _parametric(), error_of(few)
    network = Friction(MLP(), np.stack([MLP().initial[0]] * 2))
    euler = in_mujoco(mujoco, few, "EULER")
    theirs = Side("MuJoCo's rollout, Euler", lambda: off(euler()), share=1 / COPIES)
    how, count = "frictionid, semi-implicit, NumPy", len(many.q)
    law = Side(how, lambda: off(many.semi_implicit(friction)))
    net = Side(f"{how}, with an MLP", lambda: _without_error(many.semi_implicit(network)))
    return Part(
        (
            Case(f"rollout, {count} starts", law, theirs, ERROR, bar=15.0),
            Case(f"rollout, {count} starts, MLP", net, theirs, ERROR, bar=3.0),
        ),
        6,
    )


def with_stiction() -> Part:
    """The physics step, for many starts and for those of the default comparison."""
    mujoco, few = mujoco_rollout(), motions()
    friction, off, rk4 = _parametric(), error_of(few), in_mujoco(mujoco, few, "RK4")
    cases = []
    for copies in (COPIES, 1):
        some = few.times(copies)
        own = Side("frictionid", lambda some=some: off(some.predicted(friction)))
        peer = Side("MuJoCo's rollout, RK4", lambda: off(rk4()), share=1 / copies)
        cases.append(Case(f"rollout with stiction, {len(some.q)} starts", own, peer, ERROR, 15.0))
    return Part(tuple(cases), 3)


def peak_share() -> Part:
    """The ratio is the share of the processor's floating-point peak that the physics step reaches.

    Four substeps a sample, those near rest no shorter; an operation of `ARITHMETIC` counts as one.
    """
    many, friction, matrix = motions().times(COPIES), _parametric(), np.ones((SIZE, SIZE))
    row = row_of(many.plant, friction)
    programs = programs_of(row)
    counts = {
        name: sum(line.operation in ARITHMETIC for line in program.lines)
        for name, program in programs.items()
    }
    parts = [part for name in ("first", "smooth") for part in row.sequences[name]]
    operations = sum(counts[part] for part in parts) * STEPS * many.u[..., 0].size
    dt, start = np.full(many.u.shape[:2], 1 / RATE), State(many.q, many.w)

    def ours() -> float:
        step = StepSize(STEPS, 1)
        return _without_error(rollout(many.plant, friction, start, many.u, dt, step_size=step).q)

    own = Side("frictionid", ours)
    share = 2 * SIZE**3 / operations
    peer = Side(
        "matrix product, as many operations", lambda: float((matrix @ matrix)[0, 0]), share=share
    )
    return Part(
        (Case(f"physics step, {operations:.3g} operations", own, peer, bar=0.2, drawn=False),), 6
    )


def _parametric() -> Friction:
    return Friction(CoulombViscous(), THETA)


def error_of(motions: Motions) -> Callable[[np.ndarray], float]:
    """Function that gives the median error [rad] of angles at the end (S, 2)."""
    right = motions.predicted(_parametric(), refine=8)
    return lambda q: float(np.median(np.linalg.norm(q[: len(right)] - right, axis=1)))


def _without_error(motion: np.ndarray) -> float:
    """There is no true network to compare with."""
    assert np.isfinite(motion).all()
    return float("nan")
