"""Logs of simulated drives: a servo's pendulum under PD gains, and an axis whose gears have play.

Friction is set-valued: an impulse that stops a joint within a substep at most, after a symmetric
drift and kick. Nothing here is shared with the mechanism, the physics step or the servos that are
fitted.
"""

from dataclasses import astuple, dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.machine_code import compiled, inlined

_FINE = 1e-5  # [s], substeps


@inlined
def _slowed(w: float, most: float) -> float:
    """Velocity after an impulse of friction that takes off at most this much: zero, or less."""
    return 0.0 if abs(w) <= most else w - np.sign(w) * most


@dataclass(frozen=True)
class ServoPendulum:
    """A point mass on a massless arm, moved by u = P (q*(t - delay) - q + z) - D w.

    mass [kg], length [m], coulomb [N m], viscous [N m s/rad] of its friction, a share `load` of |u|
    beside them; delay [s] of the targets; backlash [rad], z its play; gap [rad], within which the
    joint moves without its friction, to the substep; limit [N m] of u; noise [rad]; rate [1/s] of
    the samples, and of the targets, which are held; warming [K] towards which it warms up from 15
    degC in a recording, with the time constant of a third of it; the level changes by `slope`
    [1/K], and viscous friction decays by `decay` [1/K], from what they are at 25 degC; held: the
    drive keeps u from a sample to the next, otherwise it follows the joint all the time; peak
    [N m], knee and no_load [rad/s] of the motor's torque over its speed; waves, (k, amplitude
    [N m], phase) each, of a cogging torque: amplitude cos(k q + phase) is added to the friction
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
    peak: float = float("inf")
    knee: float = 0.0
    no_load: float = float("inf")
    waves: tuple[tuple[float, float, float], ...] = ()

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
        T, warm = (15.0 + self.warming * (1.0 - np.exp(-3.0 * x / seconds)) for x in (t, middle))
        share = np.stack([1.0 + self.slope * (warm - 25.0), np.exp(-self.decay * (warm - 25.0))])
        slope = self.peak / (self.no_load - self.knee) if np.isfinite(self.peak) else 0.0
        stall = slope * self.no_load if slope else np.inf
        motor = (self.peak, stall, slope)
        settings = np.array([*numbers, *rest, *motor]), np.reshape(self.waves, (-1, 3))
        q, u = _servo_motion(target, (parts, late, every), *settings, share)
        log = {"t": t, "q": q + self.noise * rng.normal(size=len(t)), "target": target, "u": u}
        return log | ({"T": T} if self.warming else {})


@compiled
def _servo_motion(
    target: Array, counts: tuple[int, int, int], numbers: Array, waves: Array, share: Array
) -> tuple[Array, Array]:
    """Angles and torques (T,) at the samples of a target (T,), from rest at its start.

    counts : substeps in a sample, those by which targets are late, those for which u is held
    waves : (H, 3) of the cogging torque
    share : (2, T) of the level and of viscous friction
    """
    parts, late, every = counts
    P, D, inertia, gravity, coulomb, viscous, load, half, reach, limit, h = numbers[:-3]
    peak, stall, slope = numbers[-3:]
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
            u = min(max(u, -stall - slope * w), stall - slope * w)
            u = min(max(u, -peak), peak)
        torque[k // parts] += u / parts
        pull = u - gravity * np.sin(q)
        for i in range(len(waves)):
            pull -= waves[i, 1] * np.cos(waves[i, 0] * q + waves[i, 2])
        free = w + h / inertia * pull
        rubs = (y >= reach and free > 0) or (y <= -reach and free < 0)
        level, drag = share[0, k // parts] * coulomb, share[1, k // parts] * viscous
        drag = drag if rubs else 0.0
        wanted = w + h / inertia * (pull - drag * w)
        most = h / inertia * (level + load * abs(u)) if rubs else 0.0
        w = _slowed(wanted, most)
        q += h / 2 * w
        z = min(max(z + h / 2 * w, -half), half)
        y = min(max(y + h / 2 * w, -reach), reach)
    return angle, torque


_SIZES = np.array([1.0, 0.8, 0.6])  # of the sines of the torque
_RATES = np.array([[0.5, 1.5, 3.0], [1.5, 3.0, 6.0]])  # [1/s], between which they are drawn


@dataclass(frozen=True)
class LooseAxis:
    """Motor q1, as seen at the load, and load q2; the gears press beyond a `gap` [rad].

    inertias [kg m^2], Coulomb [N m] and viscous [N m s/rad] friction of motor and load; stiffness
    [N m/rad] of the gears
    """

    motor_inertia: float = 0.01
    load_inertia: float = 0.04
    stiffness: float = 150.0
    gap: float = 0.02
    motor_coulomb: float = 0.06
    motor_viscous: float = 0.01
    load_coulomb: float = 0.03
    load_viscous: float = 0.02

    def log(
        self, seed: int, seconds: float = 6.0, rate: float = 400.0, noise: float = 1e-4
    ) -> dict[str, Array]:
        """A recording: time "t" [s], angles "q1", "q2" [rad], torques "u1", "u2" [N m], (T,).

        The motor's torque is a sum of three sines that the seed draws, held between samples; noise
        [rad] is that of the angles.

        >>> sorted(LooseAxis().log(seed=1, seconds=0.5))
        ['q1', 'q2', 't', 'u1', 'u2']
        """
        rng = np.random.default_rng(seed)
        t = np.arange(round(seconds * rate)) / rate
        rates, phases = rng.uniform(*_RATES), rng.uniform(0.0, 2 * np.pi, 3)
        u = 0.35 * _SIZES @ np.sin(2 * np.pi * rates[:, None] * t + phases[:, None])
        parts = round(1 / rate / _FINE)
        q = _axis_motion(u, parts, np.array([*astuple(self), 1 / rate / parts]))
        q = q + noise * rng.normal(size=q.shape)
        return {"t": t, "q1": q[:, 0], "q2": q[:, 1], "u1": u, "u2": 0.0 * u}


@compiled
def _axis_motion(u: Array, parts: int, numbers: Array) -> Array:
    """Angles (T, 2) at the samples of the motor's torque (T,), from rest amid the gap."""
    J1, J2, stiffness, gap, coulomb1, viscous1, coulomb2, viscous2, h = numbers
    q1, q2, w1, w2 = 0.0, 0.0, 0.0, 0.0
    out = np.empty((len(u), 2))
    for i in range(len(u) * parts):
        if i % parts == 0:
            out[i // parts] = q1, q2
        q1, q2 = q1 + h / 2 * w1, q2 + h / 2 * w2
        twist = q1 - q2
        press = stiffness * (twist - min(max(twist, -gap / 2), gap / 2))
        wanted1 = w1 + h / J1 * (u[i // parts] - press - viscous1 * w1)
        wanted2 = w2 + h / J2 * (press - viscous2 * w2)
        most1, most2 = h / J1 * coulomb1, h / J2 * coulomb2
        w1, w2 = _slowed(wanted1, most1), _slowed(wanted2, most2)
        q1, q2 = q1 + h / 2 * w1, q2 + h / 2 * w2
    return out
