"""The pages about Python: every block runs, and its last line gives what the page shows below."""

import ast
import contextlib
import io
import re
import shutil
import sys
import types

import pandas as pd
import pytest
from fixtures.paths import ROOT
from fixtures.printed import assert_alike

PAGES = [
    ROOT / "docs/python.md",
    ROOT / "docs/monitoring.md",
    ROOT / "docs/watching.md",
    *sorted((ROOT / "docs/python").glob("*.md")),
]


def blocks(text):
    """Code of each block of Python, and the text that the page shows below it, if any."""
    pattern = r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```)?"
    return re.findall(pattern, text, re.MULTILINE | re.DOTALL)


def shown(code, namespace, name):
    """What a notebook shows of a block: what it prints, and its last expression."""
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(tree, name, "exec"), namespace)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), name, "eval"), namespace)
            if value is not None:
                print(repr(value))
    return out.getvalue()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_of_the_page_runs(page, tmp_path, monkeypatch):
    (tmp_path / "arm").mkdir()
    for table in (ROOT / "docs/quickstart").glob("*.csv"):
        shutil.copy(table, tmp_path / "arm")
    monkeypatch.chdir(tmp_path)
    module = types.ModuleType("page")  # classes of the page are of a module that is there
    monkeypatch.setitem(sys.modules, "page", module)
    found = blocks(page.read_text(encoding="utf-8"))
    assert found
    with pd.option_context("display.width", 120, "display.max_columns", 20):
        for code, text in found:
            said = shown(code, module.__dict__, f"{page.name}")
            if text:
                assert_alike(said, text)
