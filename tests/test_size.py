"""Budgets that only fall: tokens, files, classes, words of the documentation, a reading path.

Raising one is a decision that a commit message explains.
"""

import ast
import re

from fixtures.paths import ROOT
from fixtures.source import docstring_of, lines_of, nodes_of, token_lines

PACKAGE = ROOT / "frictionid"
BUDGET = {
    "tokens": 566_800,
    "files": 340,
    "classes": 523,
    "tokens of tests": 416_540,
    "words": 27_959,
}
NAMES = 69


def tokens(path):
    """Number of Python's tokens, without comments, line ends and docstrings."""
    silent = set().union(*(lines_of(docstring_of(node)) for node in nodes_of(path)))
    return sum(line not in silent for line, _ in token_lines(path))


def test_all_stays_within_its_budget():
    """What is printed replaces the numbers of the budget."""
    files = list(PACKAGE.rglob("*.py"))
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    size = {
        "tokens": sum(map(tokens, files)),
        "files": len(files),
        "classes": sum(isinstance(n, ast.ClassDef) for file in files for n in nodes_of(file)),
        "tokens of tests": sum(map(tokens, (ROOT / "tests").rglob("*.py"))),
        "words": sum(len(page.read_text(encoding="utf-8").split()) for page in pages),
    }
    above = {what: n for what, n in size.items() if n > BUDGET[what]}
    assert not above, "\n".join(f'"{what}": {n:_},' for what, n in size.items())


def test_few_names_are_public():
    text = (PACKAGE / "__init__.py").read_text()
    assert len(set(re.findall(r"\bimport \w+ as (\w+)", text))) <= NAMES


def test_a_mechanism_leads_to_a_cross_validated_fit_in_a_dozen_files():
    page = (ROOT / "docs/rooms.md").read_text()
    path = [PACKAGE / name for name in re.findall(r"^\d+\. `([\w/]+\.py)`", page, re.M)]
    assert 0 < len(path) <= 12
    assert sum(len(file.read_text().splitlines()) for file in path) <= 1600
