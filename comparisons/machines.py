"""Every public machine by the same rules: which friction it needs, and how good the choice is.

    python comparisons/machines.py [MACHINE ...] [--out docs/machines.md]

One suite for each machine is made here and run as `frictionid compare --resume` does, into
report/machines; the table is made of all that is finished there. By hand nothing is chosen but the
data sets:

- families: laws without memory, a sparse sum, a static and a recurrent network, published models;
- recipes: `calibrated` for all, `shooting` from there for laws and the sparse sum; of arms whose
  controller is in no log `integral` and `inverse_dynamics`, since without it predictions drift off;
- samples at least 10 ms apart; horizons of 0.1 to 1 s, judged after 0.5 s, of these arms 0.05 to
  0.2 s, judged by the share of the torque that is left;
- folds of whole recordings, or six of time where there are fewer than five recordings.

An error is the median of the predictions, or the torque left, on recordings that neither fits nor
the choice have seen: sets for tests, other motion, or the last 30 % of one recording. The choice is
the verdict's, by the folds alone; its regret is its error over that of the best fitted model by
hindsight.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import tomli_w
from script import call

from frictionid.api.suites import run_suite
from frictionid.comparison.suite import Suite
from frictionid.config import read_toml
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.files import plain

HERE = Path(__file__).parent
DATA, REPORT = HERE.parent / "data", HERE.parent / "report" / "machines"
LAWS: tuple[dict[str, Any], ...] = (
    {"kind": "coulomb_viscous"},
    {"kind": "stribeck"},
    {"kind": "load_dependent"},
    {"kind": "stribeck", "name": "stribeck_asymmetric", "symmetric": False},
    {"kind": "motor_load"},
)
NETWORKS = ("mlp", "lstm")
APART, FEW, BLOCKS = 0.01, 5, 6
JUDGED = 0.5  # [s]


class Machine(NamedTuple):
    """A machine's data set, data sets that test what was fitted to it, and published models.

    fitted, unseen : keys of [recordings] of what is fitted and of what tests it, where the data set
        is split
    held : whether a controller held it that is in no log
    """

    name: str
    tests: tuple[str, ...] = ()
    published: tuple[str, ...] = ()
    fitted: Mapping[str, Any] = {}
    unseen: Mapping[str, Any] = {}
    held: bool = False


def parted(name: str, at: float, *published: str, held: bool = False) -> Machine:
    """A machine whose recording is fitted up to a time [s], and tested after it."""
    return Machine(name, (), published, {"stop": at}, {"start": at}, held)


def split(name: str, fitted: Sequence[str], unseen: Sequence[str], *published: str) -> Machine:
    """A machine whose recordings are fitted or test, by patterns of their names."""
    return Machine(name, (), published, {"patterns": fitted}, {"patterns": unseen})


MACHINES = {
    machine.name: machine
    for machine in (
        Machine("dfki_c1", ("dfki_c1_swingup", "dfki_c1_pendubot"), ("model_1.0", "model_2.0")),
        split("dfki_a0", ["**/*_0[0-3].csv*"], ["**/*_05.csv*", "**/*_11.csv*"]),
        split("simple_pendulum", ["ddp*"], ["direct_collocation*"], "published"),
        parted("phy180", 81.5),
        parted("emps", 17.4, "janot_2019"),
        Machine("bam_xl330", ("bam_xl330_passive",), ("m1", "m6")),
        split("ibm", ["[0-3].csv*"], ["[45].csv*"]),
        parted("tx40", 5.23, "figaroh", held=True),
        parted("tiago", 50.27, held=True),
    )
}


def datasets(machine: Machine) -> dict[str, Any]:
    """What a suite fits and what tests it; of a split set the descriptions of both are written."""
    if not machine.unseen:
        tests = [str(DATA / test) for test in machine.tests]
        return {"path": str(DATA / machine.name), "tests": tests}
    return {
        "path": str(_description(machine.name, "fitted", machine.fitted)),
        "tests": [str(_description(machine.name, "unseen", machine.unseen))],
    }


def _description(name: str, which: str, recordings: Mapping[str, Any]) -> Path:
    table = read_toml(DATA / name / "dataset.toml")
    table["name"], folder = f"{name}_{which}", REPORT / "data" / f"{name}_{which}"
    table["recordings"] |= recordings
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "dataset.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    return folder


# --- Suites --------------------------------------------------------------------------------------


def suite_of(machine: Machine, dataset: Dataset, files: Mapping[str, Any]) -> Suite:
    """The suite of a machine and of what of it is fitted, as a file beside this one would be."""
    one_step, refined = "calibrated", {"name": "shooting", "start": "calibrated"}
    if machine.held:
        one_step, refined = "integral", {"name": "inverse_dynamics"}
    name, recordings = machine.name, dataset.recordings
    driven = any(bool(np.any(r.torque.value)) for r in recordings)
    dense = min(float(np.median(np.diff(r.angle.time))) for r in recordings) < APART
    # of an arm inertias and biases are free: these differ by direction, beside those the motors'
    # torque explains anything
    laws = LAWS[:-2] if machine.held else LAWS if driven else LAWS[:-1]
    sparse = {"kind": "sindy", **({"recipes": [one_step]} if machine.held else {})}
    of_one = ("none", *NETWORKS)
    identifiers = [*laws, sparse, *({"kind": kind, "recipes": [one_step]} for kind in of_one)]
    for model in machine.published:
        file = f"../data/{name}/{model}.json"
        identifiers.append({"kind": "published", "name": model, "file": file})
    folds = {"count": BLOCKS, "kind": "blocks"} if len(recordings) < FEW else {"kind": "recordings"}
    table = {
        "name": name,
        "title": dataset.origin.get("description", name),
        "horizons": [0.05, 0.1, 0.2] if machine.held else [0.1, 0.25, 0.5, 1.0],
        "folds": folds,
        "datasets": [files],
        "recipes": [{"name": one_step}, refined],
        "identifiers": identifiers,
    }
    return Suite.model_validate(table | ({"sample_time": APART} if dense else {}))


def run(machine: Machine, jobs: int) -> None:
    """Run what is left of a machine's suite."""
    files = datasets(machine)
    suite = suite_of(machine, load_dataset(files["path"]), files)
    out = REPORT / machine.name
    table = suite.model_dump(exclude_none=True)
    with tempfile.NamedTemporaryFile("wb", suffix=".toml", dir=HERE) as file:
        tomli_w.dump(plain({**table.pop("protocol"), **table}), file)
        file.flush()
        run_suite(
            file.name,
            out=out,
            jobs=jobs,
            resume=True,
            replace=True,
            progress=lambda _: nullcontext(partial(print, "  ", flush=True)),
        )


