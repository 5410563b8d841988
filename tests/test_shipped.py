"""Suites and data sets that come with the package have names; a file of one's own goes first."""

from pathlib import Path

import pytest
from fixtures.refusals import assert_refused

from frictionid.errors import InputError
from frictionid.files import dataset_path, shipped, shipped_names, suite_path


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_names_are_found_from_any_folder():
    for name in shipped_names("comparisons"):
        assert suite_path(Path(name)) == shipped("comparisons") / f"{name}.toml"
    for name in shipped_names("data"):
        assert dataset_path(Path(name)) == shipped("data") / name / "dataset.toml"


def test_own_files_go_before_names():
    Path("acrobot_clean").mkdir()
    with assert_refused("dataset.toml does not exist"):
        dataset_path(Path("acrobot_clean"))
    Path("acrobot").write_text("name = 'mine'")
    assert suite_path(Path("acrobot")) == Path("acrobot")


def test_a_folder_of_data_hides_no_suite():
    Path("acrobot").mkdir()
    assert suite_path(Path("acrobot")) == shipped("comparisons") / "acrobot.toml"


@pytest.mark.parametrize("path", ["./acrobat/x", "nowhere", "data/acrobot_clean", ".."])
def test_only_names_are_looked_up(path):
    with pytest.raises(InputError):
        dataset_path(Path(path))


def test_the_nearest_name_is_proposed():
    with assert_refused("did you mean acrobot"):
        suite_path(Path("acrobat"))
