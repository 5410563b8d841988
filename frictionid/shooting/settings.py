"""Settings of shooting."""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.errors import InputError


@dataclass(frozen=True)
class Settings:
    """How friction is refined by shooting.

    windows : lengths [s] of the windows, one stage after the other (5, 10 and 20 samples at 60 Hz)
    iterations : at most so many in the last stage; the others, which only lead there, have 4
    tolerance : a stage ends when no parameter moves by more than this share of its standard error
    huber : residuals beyond so many standard deviations count less
    fine : [s], substeps of pieces in which a joint comes near rest
    significance : a block of sensors (delay, gain, bias, offset) whose deviation from an ideal
        sensor has a larger p-value is left out, and the fit repeated without it; 1 keeps all
    start_velocity : [rad/s], how far a start velocity may be from its smoothed one where the
        angles do not tell it (a joint at rest); a standard deviation
    """

    windows: tuple[float, ...] = (5 / 60, 10 / 60, 20 / 60)
    iterations: int = 40
    tolerance: float = 0.05
    huber: float = 2.5
    fine: float = 0.0007
    start_velocity: float = 1.0
    significance: float = 0.01

    def __post_init__(self) -> None:
        if not self.windows or any(not w > 0 for w in self.windows):
            raise InputError(f"windows = {list(self.windows)} must be positive lengths in seconds")
        if list(self.windows) != sorted(self.windows):
            raise InputError(f"windows = {list(self.windows)} must grow: short ones converge first")
        for name in ("iterations", "tolerance", "huber", "fine", "start_velocity", "significance"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} = {getattr(self, name)} must be positive")
