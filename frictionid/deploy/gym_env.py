"""Environments of Gymnasium: a simulated mechanism, with a reward of one's own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.state import State
from frictionid.errors import InputError, needs

from .simulator import Simulator

with needs("gym"):
    import gymnasium

# reward of the positions and velocities that a torque has led to, (..., n) each: (...)
Reward = Callable[[Array, Array, Array], Any]


@dataclass(frozen=True)
class Episode:
    """What an episode is.

    Attributes
    ----------
    reward : function of q, w, u
        The positions and velocities that torques u have led to, (..., n) each, to numbers (...).
    torque_limit : float, or one for each motor [N m]
    steps : int
        After so many the episode is truncated.
    start : function of a generator to q and w (n,), optional
        Drawn at each reset; at rest at zero, if not given.
    terminated : function of q and w to truth (...), optional
    """

    reward: Reward
    torque_limit: float | Sequence[float]
    steps: int = 1000
    start: Callable[[np.random.Generator], tuple[Any, Any]] | None = None
    terminated: Callable[[Array, Array], Any] | None = None


class FrictionEnv(gymnasium.Env[Array, Array]):
    """One machine; an observation has the positions, then the velocities, (2 n,) in SI units.

    An action has the torque of each motor [N m]. An episode ends, too, where the motion diverges;
    its observation then is the last one that is finite.

    Raises
    ------
    InputError
        Where the simulator has batches, or a limit is impossible.

    Examples
    --------
    >>> from frictionid.friction import Friction
    >>> from frictionid.friction.laws import CoulombViscous
    >>> from frictionid.mechanics import pendulum
    >>> friction = Friction(CoulombViscous(), np.array([[0.05, 0.01]]))
    >>> simulator = Simulator(pendulum(mass=0.4, length=0.25), friction, dt=0.02)
    >>> env = FrictionEnv(simulator, Episode(lambda q, w, u: -np.cos(q[..., 0]), torque_limit=0.5))
    >>> observation, _ = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
    >>> observation.shape, terminated, truncated
    ((2,), False, False)
    """

    metadata = {"render_modes": []}

    def __init__(self, simulator: Simulator, episode: Episode) -> None:
        self.simulator, self.episode = simulator, episode
        self.observation_space, self.action_space = _spaces(simulator, episode)
        self._state, self._count = simulator.reset(), 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        super().reset(seed=seed, options=options)
        self._state = self.simulator.reset(*_start(self.episode, self.np_random))
        self._count = 0
        return _observed(self._state), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        self._state, reward, is_over = _after(self.simulator, self.episode, self._state, action)
        self._count += 1
        is_late = self._count >= self.episode.steps
        return _observed(self._state), float(reward), bool(is_over), is_late, {}


class FrictionVectorEnv(gymnasium.vector.VectorEnv[Array, Array, Array]):
    """Many machines side by side, each as `FrictionEnv`; an ended one is reset by the next step.

    Machines may differ: where the simulator's theta or parameters have a batch, it is that of the
    environments.

    Raises
    ------
    InputError
        Where the simulator's batch is another one.
    """

    metadata = {"autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}

    def __init__(self, simulator: Simulator, episode: Episode, count: int) -> None:
        self.simulator, self.episode, self.num_envs = simulator, episode, count
        spaces = _spaces(simulator, episode, count)
        self.single_observation_space, self.single_action_space = spaces
        batched = (gymnasium.vector.utils.batch_space(space, count) for space in spaces)
        self.observation_space, self.action_space = batched
        self._count, self._everyone = np.zeros(count, dtype=int), np.ones(count, dtype=bool)
        self._state = simulator.reset(np.zeros((count, simulator.n)))
        self._ended = self._fresh = self._everyone

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        super().reset(seed=None, options=options)
        each = range(self.num_envs)
        seeds = (
            seed if isinstance(seed, list) else [None if seed is None else seed + i for i in each]
        )
        if seed is not None or not hasattr(self, "_random"):
            self._random = [gymnasium.utils.seeding.np_random(x)[0] for x in seeds]
        self._state = self.simulator.reset(np.zeros((self.num_envs, self.simulator.n)))
        self._begin(self._everyone)
        return _observed(self._state), {}

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        new = self._ended
        self._state, reward, is_over = _after(
            self.simulator, self.episode, self._state, actions, self._fresh
        )
        self._fresh, self._count = ~self._everyone, self._count + 1
        if new.any():
            self._begin(new)
        is_over, is_late = is_over & ~new, (self._count >= self.episode.steps) & ~new
        self._ended = is_over | is_late
        return _observed(self._state), np.where(new, 0.0, reward), is_over, is_late, {}

    def _begin(self, which: Array) -> None:
        """New episodes of the machines which (count,) are chosen."""
        starts = [_start(self.episode, self._random[i]) for i in np.flatnonzero(which)]
        q, w = self._state.q.copy(), self._state.w.copy()
        for x, values in zip((q, w), zip(*starts, strict=True), strict=True):
            x[which] = [np.zeros(self.simulator.n) if v is None else v for v in values]
        self._state = self._state._replace(q=q, w=w)
        self._count = np.where(which, 0, self._count)
        self._fresh, self._ended = self._fresh | which, self._ended & ~which


def _spaces(simulator: Simulator, episode: Episode, count: int = 1) -> Any:
    """Spaces of observations and actions of one machine, both of float64."""
    theta, mechanism = simulator.friction.theta, simulator.plant.mechanism
    if not isinstance(theta, np.ndarray):
        raise InputError("environments are made of NumPy: give a friction whose theta is an array")
    batch = np.broadcast_shapes(theta.shape[:-2], simulator.plant.p.shape[:-1])
    if batch not in ((), (count,)):
        raise InputError(
            f"the simulator has a batch of shape {batch}, the environment one of {count}: pick a "
            "friction by friction[i], or give a FrictionVectorEnv of as many"
        )
    motors = int(mechanism.motors.sum())
    limit = np.asarray(episode.torque_limit, dtype=float)
    if limit.shape not in ((), (motors,)) or not (np.isfinite(limit) & (limit > 0)).all():
        raise InputError(
            f"torque_limit = {episode.torque_limit!r} must be a positive number of N m, or one for "
            f"each of {motors} motors"
        )
    ends = (np.full(2 * simulator.n, np.inf), np.broadcast_to(limit, motors).copy())
    return tuple(gymnasium.spaces.Box(-end, end, dtype=np.float64) for end in ends)


def _after(
    simulator: Simulator, episode: Episode, before: State, action: Array, fresh: Array | None = None
) -> tuple[State, Array, Array]:
    """State after an action, the last finite one of machines that diverge; rewards, and ends."""
    u = np.zeros((*np.shape(action)[:-1], simulator.n))
    u[..., simulator.plant.mechanism.motors > 0] = action  # of the joints with a motor
    state = simulator.step(before, u, fresh)
    is_over = np.asarray(np.isnan(state.q).any(axis=-1))
    if is_over.any():
        lost = is_over[..., None]
        pairs = zip(before.memory or state.memory, state.memory, strict=True)
        q, w = np.where(lost, before.q, state.q), np.where(lost, before.w, state.w)
        state = State(q, w, tuple(np.where(lost, *pair) for pair in pairs))
    if episode.terminated is not None:
        is_over = is_over | np.asarray(episode.terminated(state.q, state.w), dtype=bool)
    return state, np.asarray(episode.reward(state.q, state.w, u), dtype=float), is_over


def _start(episode: Episode, random: np.random.Generator) -> tuple[Any, Any]:
    return (None, None) if episode.start is None else episode.start(random)


def _observed(state: State) -> Array:
    return np.concatenate([state.q, state.w], axis=-1)
