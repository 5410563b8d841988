"""The page about use: every line of Python gives what the page shows."""

import doctest

from fixtures.paths import ROOT


def test_every_line_of_the_page_gives_what_it_shows():
    found = doctest.testfile(str(ROOT / "docs" / "use.md"), module_relative=False)
    assert found.attempted > 10 and found.failed == 0
