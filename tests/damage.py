"""Damaged inputs to all commands that read: `make damage`, or python tests/damage.py --count 500.

Each is drawn by its own seed: `--first SEED --count 1` repeats one, and shows what it said.
With `--readers` data sets are only loaded, `--count` with damaged recordings of each reader.
"""

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
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
Task = Callable[[Path], Any]  # from a scratch folder to an Outcome


def main():
    """Exit status 1 where a fault was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, help="One line of JSON for each input.")
    parser.add_argument("--readers", action="store_true", help="Recordings of each reader.")
    options = parser.parse_args()
    begin, memory = time.monotonic(), Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as scratch:
        outcomes = list(_outcomes(options, Path(scratch)))
    _summarise(outcomes, time.monotonic() - begin)
    return int(any(outcome.faults for outcome in outcomes))


def _outcomes(options, scratch):
    """Outcomes of all seeds, as workers that are forks of this process finish them."""
    seeds = range(options.first, options.first + options.count)
    tasks = _readings(scratch, seeds) if options.readers else _trials(scratch, seeds)
    queue = multiprocessing.get_context("fork").SimpleQueue()
    workers = []
    for j in range(options.jobs):
        child = os.fork()
        if not child:
            _work(tasks[j :: options.jobs], scratch / f"worker-{j}", queue)
            os._exit(0)
        workers.append(child)
    for _ in tasks:
        outcome = queue.get()
        if options.count == 1:
            print(outcome.command, outcome.said, sep="\n")
        if options.out:
            with options.out.open("a") as file:
                print(json.dumps(outcome._asdict()), file=file)
        yield outcome
    for child in workers:
        os.waitpid(child, 0)


def _summarise(outcomes, seconds):
    for name in sorted({o.target for o in outcomes}):
        own = [o for o in outcomes if o.target == name]
        refused, bad = sum(o.code == 2 for o in own), sum(bool(o.faults) for o in own)
        print(f"{name:20s} {len(own):6d} damaged, {refused:6d} refused, {bad:4d} with faults")
    faults = Counter(fault for outcome in outcomes for fault in outcome.faults)
    codes = dict(Counter(outcome.code for outcome in outcomes))
    print(f"{len(outcomes)} damaged inputs in {seconds:.0f} s: exit status {codes}")
    slowest, most = max(o.seconds for o in outcomes), max(o.memory for o in outcomes)
    print(f"slowest {slowest:.1f} s, most memory {most / 1e6:.0f} MB")
    for fault, number in faults.most_common():
        seeds = [o.seed for o in outcomes if fault in o.faults][:4]
        print(f"{number:5d}  {fault}  (seeds {seeds})")
    print(f"{sum(bool(o.faults) for o in outcomes)} inputs with faults")


def _readings(scratch, seeds):
    """Each reader with each seed."""
    from fixtures.damage_targets import recordings
    from fixtures.damage_trial import reading

    targets = list(recordings(scratch / "whole"))
    return [partial(reading, target, seed) for seed in seeds for target in targets]


def _trials(scratch, seeds):
    """Each seed draws a command; all modules are loaded, so that each trial is a fork."""
    from fixtures.damage_targets import targets
    from fixtures.damage_trial import trial

    import frictionid

    for module in pkgutil.walk_packages(frictionid.__path__, "frictionid."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    (scratch / "whole").mkdir()
    prepared = list(targets(scratch / "whole"))
    return [partial(trial, prepared, seed) for seed in seeds]


def _work(tasks, place, queue):
    place.mkdir()
    for task in tasks:
        queue.put(task(place))


if __name__ == "__main__":
    sys.exit(main())
