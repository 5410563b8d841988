"""Commands that the documents name: they exist, with these options, and so do their scripts."""

import ast
import re

import pytest
import typer
from fixtures.paths import ROOT

from frictionid.__main__ import app

TOP = ("README.md", "CONTRIBUTING.md", "data/README.md")
PAGES = sorted([*map(ROOT.joinpath, TOP), *(ROOT / "docs").rglob("*.md")])
GROUP = typer.main.get_command(app)
# in a block, or in a line of text between backticks; "..." and "|" end a command
NAMED = re.compile(r"(?:^|`|\n {4})(frictionid [a-z][^`\n|]*|python comparisons/[^`\n|]*)", re.M)


def named():
    """Each page with each command that it names."""
    return [
        (page, text.strip()) for page in PAGES for text in NAMED.findall(page.read_text("utf-8"))
    ]


def declared(source):
    """Options that a script declares as parameters of its `main`."""
    functions = (part for part in ast.parse(source).body if isinstance(part, ast.FunctionDef))
    mains = (function for function in functions if function.name == "main")
    return {"--" + a.arg.replace("_", "-") for main in mains for a in main.args.kwonlyargs}


def complaint(text):
    """What is wrong with a command, or nothing."""
    program, name, *words = text.partition(" #")[0].split()
    options = {word.partition("=")[0] for word in words if word.startswith("--")}
    if program == "python":
        script = ROOT / name
        if not script.is_file():
            return f"no script {name}"
        source = script.read_text(encoding="utf-8")
        known = declared(source)
        return " ".join(o for o in sorted(options - known) if f'"{o}"' not in source)
    command = GROUP.commands.get(name)
    if command is None:
        return f"no command {name}"
    while words and (inner := getattr(command, "commands", {}).get(words[0])):
        command, words = inner, words[1:]
    known = {"--help"}.union(*(set(p.opts) | set(p.secondary_opts) for p in command.params))
    return " ".join(sorted(options - known - {"--quiet"}))


@pytest.mark.parametrize("page", sorted({page for page, _ in named()}), ids=lambda p: p.name)
def test_commands_and_their_options_exist(page):
    wrong = {text: complaint(text) for own, text in named() if own == page}
    assert {text: said for text, said in wrong.items() if said} == {}


def test_a_wrong_option_is_found():
    assert complaint("frictionid fit my_rig --identifer stribeck") == "--identifer"
    assert complaint("frictionid fitt my_rig") == "no command fitt"
    assert complaint("python comparisons/machines.py --outt PAGE") == "--outt"
    assert len(named()) > 60
