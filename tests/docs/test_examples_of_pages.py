"""The pages whose examples are those of an interpreter: every line gives what the page shows."""

import doctest
import re

import pytest
from fixtures.paths import ROOT

LOOSE = doctest.NORMALIZE_WHITESPACE
PAGES = [
    ("use", 10, 0),
    ("export", 20, LOOSE),
    ("machine_cards", 2, LOOSE),
    ("mechanisms", 5, LOOSE),
]


@pytest.mark.parametrize("name, lines, flags", PAGES)
def test_every_line_of_the_page_gives_what_it_shows(name, lines, flags, tmp_path, monkeypatch):
    path = ROOT / f"docs/{name}.md"
    monkeypatch.chdir(ROOT if name == "mechanisms" else tmp_path)
    # a fence ends what an example prints, as an empty line would
    text = re.sub(r"^```.*$", "", path.read_text(), flags=re.MULTILINE)
    example = doctest.DocTestParser().get_doctest(text, {}, path.name, str(path), 0)
    said = []
    found = doctest.DocTestRunner(optionflags=flags).run(example, out=said.append)
    assert found.attempted > lines and found.failed == 0, "".join(said)
