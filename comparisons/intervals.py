"""How often intervals hold the truth: simulated sets of each law, by one step and by shooting.

    python comparisons/intervals.py [--sets 100] [--laws stribeck,dahl] [--machines joint,acrobot]
        [--methods integral,shooting] [--seed 1] [--recordings 8] [--wrong 0] [--jobs 1] [--each]

Each set has motor torques, initial angles and noise of its own, all drawn from its seed, and each
law is fitted to data of its own kind of friction, see `coverage_cases.py`. One-step fits know the
inertia, and the torque acts when it is logged; in shooting friction, inertia and delay are free.
With --wrong 3 nominal masses are 3 % off, and stated as known to 5 %.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from coverage_cases import LAWS, MACHINES, Case, case_of, sets_of
from coverage_fits import Estimated, by_integral, by_shooting
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table
from script import call
from threadpoolctl import threadpool_limits

BAR = (0.92, 0.98)
TOGETHER = 10  # sets that are simulated side by side
METHODS = ("integral", "shooting")


def some(
    case: Case, method: str, seeds: Sequence[int], recordings: int, wrong: float
) -> list[list[Estimated]]:
    """What a few sets show."""
    with threadpool_limits(1):
        if method == "integral":
            return [by_integral(case, d) for d in sets_of(case, seeds, recordings, late=False)]
        sets = sets_of(case, seeds, recordings, late=True, wrong=wrong)
        return [by_shooting(case, dataset, wrong > 0.0) for dataset in sets]


def computed(
    case: Case, method: str, seeds: range, recordings: int, wrong: float, jobs: int
) -> Iterable[list[list[Estimated]]]:
    """Results of all sets, a few in a process, in processes side by side."""
    return Parallel(n_jobs=jobs)(
        delayed(some)(case, method, seeds[k : k + TOGETHER], recordings, wrong)
        for k in range(0, len(seeds), TOGETHER)
    )


def shares(found: Iterable[Estimated]) -> tuple[int, float, float]:
    """Number of identified parameters, the share of them whose interval holds, not identified."""
    everything = list(found)
    held = [e.held for e in everything if e.identified]
    return len(held), float(np.mean(held or [np.nan])), 1.0 - len(held) / len(everything)


def row_of(title: Sequence[str], sets: list[list[Estimated]]) -> list[str]:
    """A line of the table."""
    count, held, lost = shares(e for one in sets for e in one)
    holds = "yes" if BAR[0] <= held <= BAR[1] else "no"
    cells = [str(len(sets)), str(count), f"{100 * held:.1f}", f"{100 * lost:.1f}", holds]
    return [*title, *cells]


def table_of_parameters(sets: list[list[Estimated]]) -> Table:
    """Each parameter: identified, held, mean error and its scatter in half-widths."""
    table = Table("parameter", "identified", "held", "mean error\n[half-widths]", "scatter")
    for name in dict.fromkeys(e.name for one in sets for e in one):
        own = [e for one in sets for e in one if e.name == name and e.identified]
        if own:
            ratio = np.array([e.error / e.half for e in own])
            held = f"{100 * np.mean([e.held for e in own]):.0f}"
            table.add_row(name, str(len(own)), held, f"{ratio.mean():.2f}", f"{ratio.std():.2f}")
        else:
            table.add_row(name, "0", "", "", "")
    return table


def main(
    *,
    sets: int = 100,
    laws: str = ",".join(LAWS),
    machines: str = ",".join(MACHINES),
    methods: str = ",".join(METHODS),
    seed: int = 1,
    recordings: int = 8,
    wrong: float = 0.0,
    jobs: int = 1,
    each: bool = False,
) -> None:
    """Measure and print.

    Parameters
    ----------
    sets : Simulated data sets.
    seed : Of the first set.
    recordings : In each set.
    wrong : Masses off by so many %.
    jobs : Processes side by side.
    each : Show each parameter.
    """
    seeds = range(seed, seed + sets)
    heads = ("law", "machine", "method", "sets", "cases", "held %", "not identified %", "92 to 98")
    table, console = Table(*heads, title="95 % intervals that hold the truth"), Console()
    for machine in machines.split(","):
        for law in laws.split(","):
            if law == "gear_load" and machine == "acrobot":
                continue  # its load is that of one pendulum
            for method in methods.split(","):
                chunks = computed(case_of(law, machine), method, seeds, recordings, wrong, jobs)
                shown = [one for chunk in chunks for one in chunk]
                row = row_of((law, machine, method), shown)
                table.add_row(*row)
                print(*row, flush=True)
                if each:
                    console.print(table_of_parameters(shown))
    console.print(table)


if __name__ == "__main__":
    call(main)
