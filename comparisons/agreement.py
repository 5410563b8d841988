"""Whether `quick`, `compare` and `fit` ever give two answers on the same recordings.

    python comparisons/agreement.py [--sets 100] [--seed 0]

Sets of twelve recordings of a pendulum: Coulomb and viscous friction, a Stribeck peak or friction
that grows with the load beside it, in turn. `compare` has the laws of `quick`, both by shooting.
They disagree where they name different laws, or where the fit of that law finds a parameter outside
the interval that `quick` printed.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace

import numpy as np
from verdict_rate import TRUTHS

import frictionid as fid
from frictionid.comparison.suite import identifier_named
from frictionid.data.recordings import Dataset
from frictionid.quickstart.plan import plan_for

RECORDINGS = 12
KINDS = [replace(TRUTHS[name], recordings=RECORDINGS) for name in ("no peak", "wide peak")]
KINDS.append(replace(TRUTHS["no peak, load"], recordings=RECORDINGS))


def answers(data: Dataset) -> tuple[str, str, bool]:
    """The law of `quick`, that of `compare`, and whether `fit` finds the numbers of `quick`."""
    first, plan = fid.quick(data), plan_for(data)
    laws = {law.label: identifier_named(law.kind, law.table) for law in plan.laws}
    second = fid.compare(data, laws, plan.folds, "shooting", horizons=plan.horizons[:1]).verdict
    assert first.chosen is not None and first.refined is not None
    fitted = fid.fit(data, laws[first.chosen.name], method="shooting").frame
    said = np.array([e.interval_95 for e in first.refined.parameters if not e.held])
    within = (said[:, 0] <= fitted.value) & (fitted.value <= said[:, 1])
    return first.chosen.name, str(second.provisional), bool(within.all())


def main() -> None:
    """Print how often which answers are given, and each set with two."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sets", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    counted: Counter[tuple[str, str, bool]] = Counter()
    for k in range(asked.sets):
        (data,) = KINDS[k % len(KINDS)].sets(asked.seed + k, 1)
        counted[answers(data)] += 1
        print(k, dict(counted), flush=True)


if __name__ == "__main__":
    main()
