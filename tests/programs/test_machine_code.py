"""Compiled loops are kept on disk, and compiled again when the package has changed."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core.dispatcher import Dispatcher

from frictionid.programs import machine_code as compiled
from frictionid.progress import compiling

SOURCE = """
from frictionid.programs.machine_code import compiled

@compiled
def doubled(x):
    return 2.0 * x
"""


@pytest.mark.parametrize(("changed", "left"), [(0.0, 1), (float("inf"), 0)])
def test_what_was_kept_before_a_change_is_forgotten_and_said_to_be_compiled(
    changed, left, tmp_path, monkeypatch
):
    name, said = f"loops_of_a_test_{left}", []
    (tmp_path / f"{name}.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(str(tmp_path))
    with compiling(said.append):
        assert importlib.import_module(name).doubled(1.5) == 3.0
        assert len(list(tmp_path.rglob("*.nbi"))) == 1
        monkeypatch.setattr(compiled, "_newest_source", lambda _: changed)
        del sys.modules[name]
        again = importlib.import_module(name)
        assert len(list(tmp_path.rglob("*.nbi"))) == left
        assert again.doubled(1.5) == 3.0
    assert said == ["doubled"] * (2 - left)


def test_loops_that_cannot_be_kept_are_used_all_the_same(tmp_path):
    """Where nothing can be written, not even beside their code."""
    (tmp_path / "loops_there.py").write_text(SOURCE)
    code = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (9, 9)); "
    code += "from loops_there import doubled; print(doubled(1.5))"
    run = [sys.executable, "-c", code]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "3.0\n"), done.stderr


def test_compiled_functions_call_those_of_their_room_only():
    package = Path(compiled.__file__).parents[1]
    files = [f for f in package.rglob("*.py") if "programs.machine_code import" in f.read_text()]
    names = [".".join(f.relative_to(package.parent).with_suffix("").parts) for f in files]
    for name in names:
        room = name.split(".")[1]
        for value in vars(importlib.import_module(name)).values():
            if isinstance(value, Dispatcher):
                assert compiled.room_of(value.py_func) in {room, "programs"}, name
    assert names
