"""How often `check` names a fault, and how often it says something that is not so.

python comparisons/check_rigour.py [--sets 200] [--seed 1] [--trial NAME]

Each trial draws so many small data sets of one joint (machine, friction, motion and noise from its
seed), plants one fault, and prints the share in which it is named and the share with any other
statement. The sets are those of the tests, more of them.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from fixtures.check_trials import TRIALS, rates


def main() -> None:
    """Print a table, a line as soon as a trial is done."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--trial", choices=list(TRIALS), help="one of them only")
    given = parser.parse_args()
    print(f"{'trial':32} named  others  s    ({given.sets} sets, seed {given.seed})")
    for name in [given.trial] if given.trial else TRIALS:
        begun = time.perf_counter()
        with threadpool_limits(1):
            found = rates(TRIALS[name], given.sets, given.seed)
        seconds = time.perf_counter() - begun
        print(f"{name:32} {found.named:5.1%} {found.alarms:6.1%} {seconds:4.0f}", flush=True)
        for example in found.examples:
            print(f"    {example[:150]}", flush=True)


if __name__ == "__main__":
    main()
