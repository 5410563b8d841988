"""Whether `quick`, `compare` and `fit` ever give two answers on the same recordings.

    python comparisons/agreement.py [--sets 100] [--seed 0]

Sets of twelve recordings of a pendulum: Coulomb and viscous friction, a Stribeck peak or friction
that grows with the load beside it, in turn. `compare` has the laws of `quick`, both by shooting.
They disagree where they name different laws, or where the fit of that law identifies other
parameters, or finds one outside the interval that `quick` printed.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from script import call
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
    offered = (*plan.laws, *plan.further)
    laws = {law.label: identifier_named(law.kind, law.table) for law in offered}
    second = fid.compare(data, laws, plan.folds, "shooting", horizons=plan.horizons[:1]).verdict
    assert first.chosen is not None and first.refined is not None
    said = {
        (e.parameter, "" if e.joint is None else f"joint {e.joint + 1}"): e.interval_95
        for e in first.refined.parameters
        if e.identified
    }
    rows = fid.fit(data, laws[first.chosen.name], method="shooting").frame.itertuples()
    values = {(row.parameter, row.joint): row.value for row in rows if row.identified}
    same = said.keys() == values.keys()
    within = same and all(low <= values[key] <= high for key, (low, high) in said.items())
    return first.chosen.name, second.provisional or "none", within


def main(*, sets: int = 100, seed: int = 0) -> None:
    """Print how often which answers are given, and each set with two."""
    counted: Counter[tuple[str, str, bool]] = Counter()
    for k in range(sets):
        (data,) = KINDS[k % len(KINDS)].sets(seed + k, 1)
        counted[answers(data)] += 1
        print(k, dict(counted), flush=True)


if __name__ == "__main__":
    call(main)
