"""The pages: all are in the site, their links lead somewhere, and their cheap figures hold."""

import re

import failures
import pandas as pd
import pytest
import typer
from fixtures.paths import ROOT
from fixtures.printed import assert_alike

from frictionid.__main__ import app

DOCS = ROOT / "docs"
# by the site itself: of the README, of result folders, of notebooks
MADE = {"index.md", "gallery.md", "notebooks/pendulum.md", "notebooks/arm.md"}
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
LINK = re.compile(r"\]\(([^)\s]+)\)")
FIGURES = re.compile(r"^\|(?! `).*\d\.\d.*$", re.MULTILINE)  # rows; of settings begin with a name
ROWS = 2  # of figures: fewer are an aside
CODE = re.compile(r"`([^`\n]+)`|^(?: {4}|\$ )(.*)$|^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(
    r"(?:^|\s)(frictionid|make|python) ([\w./-]+)|(?:^|\s)(comparisons/[\w/]+\.\w+)"
)
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
NUMBER = re.compile(r"\d+(?:\.(\d+))?")
COMMIT = re.compile(r"\bcommits? ([0-9a-f]{7})\b")


GROUP = typer.main.get_command(app)
SPEED = (DOCS / "speed.md").read_text(encoding="utf-8")
ROWS_OF_FAILURES = [
    *("nothing", "torque logged 30 ms late", "unsigned torque", "degrees taken for radians"),
    *("held samples (30 Hz as 60 Hz)", "wrong gear (torque 2 times)", "rotor inertia missing"),
]


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


def commands(text):
    """What code on a page names that can be run: commands, targets of make, scripts and suites."""
    code = "\n".join("".join(groups) for groups in CODE.findall(text))
    return [
        path or name
        for program, name, path in COMMAND.findall(code)
        if (program == "frictionid" and name in GROUP.commands)
        or (program == "make" and name in TARGETS)
        or (program in ("python", "") and (ROOT / (path or name)).exists())
    ]


@pytest.mark.parametrize(
    "text, run",
    [
        ("frictionid fit and make test are prose", []),
        ("`frictionid fits it`, `make something`, `comparisons/gone.toml`", []),
        ("`frictionid fit arm` and `make bench`", ["fit", "bench"]),
        ("see `comparisons/acrobot.toml`", ["comparisons/acrobot.toml"]),
        ("    python comparisons/failures.py\n", ["comparisons/failures.py"]),
    ],
)
def test_commands_are_code_that_can_be_run(text, run):
    assert commands(text) == run


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_tables_of_figures_stand_with_the_command_that_makes_them(page):
    sections = re.split(r"(?m)^(?=#+ )", page.read_text(encoding="utf-8"))
    measured = [section for section in sections if len(FIGURES.findall(section)) >= ROWS]
    without = [section.splitlines()[0] for section in measured if not commands(section)]
    assert not without


@pytest.mark.parametrize("name", ["speed", "results", "monitoring"])
def test_pages_of_measurements_name_commit_and_machine(name):
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    assert COMMIT.search(text) and re.search(r"Intel|AMD", text)


def test_what_is_asked_of_speed_holds_where_the_table_says_so():
    rows = re.findall(r"^\|.*\| (.*) \| (.*) \| >= ([\d.]+)(.*): (.*) \|.*\|$", SPEED, re.MULTILINE)
    assert len(rows) >= 6
    said = {(True, True): "holds on both", (False, False): "missed"}
    said |= {(True, False): "missed on the Xeon", (False, True): "missed on the EPYC"}
    for epyc, xeon, bar, _, words in rows:
        held = tuple(float(NUMBER.match(ratio)[0]) >= float(bar) for ratio in (epyc, xeon))
        assert words == said[held], (epyc, xeon, bar)


@pytest.mark.parametrize("mistake", ROWS_OF_FAILURES)
def test_the_table_of_failures_says_what_check_says(mistake):
    rows = (DOCS / "failures.md").read_text(encoding="utf-8").splitlines()
    row = next(line for line in rows if line.startswith(f"| {mistake} |"))
    written = [cell.strip() for cell in row.split("|")][2:-1]
    found = failures.consequence(failures.mistakes()[mistake]())
    # shooting at unsigned torques wanders for a minute before it is wrong
    for said in written[:2] if mistake == "unsigned torque" else written:
        assert_alike(next(found), said, near=0.0)


def test_the_lines_of_the_readme_run_on_a_table_of_ones_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = pd.read_csv(DOCS / "quickstart/run1.csv", sep=";", decimal=",")
    torque = 0.035 * 9 * run.current_A
    df = pd.DataFrame({"t": run.t_ms / 1000, "q": run.pos_deg, "u": torque})
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    names = {"df": df}
    exec(compile(code, "README.md", "exec"), names)
    assert (tmp_path / "model.json").exists()
    assert {"value", "unit"} <= set(names["fit"].frame.columns)
