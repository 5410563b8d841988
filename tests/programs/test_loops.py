"""Compiled loops are kept on disk, and compiled again when the package has changed."""

import importlib
import sys
from pathlib import Path

import pytest
from numba.core.dispatcher import Dispatcher

from frictionid.programs import loops as compiled

SOURCE = """
from frictionid.programs.loops import compiled

@compiled
def doubled(x):
    return 2.0 * x
"""


@pytest.mark.parametrize(("changed", "left"), [(0.0, 1), (float("inf"), 0)])
def test_what_was_kept_before_a_change_is_forgotten(changed, left, tmp_path, monkeypatch):
    name = f"loops_of_a_test_{left}"
    (tmp_path / f"{name}.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert importlib.import_module(name).doubled(1.5) == 3.0
    assert len(list(tmp_path.rglob("*.nbi"))) == 1
    monkeypatch.setattr(compiled, "_newest_source", lambda _: changed)
    del sys.modules[name]
    again = importlib.import_module(name)
    assert len(list(tmp_path.rglob("*.nbi"))) == left
    assert again.doubled(1.5) == 3.0


def test_compiled_functions_call_those_of_their_room_only():
    package = Path(compiled.__file__).parents[1]
    files = [f for f in package.rglob("*.py") if "programs.loops import" in f.read_text()]
    names = [".".join(f.relative_to(package.parent).with_suffix("").parts) for f in files]
    for name in names:
        room = name.split(".")[1]
        for value in vars(importlib.import_module(name)).values():
            if isinstance(value, Dispatcher):
                assert compiled.room_of(value.py_func) in {room, "programs"}, name
    assert names
