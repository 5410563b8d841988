"""Logs of a simulated axis whose gears have play: motor and load, each with an encoder.

Friction of both is set-valued: an impulse that stops them within a substep at most, after a
symmetric drift and kick. The gears press like a spring beyond the gap, and not at all within it.
Nothing here is shared with the mechanism or the physics step that are fitted.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.loops import compiled

_FINE = 1e-5  # [s], substeps
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
        q = _motion(u, parts, np.array([*astuple(self), 1 / rate / parts]))
        q = q + noise * rng.normal(size=q.shape)
        return {"t": t, "q1": q[:, 0], "q2": q[:, 1], "u1": u, "u2": 0.0 * u}


@compiled
def _motion(u: Array, parts: int, numbers: Array) -> Array:
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
        w1 = 0.0 if abs(wanted1) <= most1 else wanted1 - np.sign(wanted1) * most1
        w2 = 0.0 if abs(wanted2) <= most2 else wanted2 - np.sign(wanted2) * most2
        q1, q2 = q1 + h / 2 * w1, q2 + h / 2 * w2
    return out
