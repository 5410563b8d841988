"""Kills of commands that write, at any instant: what was there is whole, and they can be run again.

python tests/kill_trial.py --count 20 [--seed 0] [--only NAME]; each kill is SIGKILL to the whole
process group, after a share of an undisturbed run's time drawn by chance. Pictures are not drawn:
what counts is where and when they are written. Comparisons and full disks: tests/comparison, and
tests/cli/test_full_disk.py.
"""

import argparse
import importlib
import pkgutil
import re
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import frictionid

sys.path.insert(0, str(Path(__file__).parent))

COMMANDS = """
simulate      => simulate sim.toml --out out
simulate over => simulate sim.toml --seed 9 --out set --replace
render        => render set --camera camera.toml --out out
track         => track films/run.mov --out out/angles.csv --overlay out/over.mp4
                 --sheet out/sheet.png
fit           => fit tiny --identifier mlp --set iterations=3 --out out/m.json
fit over      => fit tiny --identifier mlp --set iterations=3 --seed 3 --out net.json --replace
evaluate      => evaluate model.json tiny --horizons 0.1 --out out/s.csv
predict       => predict model.json tiny --horizon 0.1 --out out/p.csv
check         => check tiny --out out
quick         => quick tiny --figure out/q.png
init          => init arm --mechanism pendulum --set mass=0.5 --set length=0.3
                 --kt 0.025 --gear 20
suggest       => suggest --mechanism rig.toml --limits torque=1,velocity=20 --effort 2 --length 1
                 --out out/u.csv
align         => align angles.csv log.csv --out out --name run
report        => report result
compare       => compare suite.toml --out out --jobs 1
tune          => tune suite.toml --out out --jobs 1
"""
PREPARATION = """
simulate sim.toml --out set
render set --camera camera.toml --out films
fit tiny --identifier none --out model.json
fit tiny --identifier mlp --set iterations=3 --out net.json
track films/run.mov --out seen.csv
compare suite.toml --out result --jobs 1
"""
# What must still be possible with what a kill leaves.
USES = {
    "fit over": "evaluate net.json tiny --horizons 0.1 --out used.csv",
    "simulate over": "fit set --identifier none --out used.json",
}
# How a command is run again where that is not with --replace.
AGAIN = {"compare": ["--resume"], "tune": ["--resume"], "init": []}


def main():
    """Exit status 1 where something was lost or could not be run again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", help="One of the commands; repeatable.")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    for module in pkgutil.walk_packages(frictionid.__path__, "frictionid."):
        importlib.import_module(module.name)
    Figure.savefig = lambda _, stream, **__: stream.write(b"picture" * 5000)
    with tempfile.TemporaryDirectory() as scratch:
        faults = _faults(Path(scratch), options, rng)
    print("\n".join([*faults, f"{len(faults)} faults"]))
    return int(bool(faults))


def _faults(folder, options, rng):
    """Kill each command: what is there is whole, and it can be run again."""
    from fixtures.forked import contents, run_forked

    count, faults = options.count, []
    for name, words in _prepared(folder).items():
        if options.only and name not in options.only:
            continue
        case, start = folder / f"{name}-case", folder / "start"
        shutil.copytree(start, case)
        status, whole, _ = run_forked(case, words)
        assert status in (0, 1), (name, status)
        old, new = contents(start, ".lock"), contents(case, ".lock")
        for kill in range(count):
            shutil.rmtree(case)
            shutil.copytree(start, case)
            run_forked(case, words, patience=float(rng.uniform(0.05, 1.02)) * whole)
            found, where = contents(case, ".lock"), f"{name}, kill {kill}"
            faults += [f"{where}: {n} is lost" for n in _lost(found, old, new)]
            faults += [f"{where}: {n} is half a file" for n in _half(found, old, new)]
            if name in USES and run_forked(case, USES[name].split())[0]:
                faults.append(f"{where}: what it leaves cannot be used")
            again = [w for w in words if w != "--replace"] + AGAIN.get(name, ["--replace"])
            status = run_forked(case, again)[0]
            # init refuses to run again where it has come to its end
            right = (2,) if name == "init" and "arm/dataset.toml" in found else (0, 1)
            faults += [f"{where}: run again, status {status}"] if status not in right else []
            faults += [
                f"{where}: run again, {n} is missing" for n in new.keys() - contents(case).keys()
            ]
        shutil.rmtree(case)
        print(f"{count} kills of {name} ({whole:.2f} s): {len(faults)} faults so far", flush=True)
    return faults


def _lost(found, old, new):
    """Files that are neither as they were nor as the command leaves them."""
    return [n for n in old if found.get(n) not in (old[n], new.get(n))]


def _half(found, old, new):
    """Files under their final names that are not whole: much shorter than they should be."""
    hidden = {n for n in found if re.search(r"(^|/)(\.|unfinished/)", n)}
    own = found.keys() - old.keys() - hidden - {"out/journal.log"}
    return [n for n in own if n not in new or len(found[n]) < 0.9 * len(new[n])]


def _prepared(folder):
    """Inputs of all commands in folder/start, and the commands."""
    from fixtures.damage_own_data import swing
    from fixtures.damage_targets import TUTORIAL, small, write_angles_and_log
    from fixtures.forked import run_forked
    from fixtures.mistakes import rows

    start = folder / "start"
    start.mkdir(parents=True)
    small(start)
    text = (TUTORIAL / "simulated.toml").read_text().replace("samples = 720", "samples = 240")
    (start / "sim.toml").write_text(text)
    shutil.copy(TUTORIAL / "camera.toml", start)
    shutil.copy(TUTORIAL / "rig.toml", start)
    for line in PREPARATION.strip().splitlines():
        assert run_forked(start, line.split())[0] == 0, line
    shutil.copytree(start / "result" / "tasks", start / "again" / "tasks")
    for name in ("provenance.json", "datasets.json"):
        shutil.copy(start / "result" / name, start / "again")
    shutil.rmtree(start / "result")
    (start / "again").rename(start / "result")  # without what a report makes
    (start / "arm").mkdir()
    for i in range(4):
        swing(i).to_csv(start / "arm" / f"run{i}.csv", index=False)
    write_angles_and_log(start)
    lines = rows(re.sub(r"\n {2,}(?=--)", " ", COMMANDS))
    return {name: line.split() for name, line in lines}


if __name__ == "__main__":
    sys.exit(main())