# --- Table ---------------------------------------------------------------------------------------


class Row(NamedTuple):
    """What the verdict chose on a machine, and how good that is where it is judged.

    over : its error over that of the best published model, NaN without; regret : over the best's
    seconds : that fits and scores of all models took, calibrations not included
    """

    machine: str
    judged: str
    chosen: str
    error: float
    over: float
    best: str
    regret: float
    needs: str
    seconds: float


def rows_of(machine: Machine) -> Iterator[Row]:
    """A row for each test."""
    folder = REPORT / machine.name
    verdict = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))["datasets"][0]
    scores = pd.read_csv(folder / "scores.csv")
    chosen = verdict["recommended"] or verdict["provisional"]
    sure = "" if verdict["recommended"] else " (provisional)"
    answers = {q["name"]: q["answer"].replace("_", " ") for q in verdict["questions"]}
    fitted = {c["name"] for c in verdict["candidates"] if c["identifier"] not in machine.published}
    for judged in machine.tests or (f"{machine.name}_unseen",):
        error = errors(scores, machine, judged)
        published = error[list(machine.published)]
        ours = error[[name in fitted for name in error.index]]
        yield Row(
            machine.name,
            judged if machine.tests else "unseen",
            chosen + sure,
            error[chosen],
            error[chosen] / published.min(),
            str(ours.idxmin()),
            error[chosen] / ours.min(),
            answers["beyond_coulomb_viscous"],
            pd.read_csv(folder / "timings.csv").seconds.sum(),
        )


def errors(scores: pd.DataFrame, machine: Machine, judged: str) -> pd.Series:
    """Errors of all models on a data set, by the verdict's names: given ones have no recipe."""
    score, statistic = scores.score == "rollout_angle", scores.statistic == "median"
    if machine.held:
        score, statistic = scores.score == "torque_left", scores.statistic == "share"
    rows = scores[
        (scores.dataset == judged)
        & score
        & statistic
        & (scores.joint == "all")
        & (scores.horizon_s.isna() if machine.held else scores.horizon_s == JUDGED)
        & (scores.fold.astype(str) == "all")
    ]
    recipe = (" (" + rows.fit + ")").where(~rows.identifier.isin(["none", *machine.published]), "")
    value = rows.set_index(rows.identifier + recipe).value
    return value[~value.index.duplicated()]


def table_of(rows: Sequence[Row]) -> str:
    """The table as Markdown, with the median and the worst regret at its end."""
    head = ("machine", "judged on", "chosen", "error", "over published", "best", "regret")
    lines = [f"| {' | '.join(head)} | beyond Coulomb and viscous | time |"]
    lines.append("| --- | --- | --- | ---: | ---: | --- | ---: | --- | ---: |")
    for r in rows:
        over = "" if np.isnan(r.over) else f"{r.over:.2f}"
        lines.append(
            f"| {r.machine} | {r.judged} | {r.chosen} | {r.error:.3g} | {over} | {r.best} | "
            f"{r.regret:.2f} | {r.needs} | {r.seconds:.0f} s |"
        )
    regret = [r.regret for r in rows]
    for word, value in (("median", np.median(regret)), ("worst", max(regret))):
        lines.append(f"| {word} | | | | | | {value:.2f} | | |")
    return "\n".join(lines)


def main(machines: list[str] | None = None, *, out: Path | None = None, jobs: int = 0) -> None:
    """Run all machines, or some, and print the table of all that are finished.

    Parameters
    ----------
    machines : Names of machines [all].
    out : Page whose table is replaced.
    jobs : Tasks side by side; 0: one per core.
    """
    if unknown := set(machines or ()) - set(MACHINES):
        raise SystemExit(f"{', '.join(sorted(unknown))}: there are {', '.join(MACHINES)}")
    for name in machines or MACHINES:
        print(name, flush=True)
        try:
            run(MACHINES[name], jobs)
        except InputError as error:  # the others may be as they should
            print(f"  {error}", flush=True)
    finished = [m for m in MACHINES.values() if (REPORT / m.name / "verdict.json").exists()]
    table = table_of([row for machine in finished for row in rows_of(machine)])
    print(table)
    if out is not None:
        before, _, after = out.read_text(encoding="utf-8").partition("\n| machine |")
        rest = after.partition("\n\n")[2]
        out.write_text(f"{before}\n{table}\n\n{rest}", encoding="utf-8")


if __name__ == "__main__":
    call(main)
