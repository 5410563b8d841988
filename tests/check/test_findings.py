"""The table of findings: its rows are those that checks make, and their sentences are whole."""

import ast
from string import Formatter

import pytest
from fixtures.paths import ROOT

from frictionid.check.findings import LEVELS, finding, table

CODES = {
    node.value
    for path in (ROOT / "frictionid/check").glob("*.py")
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    if isinstance(node, ast.Constant) and isinstance(node.value, str)
}


def test_every_row_is_made_by_a_check():
    assert table().keys() <= CODES


@pytest.mark.parametrize("code", table())
def test_a_row_has_a_level_and_a_sentence_with_its_figures(code):
    row = table()[code]
    assert row["level"] in LEVELS and row["text"]
    names = {name for _, name, *_ in Formatter().parse(row["text"] + row.get("remedy", "")) if name}
    words = names & {"digits", "recording", "sentence", "remedy"}
    values = dict.fromkeys(names - words, 0.25) | {"digits": 1} | dict.fromkeys(words, "this")
    made = finding(code, {}, values, 2)
    assert made.joint == 2 and made.level == row["level"]
    assert "{" not in made.text + made.remedy
