"""The files of a report: what a build replaces, and what it never touches."""

import pytest
from fixtures import result_folders as made
from fixtures.refusals import assert_refused

from frictionid.comparison.results import load_results
from frictionid.outputs import replace_files
from frictionid.report import build

OTHERS = ("provenance.json", "datasets.json", "SHA256SUMS")  # that a report does not write itself


@pytest.fixture
def folder(tmp_path):
    """A small report."""
    return made.blank(tmp_path / "folder", [made.task("a", 1, 1)])


def test_a_build_leaves_no_file_of_an_earlier_one(folder):
    before = made.contents(folder)
    places = ("tables/summary--gone.csv", "figures/curves--gone.png", "models/gone.json")
    gone = dict.fromkeys(places, b"old")
    everything = {name: content for name, content in before.items() if name not in OTHERS}
    replace_files(folder, {**everything, **gone})
    assert made.contents(folder).keys() == before.keys() | gone.keys()
    made.blank(folder)
    assert made.contents(folder) == before


def test_what_is_not_of_the_report_is_never_touched(folder, monkeypatch):
    before = made.contents(folder)
    (folder / "figures/mine.png").write_text("mine")
    (folder / "notes.md").write_text("mine")
    made.blank(folder)
    mine = {"figures/mine.png": b"mine", "notes.md": b"mine"}
    assert made.contents(folder) == before | mine
    (folder / "summary.md").write_text("my own words")
    with assert_refused(r"summary\.md was changed.*--replace"):
        made.blank(folder)
    assert made.contents(folder) == before | mine | {"summary.md": b"my own words"}
    made.leave_blank(monkeypatch)
    build(load_results(folder), replace=True)
    assert made.contents(folder) == before | mine
