"""A comparison on a Dask cluster: the numbers are those of one process, whatever dies."""

import os
import sys
import time

import pytest
from distributed import Client
from fixtures.cluster import Cluster
from fixtures.mistakes import changes
from fixtures.refusals import assert_one_line, assert_refused
from fixtures.shared import shared
from fixtures.tiny_pendulums import FEW, QUICK, compare_into, stamps, write_dataset, write_suite

from frictionid.comparison import cluster as clusters
from frictionid.comparison.cluster import check_equal, on_cluster

OWN = """
import os
from dataclasses import dataclass
from pathlib import Path
from signal import SIGKILL
from time import sleep
from frictionid.friction.laws import CoulombViscous
from frictionid import Identifier
from frictionid.fitting.identifiers import LeastSquares

@dataclass(frozen=True)
class Killer(Identifier):
    file: str = ""
    seconds: float = 0.0
    def fit(self, problem, weights, seed):
        sleep(self.seconds)
        if self.file and Path(self.file).exists():
            process = int(Path(self.file).read_text()) or os.getpid()
            Path(self.file).unlink()
            os.kill(process, SIGKILL)
            sleep(30 * (process != os.getpid()))
        return LeastSquares(CoulombViscous()).fit(problem, weights, seed)
"""
KIND = "own_part:Killer"


@shared
def cluster(tmp_path_factory):
    """A scheduler, at first without workers."""
    made = Cluster(tmp_path_factory.mktemp("cluster"))
    yield made
    made.close()


@pytest.fixture
def working(cluster):
    """The scheduler with two workers, whatever ran before."""
    for _ in range(2 - sum(worker.is_alive() for worker in cluster.workers)):
        cluster.add_worker()
    with Client(cluster.address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
    return cluster


@shared
def place(tmp_path_factory):
    """A folder with a suite of own identifiers, one of which kills, and what it gives serially."""
    folder = tmp_path_factory.mktemp("suite")
    (folder / "own_part.py").write_text(OWN)
    own = [{"kind": KIND, "name": f"slow{i}", "seconds": 0.3 + 0.01 * i} for i in range(4)]
    own.insert(1, {"kind": KIND, "name": "killer", "file": str(folder / "kill")})
    write_dataset(folder / "tiny", changes=FEW)
    write_suite(folder, {**changes(QUICK), "identifiers": [{"kind": "none"}, *own]})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [*sys.path, str(folder)])
        compare_into(folder / "suite.toml", folder / "serial")
        yield folder


@pytest.fixture
def complaint(place, run):
    """What a comparison with these options comes to."""

    def call(*options):
        return run(place, "compare suite.toml --trust --out no", *options)

    return call


def assert_same_scores(folder, other):
    assert (folder / "scores.csv").read_bytes() == (other / "scores.csv").read_bytes()
    models = sorted(path.name for path in (other / "models").iterdir())
    assert sorted(path.name for path in (folder / "models").iterdir()) == models
    for name in models:
        assert (folder / "models" / name).read_bytes() == (other / "models" / name).read_bytes()


# --- Mistakes -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "address, line",
    [
        ("127.0.0.1:1", "127.0.0.1:1: no Dask scheduler answers there (Timed out"),
        ("nonsense", "'nonsense' is no address of a scheduler: it is like tcp://10.0.0.1:8786"),
        ("http://a:1/b", "'http://a:1/b' is no address of a scheduler"),
    ],
)
def test_a_wrong_address_is_one_line(monkeypatch, complaint, address, line):
    monkeypatch.setattr(clusters, "ANSWER", 0.5)
    assert_one_line(complaint("--dask", address), f"frictionid: {line}")


def test_dask_that_is_not_installed_is_one_line(monkeypatch, complaint):
    monkeypatch.delitem(sys.modules, "frictionid.comparison.cluster")
    monkeypatch.setitem(sys.modules, "distributed", None)
    said = "frictionid: distributed is not installed: pip install 'frictionid[dask]'\n"
    assert_one_line(complaint("--dask", "127.0.0.1:1"), said)


def test_jobs_are_for_one_computer(complaint):
    outcome = complaint("--dask", "127.0.0.1:1", "--jobs", "2")
    assert_one_line(outcome, "--dask for a cluster: give one of them\n")


def test_a_scheduler_without_workers_is_one_line(cluster, monkeypatch, complaint):
    monkeypatch.setattr(clusters, "FIRST_WORKER", 0.5)
    said = f"the scheduler has no workers: start some with `dask worker {cluster.address}"
    assert_one_line(complaint("--dask", cluster.address), said)


def test_workers_that_would_find_other_numbers_are_refused():
    found = {"numpy": "2.0", "threads": "1"}
    check_equal(found, {"numpy": "2.0"}, "worker a")
    with assert_refused("worker a: numpy is 2.0 there and 2.1 here: install"):
        check_equal(found, {"numpy": "2.1"}, "worker a")
    with assert_refused("worker a: torch is missing there and 2.0 here"):
        check_equal(found, {"torch": "2.0"}, "worker a")
    with assert_refused("worker a: has 4 threads, .* with --nthreads 1"):
        check_equal({**found, "threads": "4"}, {"numpy": "2.0"}, "worker a")


# --- On a scheduler with two worker processes -----------------------------------------------------


def test_two_workers_share_the_work(working):
    processes = dict(on_cluster(slept, [(None, 0.2)] * 6, working.address))
    assert sorted(processes) == [*range(6)]
    assert set(processes.values()) == {worker.pid for worker in working.workers}


def test_a_data_set_that_fails_does_not_stop_the_others(working, place, capsys):
    from many import main as many

    gone = [place / name for name in ("gone", "lost")]
    with pytest.raises(SystemExit, match="1"):
        many(working.address, place / "suite.toml", gone, trust=True, out=place / "many")
    lines = sorted(capsys.readouterr().out.splitlines())
    for folder, line in zip(gone, lines, strict=True):
        assert (
            line.startswith(f"{folder.name}: InputError: ") and f"{folder}, does not exist" in line
        )


def slept(_, seconds):
    time.sleep(seconds)
    return os.getpid()


def test_workers_give_the_numbers_of_one_process_though_one_is_killed(working, place):
    (place / "kill").write_text("0")  # itself
    compare_into(place / "suite.toml", place / "killed", dask=working.address)
    assert not (place / "kill").exists()
    ended = [worker.exitcode for worker in working.workers]
    assert sorted(ended, key=str) == [-9, None]
    assert_same_scores(place / "killed", place / "serial")


def test_a_dead_scheduler_is_one_line_and_the_comparison_is_resumed_without(working, place):
    (place / "kill").write_text(str(working.scheduler.pid))
    with assert_refused(r"the scheduler is gone: .* finish with --resume"):
        compare_into(place / "suite.toml", place / "resumed", dask=working.address)
    done = stamps(place / "resumed/unfinished")
    compare_into(place / "suite.toml", place / "resumed", resume=True)
    assert done.items() <= stamps(place / "resumed").items()
    assert_same_scores(place / "resumed", place / "serial")
