"""The page about export: every line of Python gives what the page shows."""

import doctest

from fixtures.paths import ROOT


def test_every_line_of_the_page_gives_what_it_shows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    flags = doctest.NORMALIZE_WHITESPACE
    page = str(ROOT / "docs" / "export.md")
    found = doctest.testfile(page, module_relative=False, optionflags=flags)
    assert found.attempted > 20 and found.failed == 0
