"""The notebooks run from start to end without a warning, and show what is written in them."""

import json
import sys
from importlib import import_module

import pytest
from fixtures.paths import ROOT
from fixtures.printed import assert_alike

from frictionid import progress

NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_what_is_in_it(path, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "comparisons"))
    notebooks = import_module("notebooks")
    monkeypatch.delitem(sys.modules, "notebooks")
    notebook = json.loads(path.read_text(encoding="utf-8"))
    for cell, found in zip(notebooks.cells(notebook), notebooks.outputs(notebook), strict=True):
        assert [set(out.get("data", ())) for out in found] == [
            set(out.get("data", ())) for out in cell["outputs"]
        ]
        for now, written in zip(found, cell["outputs"], strict=True):
            assert_alike(text_of(now), text_of(written))


def text_of(output):
    return "".join(output.get("text") or output["data"]["text/plain"])


def test_a_notebook_shows_progress_and_leaves_nothing(monkeypatch):
    shown = []

    class Display:
        HTML = str

        def display(self, html, display_id):
            shown.append(html)
            return self

        def update(self, html):
            shown.append(html)

    monkeypatch.setattr(progress, "_in_notebook", lambda: True)
    monkeypatch.setitem(sys.modules, "IPython", Display())
    monkeypatch.setitem(sys.modules, "IPython.display", Display())
    with progress.counted(2, "laws") as step:
        step("a <b>")
    assert shown[1] == '<progress value="1" max="2"></progress> laws 1 of 2, a &lt;b&gt;'
    assert shown[-1] == ""
    with progress.counted(None, "fit"):
        progress.report_step("stage", 3)
    assert '<progress value="1" max="4"></progress> fit 1 of 4, stage' in shown
