"""Damaged inputs to all commands that read: `make damage`, or python tests/damage.py --count 500.

Each is drawn by its own seed: `--first SEED --count 1` repeats one, and shows what it said.
"""

from __future__ import annotations

import argparse
import importlib
import json
import multiprocessing
import os
import pkgutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))


def main() -> int:
    """Exit status 1 where a fault was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, help="One line of JSON for each input.")
    options = parser.parse_args()
    begin, memory = time.monotonic(), Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as scratch:
        outcomes = list(_outcomes(options, Path(scratch)))
    _summarise(outcomes, time.monotonic() - begin)
    return int(any(outcome.faults for outcome in outcomes))


def _outcomes(options: argparse.Namespace, scratch: Path) -> Iterator[Any]:
    """Outcomes of all seeds, as workers that are forks of this process finish them."""
    prepared = _prepared(scratch)
    queue = multiprocessing.get_context("fork").SimpleQueue()
    workers = []
    for j in range(options.jobs):
        child = os.fork()
        if not child:
            seeds = range(options.first + j, options.first + options.count, options.jobs)
            _work(prepared, seeds, scratch / f"worker-{j}", queue)
            os._exit(0)
        workers.append(child)
    for _ in range(options.count):
        outcome = queue.get()
        if options.count == 1:
            print(outcome.command, outcome.said, sep="\n")
        if options.out:
            with options.out.open("a") as file:
                print(json.dumps(outcome._asdict()), file=file)
        yield outcome
    for child in workers:
        os.waitpid(child, 0)


def _summarise(outcomes: Sequence[Any], seconds: float) -> None:
    faults = Counter(fault for outcome in outcomes for fault in outcome.faults)
    codes = dict(Counter(outcome.code for outcome in outcomes))
    print(f"{len(outcomes)} damaged inputs in {seconds:.0f} s: exit status {codes}")
    slowest, most = max(o.seconds for o in outcomes), max(o.memory for o in outcomes)
    print(f"slowest {slowest:.1f} s, most memory {most / 1e6:.0f} MB")
    for fault, number in faults.most_common():
        seeds = [o.seed for o in outcomes if fault in o.faults][:4]
        print(f"{number:5d}  {fault}  (seeds {seeds})")
    print(f"{sum(bool(o.faults) for o in outcomes)} inputs with faults")


def _prepared(scratch: Path) -> list[Any]:
    """All targets, and all modules loaded, so that each trial is a fork."""
    from fixtures.damage_targets import targets

    import frictionid

    for module in pkgutil.walk_packages(frictionid.__path__, "frictionid."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    (scratch / "whole").mkdir()
    return list(targets(scratch / "whole"))


def _work(prepared: list[Any], seeds: range, place: Path, queue: Any) -> None:
    from fixtures.damage_trial import trial

    place.mkdir()
    for seed in seeds:
        queue.put(trial(prepared, seed, place))


if __name__ == "__main__":
    sys.exit(main())
