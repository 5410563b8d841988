"""A disk that is full in the middle: one line, exit status 2, and nothing half written."""

import resource
import sys

import pytest
from fixtures.damage_targets import TUTORIAL, Target, _acquisition, _results, _simulation
from fixtures.forked import contents, run_forked, say_into
from fixtures.result_folders import leave_blank
from fixtures.shared import shared
from fixtures.small_disk import NO_MOUNT, enlarge, on_small_disk
from fixtures.tiny_pendulums import compare_into

from frictionid.__main__ import main

ROOM = 3000  # [bytes] of a file, the most there is


@shared
def places(shared_path):
    """Folders of whole inputs by their names."""
    made = [*_simulation(shared_path), *_acquisition(shared_path), next(_results(shared_path))]
    assert TUTORIAL.exists() and all(isinstance(target, Target) for target in made)
    return {target.folder.name: target.folder for target in made}


CASES = """
film render set --camera camera.toml --out out
track track run.mov --out out/a.csv --overlay out/over.mp4
align align angles.csv log.csv --out out
film check set --out out
result report . --replace
compared compare suite.toml --out out --jobs 1
compared tune suite.toml --out tuned --jobs 1
"""


@pytest.mark.parametrize("case", CASES.strip().splitlines())
def test_a_full_disk_is_one_line_and_leaves_nothing_half_written(
    places, tmp_path, monkeypatch, case
):
    leave_blank(monkeypatch)
    name, *words = case.split()
    folder = places.get(name, places["result"].parent / name)
    before, limits = contents(folder), [(resource.RLIMIT_FSIZE, ROOM)]
    status, *_ = run_forked(folder, words, tmp_path / "said", limits)
    said = (tmp_path / "said").read_text()
    lines = [line for line in said.splitlines() if line.startswith("frictionid: ")]
    assert status == 2 and len(lines) == 1 and "Traceback" not in said, said
    assert "File too large" in lines[0] or "cannot be written as a whole" in lines[0]
    after = contents(folder)
    assert {n: c for n, c in after.items() if n in before} == before
    new = {n: c for n, c in after.items() if n not in before and "journal" not in n}
    assert all(len(content) < ROOM for content in new.values()), {n: len(c) for n, c in new.items()}
    assert not any(".frictionid-" in n or n.endswith((".mp4", ".mov")) for n in new)


@pytest.mark.parametrize("size, tasks", [(16 << 10, 0), (192 << 10, 3)])
def test_a_comparison_goes_on_once_there_is_space(places, tmp_path, monkeypatch, size, tasks):
    """On a file system that is full before the first task, and after the last."""
    folder, disk, said = places["result"].parent / "compared", tmp_path / "disk", tmp_path / "said"
    wanted = (places["result"] / "scores.csv").read_bytes()

    def work():
        say_into(said)
        monkeypatch.chdir(folder)
        out = disk / "out"
        words = "frictionid compare suite.toml --jobs 1 --out".split()
        monkeypatch.setattr(sys, "argv", [*words, str(out)])
        status = main()
        sys.stdout.flush()
        print(f"{len(list(out.glob('**/tasks/[!.]*.json')))} tasks", flush=True)
        enlarge(disk, 10**8)
        compare_into(folder / "suite.toml", out, resume=True)
        return status if (out / "scores.csv").read_bytes() == wanted else 1

    status = on_small_disk(disk, size, work)
    if status == NO_MOUNT:
        pytest.skip("this system lets nobody mount a file system")
    *done, refused, count = said.read_text().splitlines()
    assert status == 2 and count == f"{tasks} tasks"
    assert [line.split(" done: ")[0] for line in done] == [f"{k + 1} of 3" for k in range(tasks)]
    assert "cannot be written (No space left on device): make room, or" in refused
