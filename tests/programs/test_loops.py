"""Compiled loops are kept on disk, and compiled again when the package has changed."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from frictionid.programs import loops as compiled

SOURCE = """
from frictionid.programs.loops import compiled

@compiled
def doubled(x):
    return 2.0 * x
"""


@pytest.mark.parametrize(("changed", "left"), [(0.0, 1), (float("inf"), 0)])
def test_what_was_kept_before_a_change_is_forgotten(
    changed: float, left: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"loops_of_a_test_{left}"
    (tmp_path / f"{name}.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert importlib.import_module(name).doubled(1.5) == 3.0
    assert len(list(tmp_path.rglob("*.nbi"))) == 1
    monkeypatch.setattr(compiled, "_newest_source", lambda: changed)
    del sys.modules[name]
    again = importlib.import_module(name)
    assert len(list(tmp_path.rglob("*.nbi"))) == left
    assert again.doubled(1.5) == 3.0
