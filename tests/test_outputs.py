"""Files are written over with --replace only, and never where they are read."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from fixtures.forked import contents
from fixtures.refusals import assert_refused

from frictionid.errors import InputError
from frictionid.files import read_json, remove_unfinished, write_bytes, write_text, written_beside
from frictionid.outputs import SUMS, check_outputs, check_writable, replace_files


def files_of(folder):
    """Content of the files of a result folder, without the list of them."""
    return contents(folder, SUMS)


# --- Files ----------------------------------------------------------------------------------------


def test_a_file_that_exists_is_written_over_with_replace_only(tmp_path):
    (tmp_path / "m.json").write_text("mine")
    with assert_refused(r"m\.json exists: choose another name, or --replace"):
        check_outputs([tmp_path / "m.json"])
    check_outputs([tmp_path / "m.json", tmp_path / "new/m.json", None], replace=True)
    assert contents(tmp_path) == {"m.json": b"mine"} and not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    "name", ["data/dataset.toml", "data/../data/a.csv", "hard.csv", "soft.csv"]
)
def test_what_is_read_is_never_written_over(tmp_path, name):
    (tmp_path / "data").mkdir()
    for file in ("dataset.toml", "a.csv"):
        (tmp_path / "data" / file).write_text(file)
    os.link(tmp_path / "data/a.csv", tmp_path / "hard.csv")
    (tmp_path / "soft.csv").symlink_to("data/a.csv")
    read = (tmp_path / "data", tmp_path / "data/a.csv", None)
    with assert_refused("belongs to what is read and is not overwritten"):
        check_outputs([tmp_path / name], read, replace=True)
    check_outputs([tmp_path / "data/new.json"], read)


def test_only_regular_files_are_replaced(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    os.mkfifo(tmp_path / "fifo")
    for path in (tmp_path / "link", tmp_path / "fifo", Path("/dev/null")):
        with assert_refused("is no regular file and is not replaced"):
            check_outputs([path], replace=True)
    with assert_refused("is a folder: name a file in it"):
        check_outputs([tmp_path], replace=True)


def test_two_outputs_of_one_name_are_refused(tmp_path):
    with assert_refused("is written by two options"):
        check_outputs([tmp_path / "a.png", tmp_path / "new/../a.png"])


@pytest.mark.parametrize("place", ["/proc/a", "file/a", "x" * 300, "/proc/1/a/b"])
def test_a_place_that_cannot_be_written_is_refused_before_the_work(tmp_path, place):
    (tmp_path / "file").write_text("")
    with assert_refused(r"cannot be written \(.*\): choose another"):
        check_writable(tmp_path / place)
    assert contents(tmp_path) == {"file": b""}


def test_files_have_the_permissions_that_the_user_asks_for(tmp_path):
    code = "import os, sys; os.umask(int(sys.argv[2], 8)); from pathlib import Path; "
    code += "from frictionid.files import write_text; write_text(Path(sys.argv[1]), 'x')"
    for umask, mode in (("077", 0o600), ("022", 0o644), ("002", 0o664)):
        path = tmp_path / umask
        subprocess.run([sys.executable, "-c", code, path, umask], check=True)
        assert path.stat().st_mode & 0o777 == mode


def test_names_as_long_as_the_disk_takes_them_are_written(tmp_path):
    name = "x" * 250 + ".json"
    write_text(tmp_path / name, "{}")
    assert read_json(tmp_path / name) == {}


@pytest.mark.parametrize(
    ("error", "refused", "words"),
    [
        (KeyboardInterrupt(), KeyboardInterrupt, "^$"),
        (OSError(28, "No space left"), InputError, r"cannot be written \(No space left\)"),
    ],
)
def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch, error, refused, words):
    """Whether writing fails, or the move of what was written."""
    path = tmp_path / "new/a.mp4"
    write_bytes(path, b"old")

    def fail(*_):
        raise error

    with pytest.raises(refused, match=words), written_beside(path) as beside:
        assert beside.suffix == ".mp4"
        beside.write_bytes(b"half")
        fail()
    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(refused, match=words):
        write_text(path, "second")
    assert contents(tmp_path) == {"new/a.mp4": b"old"}


def test_only_our_own_unfinished_files_are_removed(tmp_path):
    mine = (".config.settings", ".bashrc", "a.json")
    for name in (*mine, ".frictionid-ab12cd34.json"):
        (tmp_path / name).write_text(name)
    remove_unfinished(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(mine)


# --- Result folders -------------------------------------------------------------------------------


def test_own_files_are_made_anew_and_stale_ones_go(tmp_path):
    replace_files(tmp_path, {"a.md": b"1", "tables/b.csv": b"1", "old/c.csv": b"1"})
    (tmp_path / "tables/mine.csv").write_text("mine")
    replace_files(tmp_path, {"a.md": b"2", "d.md": b"2"})
    sums = contents(tmp_path).pop(SUMS).decode().splitlines()
    assert [line.split("  ")[1] for line in sums] == ["a.md", "d.md"]
    assert files_of(tmp_path) == {"a.md": b"2", "d.md": b"2", "tables/mine.csv": b"mine"}
    assert not (tmp_path / "old").exists()


def test_files_that_a_user_changed_or_brought_stay(tmp_path):
    replace_files(tmp_path, {"a.md": b"1", "b.md": b"1"})
    (tmp_path / "a.md").write_text("mine")
    (tmp_path / "c.md").write_text("mine")
    before = contents(tmp_path)
    for name in ("a.md", "c.md"):
        with assert_refused(rf"{re.escape(name)} was changed, or is none that was"):
            replace_files(tmp_path, {name: b"2", "b.md": b"2"})
        assert contents(tmp_path) == before
    replace_files(tmp_path, {"b.md": b"2"})  # a.md is no longer written: it is the user's
    assert contents(tmp_path)["a.md"] == b"mine"
    replace_files(tmp_path, {"a.md": b"3", "c.md": b"3"}, replace=True)
    assert files_of(tmp_path) == {"a.md": b"3", "c.md": b"3"}


def test_no_link_is_followed(tmp_path):
    folder, other = tmp_path / "result", tmp_path / "other"
    replace_files(folder, {"figures/a.png": b"1", "b.md": b"1"})
    (folder / "figures").rename(other)
    (folder / "figures").symlink_to(other)
    before = contents(other)
    with assert_refused("figures is a link to another folder"):
        replace_files(folder, {"figures/a.png": b"2"}, replace=True)
    replace_files(folder, {"b.md": b"2"})  # the stale picture is behind the link
    assert contents(other) == before
    (folder / "b.md").unlink()
    (folder / "b.md").symlink_to(other / "a.png")
    with assert_refused(r"b\.md was changed"):
        replace_files(folder, {"b.md": b"3"})
    replace_files(folder, {"b.md": b"3"}, replace=True)
    assert contents(other) == before and (folder / "b.md").read_bytes() == b"3"


def test_a_list_that_points_elsewhere_removes_nothing(tmp_path):
    (tmp_path / "mine").write_text("1")
    sums = "".join(
        f"6b86b273ff34fce19d6b804eff5a3f5747ada4eaa22f1d49c01e52ddb7875b4b  {name}\n"
        for name in ("../mine", str(tmp_path / "mine"), "")
    )
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / SUMS).write_text(sums)
    replace_files(tmp_path / "result", {"a.md": b"1"})
    assert (tmp_path / "mine").read_text() == "1"


@pytest.mark.parametrize("after", range(6))
def test_wherever_it_is_killed_the_files_are_known_as_ours(tmp_path, monkeypatch, after):
    replace_files(tmp_path, {"a.md": b"1", "b.md": b"1"})
    moves, real = [], os.replace

    def killed(*paths):
        moves.append(paths)
        if len(moves) > after:
            raise KeyboardInterrupt
        real(*paths)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(os, "replace", killed)
        replace_files(tmp_path, {"a.md": b"2", "b.md": b"2"})
    replace_files(tmp_path, {"a.md": b"2", "b.md": b"2"})
    assert files_of(tmp_path) == {"a.md": b"2", "b.md": b"2"}


def test_a_full_disk_leaves_the_earlier_files(tmp_path):
    code = """
import resource, sys
from pathlib import Path
from frictionid.outputs import replace_files
from frictionid.errors import InputError
folder = Path(sys.argv[1])
replace_files(folder, {"a.md": b"1", "b.md": b"1"})
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    replace_files(folder, {"a.md": b"2", "b.md": b"2" * 2000})
except InputError as error:
    print(error)
"""
    ran = subprocess.run([sys.executable, "-c", code, tmp_path], capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert "cannot be written (File too large)" in ran.stdout
    assert files_of(tmp_path) == {"a.md": b"1", "b.md": b"1"}
