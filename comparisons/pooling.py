"""How often the intervals of pooled models hold what they are to hold.

    python comparisons/pooling.py            # the table of docs/pooling.md, a minute

Meta-analyses of specimens drawn from a normal distribution, with estimates whose standard errors
differ by a factor of three between specimens: does the interval of the mean hold the mean, and the
range the next specimen?
"""

from __future__ import annotations

import numpy as np

from frictionid.pooling.random_effects import random_effects

COUNT, SEED = 1000, 0
SPECIMENS, SPREADS = (2, 3, 5, 10), (0.0, 0.5, 1.0, 3.0)


def covered(specimens: int, tau: float, count: int, seed: int) -> tuple[float, float]:
    """How often interval of the mean and range hold it; tau is in units of the mean error."""
    rng = np.random.default_rng([seed, specimens, round(10 * tau)])
    held = np.zeros((count, 2))
    for row in held:
        errors = rng.uniform(0.5, 1.5, specimens)
        values = tau * rng.standard_normal(specimens) + errors * rng.standard_normal(specimens)
        found = random_effects(values, errors)
        (low, high), (least, most) = found.interval(), found.range()
        row[:] = low <= 0.0 <= high, least <= tau * rng.standard_normal() <= most
    interval, range_ = held.mean(axis=0)
    return float(interval), float(range_)


def main() -> None:
    """Print the table."""
    print("| specimens | tau over the errors | interval of the mean | range of another |")
    print("| --- | --- | --- | --- |")
    for specimens in SPECIMENS:
        for tau in SPREADS:
            both = covered(specimens, tau, COUNT, SEED)
            print(
                f"| {specimens} | {tau:g} | " + " | ".join(f"{100 * v:.1f} %" for v in both) + " |"
            )


if __name__ == "__main__":
    main()
