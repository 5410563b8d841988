"""The pages: all are in the site, their links lead somewhere, and their cheap figures hold."""

import re
import sys
from importlib import import_module

import pandas as pd
import pytest
from fixtures.paths import ROOT

DOCS = ROOT / "docs"
MADE = {"index.md", "gallery.md"}  # by the site itself, of the README and of result folders
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
LINK = re.compile(r"\]\(([^)\s]+)\)")
FIGURES = re.compile(r"^\|(?! `).*\d\.\d.*$", re.MULTILINE)  # rows; of settings begin with a name
ROWS = 2  # of figures: fewer are an aside
COMMAND = re.compile(r"python comparisons/|frictionid [a-z]|make [a-z]|comparisons/\w+\.(py|toml)")
NUMBER = re.compile(r"\d+(?:\.\d+)?")


def anchors(path):
    """Anchors of a page's headings, as GitHub and the site make them."""
    heads = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


def test_the_site_has_every_page_once():
    listed = re.findall(r": (\S+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE)
    assert len(listed) == len(set(listed))
    assert set(listed) - MADE == {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_to_files_and_headings_that_exist(page):
    lost = []
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        place, _, anchor = link.partition("#")
        target = (page.parent / place).resolve() if place else page
        if "://" in link:
            continue
        if not target.exists() or (anchor and anchor not in anchors(target)):
            lost.append(link)
    assert not lost


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_tables_of_figures_stand_with_the_command_that_makes_them(page):
    sections = re.split(r"(?m)^(?=#+ )", page.read_text(encoding="utf-8"))
    measured = [section for section in sections if len(FIGURES.findall(section)) >= ROWS]
    without = [section.splitlines()[0] for section in measured if not COMMAND.search(section)]
    assert not without


@pytest.mark.parametrize("mistake", ["wrong gear (torque 2 times)", "unsigned torque"])
def test_the_table_of_failures_says_what_check_says(mistake, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "comparisons"))
    failures = import_module("failures")
    monkeypatch.delitem(sys.modules, "failures")
    rows = (DOCS / "failures.md").read_text(encoding="utf-8").splitlines()
    (row,) = (line for line in rows if line.startswith(f"| {mistake} |"))
    _, _, said, errors, _ = (cell.strip() for cell in row.split("|"))
    found, own = failures.consequence(failures.mistakes()[mistake]())
    assert NUMBER.sub("#", found) == NUMBER.sub("#", said)
    for text, shown in ((found, said), (own, errors)):
        numbers = [[float(x) for x in NUMBER.findall(part)] for part in (text, shown)]
        assert numbers[0] == pytest.approx(numbers[1], rel=0.1, abs=0.2)


def test_the_lines_of_the_readme_run_on_a_table_of_ones_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = pd.read_csv(DOCS / "quickstart" / "run1.csv", sep=";", decimal=",")
    torque = 0.035 * 9 * run.current_A
    df = pd.DataFrame({"t": run.t_ms / 1000, "q": run.pos_deg, "u": torque})
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    names = {"df": df}
    exec(compile(code, "README.md", "exec"), names)
    assert (tmp_path / "model.json").exists()
    assert {"value", "unit"} <= set(names["fit"].frame.columns)
