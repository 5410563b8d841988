"""Budgets that only fall: tokens, files, classes, words of the documentation, a reading path.

Raising one is a decision that a commit message explains.
"""

import ast
import io
import re
import tokenize

from fixtures.paths import ROOT

PACKAGE = ROOT / "frictionid"
TOKENS, FILES, CLASSES, NAMES = 530_500, 467, 580, 70
TEST_TOKENS, WORDS = 426_300, 32_400
SILENT = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.ENCODING, tokenize.ENDMARKER),
}


def documented(tree):
    """Lines that docstrings cover."""
    covered = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and node.body:
            first = node.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                covered |= set(range(first.lineno, first.end_lineno + 1))
    return covered


def tokens(path):
    """Number of Python's tokens, without comments, line ends and docstrings."""
    text = path.read_text(encoding="utf-8")
    silent = documented(ast.parse(text))
    read = tokenize.generate_tokens(io.StringIO(text).readline)
    return sum(t.type not in SILENT and t.start[0] not in silent for t in read)


def test_the_package_stays_within_its_budget():
    files = list(PACKAGE.rglob("*.py"))
    classes = sum(
        isinstance(node, ast.ClassDef) for f in files for node in ast.walk(ast.parse(f.read_text()))
    )
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
    page = (ROOT / "docs" / "rooms.md").read_text()
    path = [PACKAGE / name for name in re.findall(r"^\d+\. `([\w/]+\.py)`", page, re.M)]
    assert 0 < len(path) <= 12
    assert sum(len(file.read_text().splitlines()) for file in path) <= 1600
