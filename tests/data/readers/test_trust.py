"""Data sets from others are data: what they name runs only where the user trusts them."""

import sys

import pytest
from fixtures.command_line import run_command
from fixtures.own_reader import read_by

from frictionid.data.readers import reader_names
from frictionid.data.readers.emps import read_emps
from frictionid.errors import InputError

EVIL = """
from pathlib import Path

Path(__file__).with_name("imported").touch()

def read(path, settings):
    Path(__file__).with_name("run").touch()
"""
COMMANDS = (["check", "."], ["fit", ".", "--identifier", "none", "--out", "m"])
KINDS = ("evil:read", "runpy:run_path", "joblib:load", "subprocess:Popen", "os:system")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "words", [["check", "."], ["fit", ".", "--identifier", "none", "--out", "m"]]
)
def test_a_data_set_runs_no_code(tmp_path, monkeypatch, capsys, kind, words):
    (tmp_path / "evil.py").write_text(EVIL)
    with pytest.raises(InputError, match="is code, which runs with your rights"):
        read_by(tmp_path, {"kind": kind}, trust=False)
    before = {path.name for path in tmp_path.iterdir()}
    code, out, err = run_command(monkeypatch, capsys, tmp_path, *words)
    assert (code, out) == (2, "") and f"{kind!r} is code" in err and "give --trust" in err
    assert {path.name for path in tmp_path.iterdir()} == before
    assert "evil" not in sys.modules


def test_a_reader_that_is_trusted_runs(tmp_path, monkeypatch, capsys):
    read_by(tmp_path, {"kind": "my_readers:read", "scale": 0.01, "rate": 10.0})
    code, _, err = run_command(monkeypatch, capsys, tmp_path, "check", ".", "--trust")
    assert "is code" not in err and code in (0, 1, 2)


def test_an_installed_package_offers_readers_by_name(tmp_path, monkeypatch):
    class Point:
        name = "mylab"

        def load(self):
            return read_emps

    monkeypatch.setattr(reader_names, "entry_points", lambda **_: [Point()])
    assert reader_names.reader_of("emps", tmp_path) is read_emps
    with pytest.raises(InputError, match=r"the reader 'mylab' failed|a\.log"):
        read_by(tmp_path, {"kind": "mylab"}, trust=False)
