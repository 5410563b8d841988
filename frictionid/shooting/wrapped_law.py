"""A law around another, with the other's declared attributes."""

from __future__ import annotations

from dataclasses import dataclass, field

from frictionid.friction import Law


@dataclass(frozen=True, eq=False, repr=False)
class WrappedLaw(Law):
    """A law around another, with the other's smoothing at rest, of `width` and `shape`."""

    law: Law
    width: float = field()  # without the default of `Law`
    shape: str = field()

    def __post_init__(self) -> None:
        """The other law has checked its smoothing."""

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
    def sample_time(self) -> float | None:  # type: ignore[override]
        return self.law.sample_time

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        return self.law.uses_load

    @property
    def reads_window(self) -> bool:  # type: ignore[override]
        return self.law.reads_window

    @property
    def inner(self) -> Law:
        """The other law, with the smoothing that is asked for."""
        same = self.width == self.law.width
        return self.law if same else self.law.with_width(self.width)
