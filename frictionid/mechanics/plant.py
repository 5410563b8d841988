"""A mechanism with its parameters, and the momentum balance along its motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array, like, namespace

from .mechanism import Mechanism, Terms

SLOW = 0.1  # [rad/s]: slower joints may come to rest


@dataclass(frozen=True)
class Plant:
    """A mechanism with physical parameters and the base parameters p that follow from them.

    `parameters` are arrays of one batch shape (...), often one entry per recording or row; p has
    shape (..., nb). An index into a plant picks from the batch. `slow` has a speed of each joint
    [rad/s or m/s], below which it may come to rest: 0.1 where no motion says better. `temperature`
    (..., n) [degC] is that of the joints, for friction that depends on it. `feedback` (..., 2, n)
    is what a controller takes off the motor torque: u - K q - B w with stiffness K [N m/rad] and
    damping B [N m s/rad].

    >>> import numpy as np
    >>> from frictionid.mechanics import pendulum
    >>> Plant.from_parameters(pendulum(), {"mass": np.array([0.5, 1.0])})[1].p
    array([1.  , 9.81])
    """

    mechanism: Mechanism
    parameters: Mapping[str, Array]
    p: Array
    slow: tuple[float, ...] = ()
    temperature: Array | None = None
    feedback: Array | None = None

    def __post_init__(self) -> None:
        if not self.slow:
            object.__setattr__(self, "slow", (SLOW,) * self.mechanism.n)

    @staticmethod
    def from_parameters(mechanism: Mechanism, parameters: Mapping[str, Any]) -> "Plant":
        """Plant of physical parameters, missing ones at their defaults; SI units."""
        values = {**mechanism.defaults, **parameters}
        xp = namespace(*values.values())
        # not asarray on tensors, which would cut off their gradient
        arrays = xp.broadcast_arrays(
            *(
                v if hasattr(v, "detach") else xp.asarray(v, dtype=xp.float64)
                for v in values.values()
            )
        )
        full = dict(zip(values, arrays, strict=True))
        return Plant(mechanism, full, mechanism.base(full))

    def __getitem__(self, index: Any) -> "Plant":
        physical = {k: v[index] for k, v in self.parameters.items()}
        warm = None if self.temperature is None else self.temperature[index]
        loop = None if self.feedback is None else self.feedback[index]
        return Plant(self.mechanism, physical, self.p[index], self.slow, warm, loop)

    def on_base(self, motion: Array | None) -> "Plant":
        """The plant on a base that moves so (..., 9), see `with_base_motion`; None: at rest."""
        if motion is None:
            return self
        still = self.p[..., : len(self.mechanism.base_names)]
        return replace(self, p=with_base_motion(still, motion))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.mechanism.n

    @property
    def parts(self) -> int:
        """Number of parts with friction: joints, and those that turn with several of them."""
        return len(self.mechanism.friction_names)

    def slow_like(self, w: Array) -> Array:
        """`slow` as an array like velocities w (..., n) of the joints, or (..., m) of all parts."""
        slow = np.array(self.slow)
        if w.shape[-1] > self.n:  # a part is slow where all joints that turn it are
            slow = np.abs(self.mechanism.friction_map) @ slow
        return like(slow, w)

    def terms(self, q: Array, w: Array) -> Terms:
        """Terms of the equations of motion, see `Terms`."""
        return self.mechanism.terms(self.p, q, w)

    def dynamics(self, q: Array, w: Array) -> tuple[Array, Array]:
        """M (..., n, n) and h (..., n)."""
        return self.mechanism.dynamics(self.p, q, w)

    def load(self, q: Array, w: Array, u: Array) -> Array:
        """Bearing force, or torque of a gear, in friction-free motion, shape (..., n) [N, N m]."""
        base = (self.p,) if self.mechanism.loads_of_gears else ()
        return self.mechanism.load(self.parameters, q, w, u, *base)


def base_by_rotors(mechanism: Mechanism, parameters: Mapping[str, float]) -> dict[str, Array]:
    """Change (nb,) of the base parameters by 1 kg m^2 more of each rotor, in which they are linear.

    >>> from frictionid.mechanics import pendulum
    >>> base_by_rotors(pendulum(), {"rotor": 0.0, "gear": 10.0})
    {'rotor': array([100.,   0.])}
    """
    base = mechanism.base(parameters)
    names = [p.name for p in mechanism.parameters if p.rotor]
    return {n: mechanism.base({**parameters, n: parameters[n] + 1.0}) - base for n in names}


# Weights of start, midpoint and end of an interval.
SIMPSON = (1 / 6, 4 / 6, 1 / 6)


def with_midpoints(time: Array, q: Array, w: Array) -> tuple[Array, Array, Array]:
    """Time (2K + 1,), q and w (2K + 1, n) of K + 1 samples with the midpoints between them.

    q_mid = (q0 + q1)/2 + (w0 - w1) dt/8,    w_mid = 1.5 (q1 - q0)/dt - (w0 + w1)/4

    >>> t = np.array([0.0, 2.0])
    >>> [x.ravel().tolist() for x in with_midpoints(t, t[:, None] ** 3, 3 * t[:, None] ** 2)]
    [[0.0, 1.0, 2.0], [0.0, 1.0, 8.0], [0.0, 3.0, 12.0]]
    """
    dt = np.diff(time)
    middle = (time[:-1] + dt / 2, *midpoints(q, w, dt))
    t, q, w = (interleaved(*pair) for pair in zip((time, q, w), middle, strict=True))
    return t, q, w


def midpoints(q: Array, w: Array, dt: Array) -> tuple[Array, Array]:
    """Q and w (..., K, n) midway between K + 1 samples, as in `with_midpoints`."""
    h, first, second = dt[:, None], np.s_[..., :-1, :], np.s_[..., 1:, :]
    middle_q = (q[second] + q[first]) / 2 + (w[first] - w[second]) * h / 8
    return middle_q, 1.5 * (q[second] - q[first]) / h - (w[second] + w[first]) / 4


def interleaved(samples: Array, middle: Array) -> Array:
    """Values at K + 1 samples and K midpoints as one series (2K + 1, ...)."""
    out = np.empty((len(samples) + len(middle), *samples.shape[1:]))
    out[::2], out[1::2] = samples, middle
    return out


def interval_stencil(samples: int) -> Array:
    """Indices (K, 3) of start, midpoint and end of the intervals between K + 1 samples.

    >>> interval_stencil(3)
    array([[0, 1, 2],
           [2, 3, 4]])
    """
    return 2 * np.arange(samples - 1)[:, None] + np.arange(3)


def interval_mean(
    values: Array, stencil: Array, weights: Sequence[float] | Array = SIMPSON
) -> Array:
    """Means (..., K, n) over intervals, sum_m weights[m] values[..., stencil[:, m], :]."""
    first, *others = (
        c * values.take(index, axis=-2) for c, index in zip(weights, stencil.T, strict=True)
    )
    mean: Any = first
    for part in others:
        mean += part
    return mean


def momentum_balance(terms: Terms, stencil: Array) -> tuple[Array, Array, Array]:
    """Balance over K intervals of the terms along the nodes, without input and friction.

    Its start and end M0 w0 and M1 w1 [N m s], and its force, the mean of dL/dq [N m]; (..., K, n).

    Parameters
    ----------
    terms : Terms at S nodes, samples and midpoints; batch axes may stand before them
    stencil : array, shape (K, 3), nodes of each interval, see `interval_stencil`
    """
    start, middle, end = stencil.T
    f = terms.dLdq
    force = (f[..., start, :] + 4 * f[..., middle, :] + f[..., end, :]) / 6
    return terms.momentum[..., start, :], terms.momentum[..., end, :], force


def with_base_motion(p: Array, motion: Array | None) -> Array:
    """Base parameters (..., nb) with the motion (..., 9) of a base behind them, (..., nb + 9).

    In the frame of the base: its angular velocity [rad/s], its angular acceleration [rad/s^2], and
    the proper acceleration of its origin [m/s^2], which is what an accelerometer shows: that less
    gravity. Position, orientation and velocity do not matter. Without it the base is at rest.
    """
    return p if motion is None else side_by_side(p, motion)


def side_by_side(*arrays: Array) -> Array:
    """Numbers (..., k) of arrays whose batch axes broadcast, those of one behind the other's."""
    lead = np.broadcast_shapes(*(x.shape[:-1] for x in arrays))
    return np.concatenate([np.broadcast_to(x, (*lead, x.shape[-1])) for x in arrays], axis=-1)


def base_motion_of(p: Array, count: int) -> Array | None:
    """Motion (..., 9) behind so many base parameters, or None."""
    return p[..., count:] if p.shape[-1] > count else None
