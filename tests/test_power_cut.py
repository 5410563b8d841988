"""A power cut loses nothing that was synced, and takes nothing torn for a result."""

import json
import os
import re
import time

import numpy as np
import pytest
from fixtures.drive_ports import setup
from fixtures.power_cut import Change, Recorder, torn, write_files
from fixtures.refusals import assert_refused
from fixtures.tiny_pendulums import FEW, QUICK, compare_into, write_dataset, write_suite
from numpy.random import default_rng

from frictionid.comparison.results import load_results
from frictionid.errors import InputError
from frictionid.rig import logfile
from frictionid.rig.logfile import Appender, log_header, log_row, read_log

CUTS, SEED = 60, 21


def scores(folder):
    """Rows of each task without times, and what is said of the data, as a folder is read."""
    results = load_results(folder)
    rows = {d["identifier"]: json.dumps(d["rows"]) for d in results.tasks}
    return {**rows, "datasets": json.dumps(results.datasets)}


@pytest.fixture(scope="module")
def comparison(tmp_path_factory):
    """A comparison over the result of other data, what it does to the disk, and both results."""
    place = tmp_path_factory.mktemp("cut")
    file, out = write_suite(place, f'{QUICK}; datasets.0.path = "mine"'), place / "out"
    write_dataset(place / "mine", changes=FEW)
    compare_into(file, out)
    old = scores(out)
    table = place / "mine/dataset.toml"
    table.write_text(table.read_text().replace("mass = 0.2", "mass = 0.21"))
    with pytest.MonkeyPatch.context() as patch:
        disk = Recorder(out, patch)
        compare_into(file, out)
        disk.stop()
    new = scores(out)
    assert all(new[key] != old[key] for key in old)
    return file, out, disk, (old, new)


def reported(events):
    """Contents of the task files that were written and whose folder was synced since."""
    done, written = set(), set()
    for event in events:
        if isinstance(event, Change):
            if event.target and event.target.parent.match("unfinished/tasks"):
                written.add(event.content)
        elif event.match("unfinished/tasks"):
            done |= written
    return done


def test_a_cut_at_any_moment_leaves_results_of_one_comparison_or_says_what_is_torn(comparison):
    _, out, disk, both = comparison
    rng, said, lasting = default_rng(SEED), 0, 0
    for cut in np.linspace(0, len(disk.events), CUTS).astype(int):
        files = disk.cut(cut, rng)
        done = reported(disk.events[:cut])
        assert done <= set(files.values())  # what was reported is on the disk
        lasting += len(done)
        write_files(out, files)
        try:
            found = scores(out)
        except InputError as error:
            said += 1
            assert "no finished task" in str(error) or "--resume" in str(error), error
            continue
        assert any(found.items() <= whole.items() for whole in both)
    assert said < CUTS / 4 and lasting > CUTS


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8, 1.0])
def test_after_a_cut_a_comparison_is_resumed_to_the_same_scores(comparison, share):
    file, out, disk, (_, new) = comparison
    rng = default_rng(SEED)
    write_files(out, disk.cut(round(share * len(disk.events)), rng))
    # what the pictures and tables of people have lost is theirs to give up
    compare_into(file, out, resume=True, replace=True)
    assert scores(out) == new
    assert (out / "scores.csv").read_bytes() == disk.after[out / "scores.csv"]


@pytest.mark.parametrize("damage", ["empty", "zero", "cut", "tail"])
def test_a_task_file_that_was_not_synced_is_no_result(comparison, damage):
    """As on a disk that ignores the sync."""
    file, out, disk, (_, new) = comparison
    write_files(out, disk.after)
    path = sorted((out / "tasks").glob("*coulomb*.json"))[0]
    whole = path.read_bytes()
    half = len(whole) // 2
    held = {
        "empty": b"",
        "zero": bytes(len(whole)),
        "cut": whole[:half],
        "tail": whole[:half] + bytes(len(whole) - half),
    }
    path.write_bytes(held[damage])
    with assert_refused(re.escape(str(path)) + r".*with --resume"):
        load_results(out)
    compare_into(file, out, resume=True)
    assert scores(out) == new
    assert (out / "scores.csv").read_bytes() == disk.after[out / "scores.csv"]


# --- The log of a drive ---------------------------------------------------------------------------


def test_a_log_keeps_its_synced_rows_and_shows_none_that_never_was(tmp_path, monkeypatch):
    monkeypatch.setattr(logfile, "_SYNC", 0.002)
    made, path, sizes = setup(), tmp_path / "log.csv", [0]
    header = log_header(made)
    real = os.fdatasync

    def sync(handle):
        size = os.fstat(handle).st_size
        real(handle)
        sizes.append(size)

    monkeypatch.setattr(os, "fdatasync", sync)
    file = Appender(path, header)
    for first in range(0, 900, 30):
        file.append([row(made, k) for k in range(first, first + 30)])
        time.sleep(0.001)
    whole, synced = path.read_bytes(), sizes[-1]
    file.close()
    assert 0 < synced
    rng, holes = default_rng(SEED), 0
    for size in rng.choice(sizes, 200):
        held = torn(whole, rng, int(size))
        holes += b"\0" in held
        path.write_bytes(held)
        safe = max(held[:size].count(b"\n") - 1, 0)
        if held.count(b"\n") < 2 or not held.startswith(header.encode()):
            continue
        time_ = read_log(path).columns["time"]
        assert time_[:safe].tolist() == list(range(safe))
        assert np.all(np.diff(time_) > 0) and set(time_) <= set(range(900))
        again = Appender(path, header, append=True)
        again.append([row(made, 1000)])
        again.close()
        assert read_log(path).columns["time"].tolist() == [*time_, 1000]
    assert holes > 50


def row(made, second):
    return log_row(made, f"{second}.000000", (str(second * 10**6).encode(), b"0.1", b"0.25"))
