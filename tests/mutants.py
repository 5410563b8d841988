"""Mutation testing: how many of a random sample of small changes to the code fail a test?

    pip install cosmic-ray pytest-cov
    python tests/mutants.py --count 40 --seed 0 --only dynamics

Changes are those of cosmic-ray: other operators, numbers, comparisons, constants, loops and
decorators; not in type annotations, which nothing executes. They are made in a copy of the clone.
A change is run by the tests that execute its statement, quick ones first, for half a minute: it is
killed where one of them fails, or does not end. Of compiled loops, which no test is seen to
execute, it is run by the tests of what imports them. Survivors are listed with their differences.
"""

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).parents[1]
PACKAGES = ("data", "dynamics", "evaluation", "fitting")
BESIDE = ("friction", "mechanics", "deploy")  # whose tests are run as well
BUDGET = 30.0  # [s] of tests for each change
LIMIT = 400.0  # [s] after which a change does not end

Lines = dict[int, set[str]]  # of a file: the tests that execute each line


def main():
    """Print how many changes were killed, and those that were not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40, help="changes in each package")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=PACKAGES, nargs="*", default=PACKAGES)
    parser.add_argument("--out", type=Path, help="one line of JSON for each change")
    given = parser.parse_args()
    out = given.out and given.out.absolute()
    with tempfile.TemporaryDirectory() as scratch:
        clone = Path(scratch) / "clone"
        _copy(clone)
        os.chdir(clone)
        # a change of equal length would run from bytecode of before: files keep their times
        os.environ |= {"PYTHONPATH": str(clone), "PYTHONDONTWRITEBYTECODE": "1"}
        seconds = _without_changes(clone)
        for package in given.only:
            survived, total = [], 0
            for found in _outcomes(clone, package, given.count, given.seed, seconds):
                total += 1
                survived += [] if found["killed"] else [found["diff"]]
                if out is not None:
                    with out.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(found) + "\n")
            print(f"{package}: {total - len(survived)} of {total} killed", flush=True)
            print("\n".join(survived), flush=True)


def _copy(clone):
    """Copy what git keeps, as it is now."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    for name in filter(None, names.stdout.decode().split("\0")):
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, clone / name)


def _without_changes(clone):
    """Run the tests without any change, noting what they execute; time [s] of each test."""
    folders = [f"tests/{name}" for name in (*PACKAGES, *BESIDE)]
    examples = [f"frictionid/{name}" for name in PACKAGES]
    measured = [f"--cov=frictionid/{name}" for name in PACKAGES]
    words = ["-q", "--cov-context=test", "--cov-report=", "--junitxml=tests.xml", *measured]
    command = [sys.executable, "-m", "pytest", *words, *folders, *examples]
    if subprocess.run(command, cwd=clone).returncode:
        raise SystemExit("the tests fail without any change")
    seconds = {}
    for case in ElementTree.parse(clone / "tests.xml").iter("testcase"):
        name = f"{case.attrib['classname'].replace('.', '/')}.py::{case.attrib['name']}"
        seconds[name] = float(case.attrib["time"])
    return seconds


def _outcomes(clone, package, count, seed, seconds):
    """Each change of a sample, and whether a test failed."""
    from cosmic_ray.mutating import mutate_and_test
    from coverage import CoverageData

    executed = CoverageData(str(clone / ".coverage"))
    executed.read()
    items = _changes(clone, package)
    for change in random.Random(seed).sample(items, min(count, len(items))):
        module = Path(change.module_path)
        tests = _quick_ones(_executing(change, executed, clone / "frictionid"), seconds)
        (clone / "tests.txt").write_text("\n".join(tests), encoding="utf-8")
        pytest = f"{sys.executable} -m pytest -x -q -p no:cacheprovider @tests.txt"
        if "frictionid.compiled" not in module.read_text(encoding="utf-8"):
            # the machine code that is kept stays right
            pytest = f"sh -c 'touch -d @{module.stat().st_mtime} {module} && {pytest}'"
        result = mutate_and_test([change], pytest if tests else "true", LIMIT)
        yield {
            "file": str(module.relative_to(clone)),
            "line": change.start_pos[0],
            "operator": change.operator_name,
            "tests": len(tests),
            "killed": result.is_killed,
            "diff": result.diff,
        }


def _executing(change, executed, package):
    """Tests that execute the statement of a change, or else any of its file, or what imports it."""
    module, line = Path(change.module_path), change.start_pos[0]
    tree = ast.parse(module.read_text(encoding="utf-8"))
    around = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or line)
    ]
    first = max((node.lineno for node in around), default=line)
    by_line = _by_line(executed, module)
    own = set[str]().union(*(by_line.get(n, set()) for n in range(first, line + 1)))
    modules, seen = {module}, {module}
    while modules and not own:
        own = set[str]().union(*(t for m in modules for t in _by_line(executed, m).values()))
        modules = _importers(modules, package) - seen
        seen |= modules
    return own


def _by_line(executed, module):
    contexts = executed.contexts_by_lineno(str(module))
    return {line: {c.partition("|")[0] for c in own if c} for line, own in contexts.items()}


def _importers(modules, package):
    """Files of the package that import one of the modules."""
    names = [".".join(m.relative_to(package.parent).with_suffix("").parts) for m in modules]
    lines = {f"from {name} import" for name in names}
    lines |= {f"from {a} import {b}" for a, _, b in (name.rpartition(".") for name in names)}
    files = package.rglob("*.py")
    return {f for f in files if any(line in f.read_text(encoding="utf-8") for line in lines)}


def _quick_ones(tests, seconds):
    """The quickest tests, as many as the budget holds, and one at least."""
    chosen = []
    spent = 0.0
    for test in sorted(tests & set(seconds), key=lambda t: (seconds[t], t)):
        spent += seconds[test]
        if chosen and spent > BUDGET:
            break
        chosen.append(test)
    return chosen


def _changes(clone, package):
    """All changes that can be made to a package, without those in annotations."""
    from cosmic_ray.commands import init
    from cosmic_ray.work_db import WorkDB, use_db

    with use_db(str(clone / f"{package}.sqlite"), WorkDB.Mode.create) as db:
        modules = sorted((clone / "frictionid" / package).rglob("*.py"))
        init(modules, db, {})
        changes = [change for item in db.work_items for change in item.mutations]
    never = {module: _annotations(module) for module in modules}
    return [c for c in changes if not _within(c, never[Path(c.module_path)])]


def _annotations(module):
    """Begin and end, as line and column, of all type annotations."""
    spans = []
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        for name in ("annotation", "returns"):
            own = getattr(node, name, None)
            if own is not None:
                spans.append(((own.lineno, own.col_offset), (own.end_lineno, own.end_col_offset)))
    return spans


def _within(change, spans):
    """Whether a change lies in one of the spans."""
    return any(first <= change.start_pos <= last for first, last in spans)


if __name__ == "__main__":
    main()
