"""Budgets that only fall: tokens, files, classes, words of the documentation, a reading path.

Raising one is a decision that a commit message explains.
"""

import ast
import re

from fixtures.paths import ROOT
from fixtures.source import docstring_of, lines_of, nodes_of, token_lines

PACKAGE = ROOT / "frictionid"
TOKENS, FILES, CLASSES, NAMES = 565_101, 346, 524, 69
TEST_TOKENS, WORDS = 414_231, 27_967


def tokens(path):
    """Number of Python's tokens, without comments, line ends and docstrings."""
    silent = set().union(*(lines_of(docstring_of(node)) for node in nodes_of(path)))
    return sum(line not in silent for line, _ in token_lines(path))


def test_the_package_stays_within_its_budget():
    files = list(PACKAGE.rglob("*.py"))
    classes = sum(isinstance(node, ast.ClassDef) for file in files for node in nodes_of(file))
    assert len(files) <= FILES and classes <= CLASSES
    assert sum(map(tokens, files)) <= TOKENS


def test_the_tests_stay_within_their_budget():
    assert sum(map(tokens, (ROOT / "tests").rglob("*.py"))) <= TEST_TOKENS


def test_the_documentation_stays_within_its_budget():
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    assert sum(len(page.read_text(encoding="utf-8").split()) for page in pages) <= WORDS


def test_few_names_are_public():
    text = (PACKAGE / "__init__.py").read_text()
    assert len(set(re.findall(r"\bimport \w+ as (\w+)", text))) <= NAMES


def test_a_mechanism_leads_to_a_cross_validated_fit_in_a_dozen_files():
    page = (ROOT / "docs/rooms.md").read_text()
    path = [PACKAGE / name for name in re.findall(r"^\d+\. `([\w/]+\.py)`", page, re.M)]
    assert 0 < len(path) <= 12
    assert sum(len(file.read_text().splitlines()) for file in path) <= 1600
