"""Shooting beside mujoco.sysid, a fresh process each: see `peers/mujoco_sysid.py`.

Imports and first use are in the time of a process. The peer's rollouts use all cores, so that it is
the time on the wall that is compared.
"""

from __future__ import annotations

from collections.abc import Callable

from case import Case, NotInstalledError, Part, Side
from samples import ROOT

from frictionid.data.recordings import Dataset
from frictionid.simulate import load_rig, simulate

SEED = 1
WAYS = {"documented": "as its README calls it", "batched": "all windows in one batch"}


def shooting() -> Part:
    """Coulomb and viscous friction, and asymmetric Stribeck friction, which the peer has not."""
    _check_installed()
    from mujoco_sysid import task_of, truths

    cases = []
    for truth, rig in truths(load_rig(ROOT / "data" / "acrobot_clean" / "rig.toml")).items():
        dataset = simulate(rig, SEED)
        task = task_of(dataset)
        own = Side("frictionid", _run(task, dataset, truth, "our_side.py", truth))
        for way, words in WAYS.items():
            run = _run(task, dataset, "coulomb_viscous", "mujoco_side.py", way)
            case = Case(
                f"shooting, {task.count} windows, true friction {truth}",
                own,
                Side(f"mujoco.sysid, {words}", run),
                "friction curve [%]",
                bar=10.0 if way == "documented" else None,
                error_bar=0.1,
                once=True,
                clock="wall",
            )
            cases.append(case)
    return Part(tuple(cases), 2)


def _check_installed() -> None:
    try:
        from mujoco_side import available
    except ImportError:
        found = False
    else:
        found = available()
    if not found:
        raise NotInstalledError("mujoco.sysid (pip install 'frictionid[peers]')")


def _run(
    task: object, dataset: Dataset, law: str, script: str, argument: str
) -> Callable[[], float]:
    from mujoco_sysid import error_of, solve

    def run() -> float:
        theta = solve(task, script, argument)[0]
        return 100 * float(error_of(theta, law, dataset).mean())

    return run
