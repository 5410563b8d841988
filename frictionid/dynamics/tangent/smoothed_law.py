"""A law around another whose smoothing at rest can be chosen."""

from __future__ import annotations

from dataclasses import dataclass, field

from frictionid.friction import Law
from frictionid.friction.law import WrappedLaw


@dataclass(frozen=True, eq=False, repr=False)
class SmoothedLaw(WrappedLaw):
    """A law around another, with the other's smoothing at rest, of `width` and `shape`."""

    width: float = field()  # without the default of `Law`
    shape: str = field()

    def __post_init__(self) -> None:
        """The other law has checked its smoothing."""

    def __repr__(self) -> str:
        return repr(self.law)

    @property
    def inner(self) -> Law:
        """The other law, with the smoothing that is asked for."""
        same = self.width == self.law.width
        return self.law if same else self.law.with_width(self.width)
