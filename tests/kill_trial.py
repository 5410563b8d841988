"""Kills of commands that write, at any instant: what was finished stays, the rest resumes.

python tests/kill_trial.py --comparisons 100 --others 20 [--seed 0]; each kill is SIGKILL to the
whole process group, after a share of an undisturbed run's time drawn by chance.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import pkgutil
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import frictionid

sys.path.insert(0, str(Path(__file__).parent))
TASKS = 8


def main() -> int:
    """Exit status 1 where something was lost or did not resume."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--comparisons", type=int, default=100)
    parser.add_argument("--others", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    for module in pkgutil.walk_packages(frictionid.__path__, "frictionid."):
        importlib.import_module(module.name)
    with tempfile.TemporaryDirectory() as scratch:
        faults = _comparisons(Path(scratch) / "compare", options.comparisons, rng)
        faults += _others(Path(scratch) / "others", options.others, rng)
    print("\n".join([*faults, f"{len(faults)} faults"]))
    return int(bool(faults))


def _ended(folder: Path, words: list[str], after: float | None = None) -> tuple[float, int]:
    """Seconds and exit status of a command, killed after some time; its modules are loaded."""
    begin = time.monotonic()
    child = os.fork()
    if not child:
        _become(folder, words)
    status = None
    while status is None:
        ended, code, _ = os.wait4(child, os.WNOHANG)
        status = code if ended else None
        if status is None and after is not None and time.monotonic() - begin > after:
            os.killpg(child, signal.SIGKILL)
            status = os.waitpid(child, 0)[1]
        time.sleep(0.001)
    return time.monotonic() - begin, os.waitstatus_to_exitcode(status)


def _become(folder: Path, words: list[str]) -> None:
    from frictionid.cli import main

    status = 70
    try:
        os.setsid()
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        os.chdir(folder)
        sys.argv = ["frictionid", *words]
        status = main()
    finally:
        os._exit(status)


def _contents(folder: Path) -> dict[str, bytes]:
    files = (p for p in folder.rglob("*") if p.is_file() and p.name != ".lock")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


# --- Comparisons ----------------------------------------------------------------------------------


def _comparisons(folder: Path, count: int, rng: np.random.Generator) -> list[str]:
    """Kill fresh runs, resumed runs and runs over a finished result, in turn; then resume."""
    from fixtures.tiny_pendulums import write_suite

    if not count:
        return []
    folder.mkdir()
    identifiers = [
        {"kind": "coulomb_viscous", "name": f"c{i}", "width": 0.01 + 0.001 * i}
        for i in range(TASKS)
    ]
    write_suite(folder, [("identifiers", identifiers), ("recipes", [{"name": "integral"}])])
    words = ["compare", "suite.toml", "--jobs", "1", "--out"]
    whole, status = _ended(folder, [*words, "whole"])
    assert status == 0
    wanted = _timeless(folder / "whole")
    faults, with_results, out = [], 0, folder / "out"
    for kill in range(count):
        kind = ("fresh", "resumed", "anew")[kill % 3]
        if kind == "anew":
            shutil.rmtree(out, ignore_errors=True)
            shutil.copytree(folder / "whole", out)
        elif kind == "fresh":
            shutil.rmtree(out, ignore_errors=True)
        before = _finished(out)
        more = ["--resume"] if kind == "resumed" else []
        _ended(folder, [*words, "out", *more], float(rng.uniform(0.05, 1.02)) * whole)
        after = _finished(out)
        with_results += bool(after)
        # a run over a finished result that comes to its end puts whole new files in its place
        ends = kind == "anew" and not (out / "unfinished").exists()
        lost = [n for n in before if not (n in after if ends else before[n] & after.get(n, set()))]
        faults += [f"kill {kill} ({kind}): {name} is lost" for name in lost]
        done = {content for own in after.values() for content in own}
        _, status = _ended(folder, [*words, "out", "--resume"])
        if status or _timeless(out) != wanted:
            faults.append(
                f"kill {kill} ({kind}): not resumed as it would have been, status {status}"
            )
        kept = {content for own in _finished(out).values() for content in own}
        print(f"kill {kill} ({kind}): {len(faults)} faults so far", flush=True)
        if kind != "anew" and done - kept:
            faults.append(
                f"kill {kill} ({kind}): {len(done - kept)} finished tasks were made again"
            )
    print(f"{count} kills of a comparison, {with_results} after its first result", flush=True)
    return faults


def _finished(out: Path) -> dict[str, set[bytes]]:
    """Whole task files by name, in the result and beside it."""
    found: dict[str, set[bytes]] = {}
    for place in (out / "tasks", out / "unfinished" / "tasks"):
        for path in place.glob("[!.]*.json"):
            content = path.read_bytes()
            json.loads(content)
            found.setdefault(path.name, set()).add(content)
    return found


def _timeless(out: Path) -> dict[str, object]:
    """All files of a result without times, and the hashes that hold them."""
    found: dict[str, object] = {}
    for name, content in _contents(out).items():
        if name in ("timings.csv", "SHA256SUMS"):
            continue
        if not name.startswith("tasks/"):
            found[name] = content
            continue
        document = json.loads(content)
        found[name] = {k: v for k, v in document.items() if k not in ("seconds", "sha256")}
    return found


# --- Other commands -------------------------------------------------------------------------------


def _others(folder: Path, count: int, rng: np.random.Generator) -> list[str]:
    """Kill each other command that writes; what it writes is whole, old or new, or not there."""
    if not count:
        return []
    faults = []
    for name, words in _prepared(folder).items():
        case = folder / f"{name}-case"
        whole, status = _ended(folder / "start", words)
        assert status in (0, 1), (name, status)
        new = _contents(folder / "start")
        for path in (folder / "start").glob("out*"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        old = _contents(folder / "start")
        for kill in range(count):
            shutil.rmtree(case, ignore_errors=True)
            shutil.copytree(folder / "start", case)
            _ended(case, words, float(rng.uniform(0.05, 1.02)) * whole)
            found = _contents(case)
            where = f"{name}, kill {kill}"
            faults += [f"{where}: {n} is lost" for n in old if found.get(n) != old[n]]
            faults += [f"{where}: {n} is half a file" for n in _half(found, old, new)]
        print(f"{count} kills of {name}: {len(faults)} faults so far", flush=True)
    return faults


def _half(
    found: Mapping[str, bytes], old: Mapping[str, bytes], new: Mapping[str, bytes]
) -> list[str]:
    """Files under their final names that are not whole: much shorter than they should be."""
    hidden = {n for n in found if any(part.startswith(".") for part in Path(n).parts)}
    own = found.keys() - old.keys() - hidden - {"out/journal.log"}
    return [n for n in own if n not in new or len(found[n]) < 0.9 * len(new[n])]


def _prepared(folder: Path) -> dict[str, list[str]]:
    """Inputs of all commands in folder/start, and the commands."""
    from fixtures.damage_targets import TUTORIAL, _small

    start = folder / "start"
    start.mkdir(parents=True)
    _small(start)
    text = (TUTORIAL / "simulated.toml").read_text().replace("samples = 720", "samples = 240")
    (start / "sim.toml").write_text(text)
    shutil.copy(TUTORIAL / "camera.toml", start)
    shutil.copy(TUTORIAL / "rig.toml", start)
    for words in (
        ["simulate", "sim.toml", "--out", "set"],
        ["render", "set", "--camera", "camera.toml", "--out", "films"],
        ["fit", "tiny", "--identifier", "none", "--out", "model.json"],
        ["track", "films/run.mov", "--out", "angles.csv"],
        ["compare", "suite.toml", "--out", "result", "--jobs", "1"],
    ):
        assert _ended(start, words)[1] == 0, words
    film = ["--overlay", "out/over.mp4", "--sheet", "out/sheet.png"]
    return {
        "simulate": ["simulate", "sim.toml", "--out", "out"],
        "render": ["render", "set", "--camera", "camera.toml", "--out", "out"],
        "track": ["track", "films/run.mov", "--out", "out/angles.csv", *film],
        "fit": ["fit", "tiny", "--identifier", "mlp", "--out", "out/m.json"],
        "evaluate": ["evaluate", "model.json", "tiny", "--horizons", "0.1", "--out", "out/s.csv"],
        "check": ["check", "tiny", "--out", "out"],
        "tune": ["tune", "suite.toml", "--out", "out", "--jobs", "1"],
    }


if __name__ == "__main__":
    sys.exit(main())
