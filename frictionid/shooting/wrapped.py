"""A law around another: what it tells of itself is the other's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from frictionid.dynamics.stiction import SLOW

_WIDTHS = 5.0  # of a law's smoothing: what the step takes the width of laws for that have none


@dataclass(frozen=True, eq=False, repr=False)
class Wrapped:
    """A law around another, with the other's smoothing at rest, of `width` and `shape`."""

    law: Any
    width: float
    shape: str

    def __repr__(self) -> str:
        return repr(self.law)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.law.names)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(self.law.units)

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return tuple(self.law.bounds)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple(self.law.initial)

    @property
    def sample_time(self) -> float | None:
        sampled: float | None = self.law.sample_time
        return sampled

    @property
    def uses_load(self) -> bool:
        return bool(self.law.uses_load)

    @property
    def window(self) -> bool:
        """Whether the other's memory holds samples of the motion, whatever its numbers are."""
        return bool(getattr(self.law, "window", False))

    @property
    def inner(self) -> Any:
        """The other law, with the smoothing that is asked for."""
        same = not self.shape or self.width == self.law.width
        return self.law if same else replace(self.law, width=self.width)


def smoothing_of(law: Any) -> tuple[float, str]:
    """Width and shape of a law's smoothing; no shape where it cannot be changed."""
    if hasattr(law, "width") and hasattr(law, "shape"):
        return float(law.width), str(law.shape)
    return float(getattr(law, "width", SLOW / _WIDTHS)), ""
