"""The page about export: every line of Python gives what the page shows."""

import doctest

import pytest
from fixtures.paths import ROOT


@pytest.mark.parametrize(("name", "lines"), [("export", 20), ("machine_cards", 2)])
def test_every_line_of_the_page_gives_what_it_shows(name, lines, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    flags = doctest.NORMALIZE_WHITESPACE
    page = str(ROOT / "docs" / f"{name}.md")
    found = doctest.testfile(page, module_relative=False, optionflags=flags)
    assert found.attempted > lines and found.failed == 0
