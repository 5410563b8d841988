"""A comparison of every data set of many, each one job of a Dask cluster.

python comparisons/many.py ADDRESS SUITE FOLDER... [--out results]   one job per folder of tables
python comparisons/many.py --stubs 10000 [--workers 2] [--sleep 0]   what jobs cost the scheduler
python comparisons/many.py --speed-up SUITE [--workers 2]            tasks of one suite, on 1 and 2

A job is `frictionid compare SUITE --data FOLDER --out results/FOLDER --resume` within a worker,
which sees suite, tables and results under the paths of this computer. Called again, it finishes
what was interrupted. Stubs sleep, at most; for them and the speed-up processes are started here.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from distributed import Client
from script import call

from frictionid.api.suites import run_suite
from frictionid.comparison.cluster import on_cluster
from frictionid.comparison.suite import load_suite, tasks_of
from frictionid.comparison.tasks import prepare_benchmarks, results_of


def main(
    address: str = "",
    suite: Path | None = None,
    folders: list[Path] | None = None,
    *,
    out: Path = Path("results"),
    trust: bool = False,
    stubs: int = 0,
    sleep: float = 0.0,
    speed_up: Path | None = None,
    workers: int = 2,
) -> None:
    """Compare every data set; exit status 1 where a job failed.

    Parameters
    ----------
    trust : Run code that the suite names.
    sleep : Seconds of each stub.
    """
    if stubs:
        _simulate(stubs, workers, sleep)
    elif speed_up:
        _speed_up(speed_up, workers)
    elif not (suite and folders):
        raise SystemExit("name the scheduler's address, a suite, and folders of tables")
    elif not _compare(address, suite, folders, out, trust=trust):
        raise SystemExit(1)


def _compare(address: str, suite: Path, folders: Sequence[Path], out: Path, *, trust: bool) -> bool:
    """Run one job per folder, and say how each ended; whether all ended well."""
    places = [(folder.resolve(), (out / folder.name).resolve()) for folder in folders]
    calls = [(suite.resolve(), *place, trust) for place in places]
    failed = 0
    for i, (done, said) in on_cluster(compared, calls, address):
        failed += not done
        print(f"{folders[i].name}: {said}", flush=True)
    return not failed


def compared(suite: Path, folder: Path, out: Path, trust: bool) -> tuple[bool, str]:
    """The verdict on one data set, or why there is none; on a worker."""
    try:
        done = run_suite(suite, data=folder, out=out, jobs=1, resume=True, trust=trust)
        return True, done.verdict.sentence
    except Exception as error:  # one data set does not stop the others
        return False, f"{type(error).__name__}: {error}"


# --- What it costs --------------------------------------------------------------------------------


def _simulate(count: int, workers: int, sleep: float) -> None:
    """Print what so many jobs that compute nothing cost the scheduler, this process and workers."""
    with _cluster(workers) as client:
        address = client.scheduler.address
        before, own = client.run_on_scheduler(_load), _load()
        calls = [(sleep, Path(f"data/set{i:05}"), Path(f"results/{i:05}")) for i in range(count)]
        begin = time.perf_counter()
        done = sum(said == (True, f"set{i:05}") for i, said in on_cluster(stub, calls, address))
        seconds = time.perf_counter() - begin
        after, used = client.run_on_scheduler(_load), _load()
        each = client.run(_load)
    print(f"{done} of {count} stub jobs on {workers} workers in {seconds:.1f} s: ", end="")
    print(f"{count / seconds:.1f} jobs per second, {sleep * count / seconds:.2f} workers busy")
    for name, last, first in (("scheduler", after, before), ("this process", used, own)):
        spent, grown = last.seconds - first.seconds, last.memory - first.memory
        print(
            f"{name}: {1e3 * spent / count:.2f} ms of a processor per job; "
            f"{last.memory / 1e6:.0f} MB at most, {grown / count / 1e3:.1f} kB per job"
        )
    print("workers:", ", ".join(f"{load.memory / 1e6:.0f} MB" for load in each.values()))


def stub(seconds: float, folder: Path, out: Path) -> tuple[bool, str]:
    """A job that computes nothing, but may sleep; it has the arguments of one that compares."""
    time.sleep(seconds)
    return out.name in folder.name, folder.name


def _speed_up(file: Path, workers: int) -> None:
    """Print how much sooner the tasks of a suite are done, and how even their work is shared."""
    tasks = tasks_of(load_suite(file), file)
    prepared = prepare_benchmarks(tasks)
    walls = []
    for count in (1, workers):
        with _cluster(count) as client:
            before, begin = client.run(_load), time.perf_counter()
            found = list(results_of(tasks, prepared, dask=client.scheduler.address))
            walls.append(time.perf_counter() - begin)
            each = [load.seconds - before[key].seconds for key, load in client.run(_load).items()]
        shares = ", ".join(f"{seconds:.1f}" for seconds in each)
        print(
            f"{len(found)} tasks on {count} workers: {walls[-1]:.1f} s; processor time {shares} s"
        )
    print(f"speed-up {walls[0] / walls[1]:.2f}; by processor time {sum(each) / max(each):.2f}")


class Load(NamedTuple):
    """What a process has used: processor time [s], and the most memory that it held [bytes]."""

    seconds: float
    memory: float


def _load() -> Load:
    # not ru_maxrss, which begins with that of the process that started this one
    status = dict(line.split(":") for line in Path("/proc/self/status").read_text().splitlines())
    return Load(time.process_time(), 1024.0 * int(status["VmHWM"].split()[0]))


@contextmanager
def _cluster(workers: int) -> Iterator[Client]:
    """A client of a scheduler process with worker processes that have imported what they need."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scheduler.json"
        dask, kept = [sys.executable, "-m", "dask"], ["--scheduler-file", str(file)]
        own = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", folder]
        local = ["--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0"]
        commands = [[*dask, "scheduler", *kept, *local]] + [
            [*dask, "worker", *kept, *own]
        ] * workers
        made = [subprocess.Popen(words, stderr=subprocess.DEVNULL) for words in commands]
        try:
            while not file.exists() or not file.read_text().endswith("}"):
                time.sleep(0.05)
            address = json.loads(file.read_text())["address"]
            with Client(address, set_as_default=False) as client:
                client.wait_for_workers(workers, timeout=60)
                for _ in on_cluster(stub, [(0.0, Path(), Path())] * 4 * workers, address):
                    pass
                yield client
        finally:
            for process in made:
                process.kill()
                process.wait()


if __name__ == "__main__":
    call(main)
