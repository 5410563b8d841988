"""Logs of a simulated servo: a pendulum under PD gains, targets late, the encoder behind a play.

Friction is set-valued: an impulse that stops the joint within a substep at most, after a symmetric
drift and kick. Nothing here is shared with the physics step or the servos that are fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.loops import compiled

_FINE = 1e-5  # [s], substeps


@dataclass(frozen=True)
class ServoPendulum:
    """A point mass on a massless arm, moved by u = P (q*(t - delay) - q + z) - D w.

    mass [kg], length [m], coulomb [N m], viscous [N m s/rad] of its friction, a share `load` of |u|
    beside them; delay [s] of the targets; backlash [rad], z its play; gap [rad], within which the
    joint moves without its friction, to the substep; limit [N m] of u; noise [rad]; rate [1/s] of
    the samples, and of the targets, which are held; warming [K] towards which it warms up from 15
    degC in a recording, with the time constant of a third of it; the level changes by `slope`
    [1/K], and viscous friction decays by `decay` [1/K], from what they are at 25 degC; held: the
    drive keeps u from a sample to the next, otherwise it follows the joint all the time
    """

    mass: float = 0.5
    length: float = 0.15
    coulomb: float = 0.03
    viscous: float = 0.02
    load: float = 0.0
    delay: float = 0.010
    backlash: float = 0.0
    gap: float = 0.0
    limit: float = float("inf")
    noise: float = 2e-4
    rate: float = 200.0
    warming: float = 0.0
    slope: float = 0.0
    decay: float = 0.0
    held: bool = False

    def log(self, P: float, D: float, seed: int, seconds: float = 8.0) -> dict[str, Array]:
        """A recording: time "t" [s], angle "q" [rad], "target" [rad] and torque "u" [N m], (T,).

        The target is a sum of four sines that the seed draws; the torque is its mean until the
        next sample, as of a drive that averages. Where it warms up, also "T" [degC].

        >>> log = ServoPendulum().log(4.0, 0.05, seed=1, seconds=1.0)
        >>> sorted(log), len(log["q"])
        (['q', 't', 'target', 'u'], 200)
        """
        rng = np.random.default_rng(seed)
        t = np.arange(round(seconds * self.rate)) / self.rate
        size, rate, phase = rng.uniform([[0.15], [0.3], [0.0]], [[0.4], [1.6], [2 * np.pi]], (3, 4))
        target = (size[:, None] * np.sin(2 * np.pi * rate[:, None] * t + phase[:, None])).sum(0)
        parts = round(1 / self.rate / _FINE)
        inertia, gravity = self.mass * self.length**2, self.mass * 9.81 * self.length
        numbers = (P, D, inertia, gravity, self.coulomb, self.viscous, self.load)
        every = parts if self.held else 1
        late = round(self.delay * self.rate * parts)
        rest = (self.backlash / 2, self.gap / 2, self.limit, 1 / self.rate / parts)
        middle = t + 0.5 / self.rate  # of each sample, whose friction is that at one temperature
        T, own = (15.0 + self.warming * (1.0 - np.exp(-3.0 * x / seconds)) for x in (t, middle))
        share = np.stack([1.0 + self.slope * (own - 25.0), np.exp(-self.decay * (own - 25.0))])
        q, u = _motion(target, (parts, late, every), np.array([*numbers, *rest]), share)
        log = {"t": t, "q": q + self.noise * rng.normal(size=len(t)), "target": target, "u": u}
        return log | ({"T": T} if self.warming else {})


@compiled
def _motion(
    target: Array, counts: tuple[int, int, int], numbers: Array, share: Array
) -> tuple[Array, Array]:
    """Angles and torques (T,) at the samples of a target (T,), from rest at its start.

    counts : substeps in a sample, those by which targets are late, those for which u is held
    share : (2, T) of the level and of viscous friction
    """
    parts, late, every = counts
    P, D, inertia, gravity, coulomb, viscous, load, half, reach, limit, h = numbers
    q, w, z, y, u = target[0], 0.0, 0.0, 0.0, 0.0
    angle, torque = np.empty(len(target)), np.empty(len(target))
    for k in range(len(target) * parts):
        aim = target[max(k - late, 0) // parts]
        if k % parts == 0:
            angle[k // parts] = q
            torque[k // parts] = 0.0
        q += h / 2 * w
        z = min(max(z + h / 2 * w, -half), half)
        y = min(max(y + h / 2 * w, -reach), reach)
        if k % every == 0:
            u = min(max(P * (aim - q + z) - D * w, -limit), limit)
        torque[k // parts] += u / parts
        free = w + h / inertia * (u - gravity * np.sin(q))
        rubs = (y >= reach and free > 0) or (y <= -reach and free < 0)
        level, drag = share[0, k // parts] * coulomb, share[1, k // parts] * viscous
        drag = drag if rubs else 0.0
        wanted = w + h / inertia * (u - gravity * np.sin(q) - drag * w)
        most = h / inertia * (level + load * abs(u)) if rubs else 0.0
        w = 0.0 if abs(wanted) <= most else wanted - np.sign(wanted) * most
        q += h / 2 * w
        z = min(max(z + h / 2 * w, -half), half)
        y = min(max(y + h / 2 * w, -reach), reach)
    return angle, torque
