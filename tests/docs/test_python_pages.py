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

PAGES = [
    ROOT / "docs" / "python.md",
    ROOT / "docs" / "monitoring.md",
    *sorted((ROOT / "docs" / "python").glob("*.md")),
]
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
NEAR = {"rel": 0.3, "abs": 0.02}  # numbers of a fit differ a little from machine to machine


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


def assert_alike(found, page):
    """Check that every line of the page was shown, in its order, with numbers near its own."""
    lines = iter([line for line in found.splitlines() if line.strip()])
    for line in filter(str.strip, page.splitlines()):
        for own in lines:
            if plain(own) == plain(line):
                break
        else:
            raise AssertionError(f"{line!r} is on the page, but was not shown:\n{found}")
        numbers = [[float(x) for x in NUMBER.findall(text)] for text in (own, line)]
        assert numbers[0] == pytest.approx(numbers[1], **NEAR), (own, line)


def plain(line):
    """Words of a line, whatever its numbers and widths."""
    return " ".join(re.sub(r"─+", "-", NUMBER.sub("#", line)).split())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_of_the_page_runs(page, tmp_path, monkeypatch):
    (tmp_path / "arm").mkdir()
    for table in (ROOT / "docs" / "quickstart").glob("*.csv"):
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
