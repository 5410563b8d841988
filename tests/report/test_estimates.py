"""What richer fits show, in words."""

import pytest

from frictionid.friction.provenance import Estimate, Estimates
from frictionid.report.numbers import added


def fitted(*names):
    """Friction parameters of one joint, all identified."""
    return Estimates(
        parameters=tuple(Estimate("friction", f"{n} of hip", "N m", 0, 0.5, 0.01) for n in names)
    )


PLAIN = fitted("coulomb", "viscous")
SIDES = [f"{name}_{side}" for name in ("coulomb", "peak") for side in ("positive", "negative")]


@pytest.mark.parametrize(
    ("richer", "shown"),
    [
        (fitted("coulomb", "peak", "viscous"), ["peak of hip"]),
        (fitted(*SIDES, "viscous"), ["peak_positive of hip", "peak_negative of hip"]),
        (fitted("coulomb_positive", "coulomb_negative", "viscous"), []),
        (fitted("level", "peak"), []),
    ],
    ids=["of both directions", "by direction", "nothing more", "another law"],
)
def test_a_parameter_by_direction_counts_as_that_of_both(richer, shown):
    said = added(PLAIN, {"stribeck": richer})
    assert bool(said) == bool(shown)
    assert all(f"{name} 0.5" in said for name in shown)
