"""What richer fits show, in words."""

import numpy as np
import pytest

from frictionid.friction.provenance import Estimate, Estimates
from frictionid.report.numbers import added, with_levels


def fitted(*names):
    """Friction parameters of one joint, all identified."""
    return Estimates(
        parameters=tuple(Estimate("friction", f"{n} of hip", "N m", 0, 0.5, 0.01) for n in names)
    )


PLAIN = fitted("coulomb", "viscous")
SIDES = [f"{name}_{side}" for name in ("coulomb", "peak") for side in ("positive", "negative")]


@pytest.mark.parametrize(
    "richer, shown",
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


@pytest.mark.parametrize("correlation, shown", [(-0.999, True), (0.0, False)])
def test_a_level_is_shown_where_only_the_sum_of_its_parts_is_identified(correlation, shown):
    parts = zip(("coulomb", "peak"), (0.3, 0.7), strict=True)
    read = tuple(
        Estimate("friction", f"{name} of hip", "N m", 0, value, 0.5, identified=False)
        for name, value in parts
    )
    covariance = 0.25 * np.array([[1.0, correlation], [correlation, 1.0]])
    _, _, *levels = with_levels(Estimates(parameters=read, covariance=covariance, freedom=20))
    assert [e.name for e in levels] == ["coulomb + peak of hip"] * shown
    assert all(e.value == 1.0 and e.high - 1.0 == pytest.approx(0.04665, rel=1e-3) for e in levels)
