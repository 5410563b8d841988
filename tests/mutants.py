"""Mutation testing: how many of a random sample of small changes to the code fail a test?

    pip install cosmic-ray
    python tests/mutants.py --count 40 --seed 0 --only dynamics

Changes are those of cosmic-ray: other operators, numbers, comparisons, constants, loops and
decorators; not in type annotations, which nothing executes. They are made in a copy of the clone.
A change is killed where the package's own tests fail, or do not end. Survivors are listed with
their differences.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PACKAGES = ("data", "dynamics", "evaluation", "identifiers", "shooting")
LIMIT = 1200.0  # [s] for the tests of one change
LEFT_OUT = (".git", ".venv", "report", "site", ".mypy_cache", ".ruff_cache", "__pycache__")


def main() -> None:
    """Print how many changes were killed, and those that were not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40, help="changes in each package")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=PACKAGES, nargs="*", default=PACKAGES)
    parser.add_argument("--out", type=Path, help="one line of JSON for each change")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        clone = Path(scratch) / "clone"
        shutil.copytree(ROOT, clone, ignore=shutil.ignore_patterns(*LEFT_OUT))
        for package in given.only:
            survived, total = [], 0
            for found in _outcomes(clone, package, given.count, given.seed):
                total += 1
                survived += [] if found["killed"] else [found["diff"]]
                if given.out is not None:
                    with given.out.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(found) + "\n")
            print(f"{package}: {total - len(survived)} of {total} killed", flush=True)
            print("\n".join(survived), flush=True)


def _outcomes(clone: Path, package: str, count: int, seed: int) -> Iterator[dict[str, Any]]:
    """Each change of a sample, and whether a test failed."""
    from cosmic_ray.mutating import mutate_and_test
    from cosmic_ray.testing import run_tests
    from cosmic_ray.work_item import TestOutcome

    os.chdir(clone)
    own = f"tests/{package} frictionid/{package}"  # tests, and examples of docstrings
    command = f"env PYTHONPATH={clone} {sys.executable} -m pytest -x -q -p no:cacheprovider {own}"
    outcome, said = run_tests(command, LIMIT)
    if outcome != TestOutcome.SURVIVED:
        raise SystemExit(f"the tests of {package} fail without any change:\n{said}")
    items = _changes(clone, package)
    for change in random.Random(seed).sample(items, min(count, len(items))):
        result = mutate_and_test([change], command, LIMIT)
        yield {
            "file": str(Path(change.module_path).relative_to(clone)),
            "line": change.start_pos[0],
            "operator": change.operator_name,
            "killed": result.is_killed,
            "diff": result.diff,
        }


def _changes(clone: Path, package: str) -> list[Any]:
    """All changes that can be made to a package, without those in annotations."""
    from cosmic_ray.commands import init
    from cosmic_ray.work_db import WorkDB, use_db

    with use_db(str(clone / "changes.sqlite"), WorkDB.Mode.create) as db:
        modules = sorted((clone / "frictionid" / package).rglob("*.py"))
        init(modules, db, {})
        changes = [change for item in db.work_items for change in item.mutations]
    never = {module: _annotations(module) for module in modules}
    return [c for c in changes if not _within(c, never[Path(c.module_path)])]


def _annotations(module: Path) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Begin and end, as line and column, of all type annotations."""
    spans = []
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        for name in ("annotation", "returns"):
            own = getattr(node, name, None)
            if own is not None:
                spans.append(((own.lineno, own.col_offset), (own.end_lineno, own.end_col_offset)))
    return spans


def _within(change: Any, spans: list[tuple[tuple[int, int], tuple[int, int]]]) -> bool:
    """Whether a change lies in one of the spans."""
    return any(first <= change.start_pos <= last for first, last in spans)


if __name__ == "__main__":
    main()
