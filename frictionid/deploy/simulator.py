"""Simulator of a mechanism with its friction: the physics step, for many machines side by side."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.dynamics.rollout import begin, diverged, freeze, masked, sampled
from frictionid.dynamics.state import Instant, State
from frictionid.dynamics.step import adaptive_step
from frictionid.dynamics.step_size import StepSize, step_size_of
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.mechanics import Mechanism, Plant, unit_inertia

from .compensation import check_step, friction_in, per_joint

_SAME = 1e-3  # of a time


@dataclass(frozen=True)
class Simulator:
    """Fixed steps of a mechanism with friction, by the physics step that predictions are made by.

    Batches are axes before the last: of states, of torques, of the friction's theta and of the
    parameters, which broadcast against each other. Where theta is a torch tensor, states and
    torques are tensors, too.

    Parameters
    ----------
    mechanism : Mechanism
    friction : Friction, theta (..., m, P), or Fit
        With a calibration its base parameters are the machine's; gains, delays and offsets are
        those of the sensors that recorded the data, and have no part here.
    dt : float
        Time of a step [s], during which torques are held.
    parameters : mapping of str to float or array (...), optional
        Physical parameters in place of the mechanism's own, SI.

    Raises
    ------
    InputError
        Where the friction has other joints than the mechanism, or parameters are impossible.

    Examples
    --------
    >>> from frictionid.friction.laws import CoulombViscous
    >>> from frictionid.mechanics import pendulum
    >>> friction = Friction(CoulombViscous(), np.array([[0.10, 0.01]]))
    >>> simulator = Simulator(pendulum(mass=0.4, length=0.25), friction, dt=0.01)
    >>> state = simulator.reset(q=[[1.0], [2.0]])                  # two machines
    >>> for _ in range(400):
    ...     state = simulator.step(state, [0.0])
    >>> state.w.ravel()                                            # both at rest, exactly
    array([0., 0.])
    """

    mechanism: Mechanism
    friction: Friction
    dt: float = 0.01
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "friction", friction_in(self.friction))
        check_step(self.dt, "Simulator")
        sample = self.friction.law.sample_time
        if sample is not None and abs(self.dt - sample) > _SAME * sample:
            raise InputError(
                f"Simulator: {self.friction.law} reads samples {sample:.6g} s apart; dt = "
                f"{self.dt:.6g} s must be that"
            )
        parts = len(self.mechanism.friction_names)
        if self.friction.n != parts:
            raise InputError(
                f"Simulator: the friction is that of {self.friction.n} joints, the "
                f"{self.mechanism.kind} has {parts}: give a model of the same mechanism"
            )
        self._size  # noqa: B018 (impossible parameters, and laws too steep, are refused here)

    @cached_property
    def plant(self) -> Plant:
        """The machine with its parameters."""
        friction, mechanism = self.friction, self.mechanism
        if friction.mechanism == "unit":
            mechanism = unit_inertia(mechanism.position_units)
        values = {**friction.parameters, **self.parameters}
        numbers = {k: v for k, v in values.items() if not hasattr(v, "shape")}
        values = {**mechanism.nominal(numbers), **values}
        plant = Plant.from_parameters(mechanism, values)
        calibration = friction.calibration
        p = plant.p
        if calibration is not None and calibration.base is not None:
            p = p + (calibration.base - mechanism.nominal_base)
        return replace(plant, p=self._array(p))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.plant.n

    def reset(self, q: Any = None, w: Any = None) -> State:
        """A state with positions q and velocities w (..., n), zero where they are not given.

        Memory of friction starts with the first step.
        """
        q, w = self._joints("q", q), self._joints("w", w)
        return State(*namespace(q).broadcast_arrays(q, w))

    def step(self, state: State, u: Any, fresh: Array | None = None) -> State:
        """State a time `dt` later under held torques u (..., n) [N m].

        Rows that diverge are NaN from then on. The memory of friction starts with this step in rows
        that are `fresh` (...), in all where the state has none.
        """
        xp, dt = namespace(state.q), self._array(np.array(self.dt))
        lost = xp.isnan(state.q).any(-1)
        state, _ = freeze(state, lost, None)
        # a memory of samples takes in the newest one with the torque that is held from it
        has_memory = bool(state.memory)
        now = Instant(self.plant, self.friction, state, self._joints("u", u))
        state = begin(now, dt)
        now = now._replace(state=state)
        alone = now._replace(state=State(state.q, state.w))
        new = begin(alone, dt) if fresh is not None else state
        state = sampled(now, dt[..., None]) if has_memory else state
        if fresh is not None:
            pairs = zip(new.memory, state.memory, strict=True)
            state = state._replace(memory=tuple(xp.where(fresh[..., None], *p) for p in pairs))
        with np.errstate(all="ignore"):  # a diverging motion overflows
            state = adaptive_step(now._replace(state=state), dt[..., None], self._size)
        alive = ~(diverged(self.plant, state) | lost)
        return State(masked(state.q, alive), masked(state.w, alive), state.memory)

    def run(self, state: State, u: Any) -> State:
        """Motion q, w (T + 1, ..., n) from a state under torques u (T, ..., n) [N m].

        >>> from frictionid.friction.laws import CoulombViscous
        >>> from frictionid.mechanics import linear_axis
        >>> friction = Friction(CoulombViscous(), np.array([[1.0, 0.0]]))
        >>> axis = Simulator(linear_axis(mass=2.0), friction, dt=0.01)
        >>> axis.run(axis.reset(), np.full((100, 1), 3.0)).w[-1].round(3)     # (3 N - 1 N) / 2 kg
        array([1.])
        """
        states = [state]
        for held in self._joints("u", u):
            states.append(self.step(states[-1], held))
        xp, shape = namespace(state.q), states[-1].q.shape
        q = xp.stack([xp.broadcast_to(each.q, shape) for each in states])
        return State(q, xp.stack([xp.broadcast_to(each.w, shape) for each in states]))

    @cached_property
    def _size(self) -> StepSize:
        return step_size_of(self.plant, self.friction, float(self.dt))

    def _array(self, x: Any) -> Array:
        """Numbers as an array of NumPy, or a tensor like the friction's theta."""
        theta = self.friction.theta
        if isinstance(theta, np.ndarray):
            return np.asarray(x, dtype=float)
        return namespace(theta).asarray(x, dtype=theta.dtype)

    def _joints(self, name: str, x: Any) -> Array:
        """An argument (..., n)."""
        x = np.zeros(self.n) if x is None else x
        return per_joint(x, self.n, self.friction.theta, f"Simulator: {name}")
