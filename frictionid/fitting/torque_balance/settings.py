"""Settings of inverse dynamics."""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.errors import InputError


@dataclass(frozen=True)
class TorqueSettings:
    """How torques are balanced and friction is fitted to them.

    window : [s], time over which torques are averaged; ripple that is faster does not count
    node_time : [s], shortest time between the samples along which friction and inertia are computed
    iterations : Gauss-Newton steps at most, in each round of weights
    huber : residuals beyond so many standard deviations count less
    significance : a block of sensors (delay, gain, bias) whose deviation from an ideal sensor has a
        larger p-value is left out, and the fit repeated without it; 1 keeps all
    consistent : whether base parameters must be those of bodies that there can be, of a URDF or
        MJCF, see `mechanics.rigid_body.consistent`
    """

    window: float = 0.05
    node_time: float = 0.004
    iterations: int = 60
    huber: float = 2.5
    significance: float = 0.01
    consistent: bool = False

    def __post_init__(self) -> None:
        for name in ("window", "node_time", "iterations", "huber", "significance"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} = {getattr(self, name)} must be positive")
