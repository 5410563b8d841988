"""How often shooting names a disturbed recording among good ones, and how often a good one.

    python comparisons/odd_runs.py [SETS]

Sets of eight recordings of a joint with Coulomb and viscous friction; in one of them a hand pushes
for 0.3 s, or a tenth of the mass is added, and nobody tells the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from coverage_cases import case_of, rig_of
from coverage_fits import shot
from script import call

from frictionid.data.recordings import Dataset
from frictionid.simulate import simulate
from frictionid.simulate.torques import AnyCommand

CASE = case_of("coulomb_viscous", "joint")
RECORDINGS, BAD = 8, 5
PUSH, AT = 0.15, (1.2, 1.5)  # [N m], [s]


@dataclass(frozen=True)
class Pushed:
    """A command with the torque of a hand beside it for a while."""

    command: AnyCommand
    kind: str = "pushed"

    def values(self, time: np.ndarray, generator: np.random.Generator) -> np.ndarray:
        """The command, and the push."""
        inside = (time > AT[0]) & (time < AT[1])
        return self.command.values(time, generator) + PUSH * inside


def sets_with(fault: str, seeds: Sequence[int]) -> list[Dataset]:
    """Sets in which recording `BAD` has a fault: "push", "mass", or "none"."""
    rig = replace(rig_of(CASE, seeds, RECORDINGS, late=True), substeps=4)
    changed = rig
    if fault == "push":
        runs = [
            replace(run, torques=tuple(map(Pushed, run.torques)) if run.torques else ())
            for run in rig.recordings
        ]
        changed = replace(rig, recordings=tuple(runs))
    if fault == "mass":
        changed = replace(rig, true_parameters={**rig.true_parameters, "mass": 0.55})
    good, bad = simulate(rig), simulate(changed) if fault != "none" else None
    out = []
    for first in range(0, len(good.recordings), RECORDINGS):
        own = list(good.recordings[first : first + RECORDINGS])
        if bad is not None:
            logged = own[BAD].torque
            own[BAD] = replace(bad.recordings[first + BAD], torque=logged)
        out.append(replace(good, recordings=tuple(own)))
    return out


def named(dataset: Dataset) -> tuple[str, ...]:
    """Recordings that shooting names as odd."""
    return tuple(odd.recording for odd in shot(dataset, CASE.law).diagnostics.odd)


def main(sets: int = 20) -> None:
    """Print how many are named."""
    for fault in ("none", "push", "mass"):
        datasets = sets_with(fault, range(sets))
        right = wrong = 0
        for dataset in datasets:
            names = named(dataset)
            bad = dataset.recordings[BAD].name if fault != "none" else None
            right += bad in names
            wrong += any(name != bad for name in names)
        print(f"{fault}: {sets} sets, named {right}, a good one named in {wrong}", flush=True)


if __name__ == "__main__":
    call(main)
