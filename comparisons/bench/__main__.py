"""Speed beside others, as ratios measured in one run: `make bench`.

python comparisons/bench [--only NAME ...] [--whole] [--out report/bench]

All sides of a part run in turn, round after round, so that other work on the machine disturbs all
of them alike. A ratio is the time of the peer over ours, the accuracy of both stands beside it.
Work that is done once counts imports and the first call, in which compiled loops are loaded;
else they are stated apart. Peers that are not installed are named.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import warnings
from pathlib import Path

import commands
import fits
import networks
import physics
import picture
import results
import rollouts
import shooting
import states
import tracking
from case import NotInstalledError
from measure import Row, measured
from rich.console import Console
from samples import ROOT
from threadpoolctl import threadpool_limits

from frictionid.report.figures.style import rendered

PARTS = {
    "physics": physics.one_step,
    "arms": physics.arms,
    "smoother": states.smoother,
    "residual": states.residual,
    "parametric": fits.parametric,
    "sparse": fits.sparse,
    "networks": networks.networks,
    "gpu": networks.on_gpu,
    "shooting": shooting.shooting,
    "rollout": rollouts.smooth,
    "stiction": rollouts.with_stiction,
    "peak": rollouts.peak_share,
    "tracking": tracking.tracking,
    "start": commands.start,
    "comparison": commands.comparison,
}
POOLS = ("OMP", "OPENBLAS", "MKL", "NUMEXPR")
MINUTES = ("comparison",)  # only with --whole


def main() -> None:
    """Measure, print, and write the table and the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=PARTS, metavar="NAME", help=", ".join(PARTS))
    parser.add_argument("--whole", action="store_true", help="the default comparison, too")
    parser.add_argument("--out", type=Path, default=ROOT / "report" / "bench", help="folder")
    given = parser.parse_args()
    say = Console(width=None if sys.stdout.isatty() else 180)
    warnings.simplefilter("ignore")  # of peers
    os.environ.update({f"{name}_NUM_THREADS": "1" for name in POOLS})  # of processes started here
    usual = [name for name in PARTS if given.whole or name not in MINUTES]
    rows, notes = [], []
    for name in given.only or usual:
        begin = time.perf_counter()
        try:
            with threadpool_limits(1):
                rows += measured(PARTS[name]())
        except NotInstalledError as missing:
            notes.append(f"not measured: {name}, not installed: {missing}")
            say.print(notes[-1], markup=False)
            continue
        say.print(f"{name}: {time.perf_counter() - begin:.0f} s")
    notes = [*results.machine(), *notes]
    say.print(results.terminal(rows))
    for note in notes:
        say.print(note, markup=False)
    if rows:
        write(rows, notes, given.out)
        say.print(f"written to {given.out}", markup=False)


def write(rows: list[Row], notes: list[str], folder: Path) -> None:
    """Table and picture."""
    folder.mkdir(parents=True, exist_ok=True)
    results.frame(rows).to_csv(folder / "bench.csv", index=False, float_format="%.4g")
    (folder / "bench.md").write_text(results.markdown(rows, notes))
    for kind, content in rendered(picture.picture(rows), ("svg", "png")).items():
        (folder / f"bench.{kind}").write_bytes(content)


if __name__ == "__main__":
    main()
