"""The rules of the code's structure: which way imports point, and how long things may get.

Every rule is a function of a package's files that gives its violations as text; each is tried on
the package, where it must find nothing, and on a planted violation, which it must find.
"""

import ast
from pathlib import Path
from typing import NamedTuple

import pytest
from fixtures.mistakes import mistakes
from fixtures.paths import ROOT
from fixtures.source import docstring_of, lines_of, nodes_of, token_lines

# From the bottom to the top: a module may import what stands before it, and its own package.
LAYERS = (
    *("errors", "arrays", "progress", "pictures"),
    *("files", "outputs", "config"),
    "programs",
    "mechanics",
    "data",
    *("simulate", "friction"),
    "dynamics",
    "fitting",
    *("check", "excitation", "evaluation"),
    "comparison",
    "report",
    "quickstart",
    "api",
    "cli",
    *("rig", "deploy"),
    "__main__",
)
# Imports wait until they are needed there, so that --help is quick: they are no part of the order.
LAZY = {"", "cli"}
FACE = "api"  # it, and commands, may call the package's own public functions
NAMELESS = {"utils", "util", "helpers", "helper", "common", "misc", "manager", "handler"}
LINES = 400
CODE_LINES = 60


class Module(NamedTuple):
    """One file of a package: dotted name within the package ("" is the package itself)."""

    name: str
    path: Path

    @property
    def layer(self):
        """Name of the entry of the list that the module belongs to."""
        return self.name.partition(".")[0]

    @property
    def is_package(self):
        """Whether the file is an `__init__.py`."""
        return self.path.name == "__init__.py"


def read(root):
    """Modules of the package in the folder root, by their dotted names."""
    modules = {}
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        modules[name] = Module(name, path)
    return modules


def imports(module, modules, package):
    """Line and dotted name of each module of the package that a module imports, anywhere in it."""
    for node in nodes_of(module.path):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = _absolute(node, module, package)
            # `from a import b` means the module a.b where there is one, else something inside a
            names = [f"{base}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            top, _, inner = name.partition(".")
            if top == package:
                yield node.lineno, inner if inner in modules else inner.rpartition(".")[0]


def _absolute(node, module, package):
    if not node.level:
        return node.module or ""
    parts = [package, *module.name.split(".")] if module.name else [package]
    kept = parts[: len(parts) - node.level + module.is_package]
    return ".".join([*kept, node.module] if node.module else kept)


def unlisted(modules):
    """Modules that have no place in the list of layers, and names that say nothing."""
    found = [
        f"{m.name}: not in the list of layers"
        for m in modules.values()
        if m.layer not in {"", *LAYERS}
    ]
    for module in modules.values():
        found += [
            f"{module.name}: say in the name what is in the file"
            for part in module.name.split(".")
            if part in NAMELESS
        ]
    return found


def wrong_way(modules, package):
    """Imports that do not point down to a lower layer or stay within their own package."""
    found = []
    for module in modules.values():
        if module.layer in LAZY or module.layer not in LAYERS:
            continue
        lower = LAYERS[: LAYERS.index(module.layer) + 1]
        for line, name in imports(module, modules, package):
            layer = name.partition(".")[0]
            is_face = module.layer == FACE or module.name.endswith(".cli")
            if layer not in lower and (layer or not is_face):
                found.append(f"{module.name}:{line}: may not import {package}.{name}".rstrip("."))
            elif module.is_package and module.name and not name.startswith(f"{module.name}."):
                found.append(
                    f"{module.name}:{line}: __init__.py imports {name}, no leaf of its own"
                )
    return found


def cycles(modules, package):
    """Files that import each other in a circle, also within one package."""
    graph = {m.name: {n for _, n in imports(m, modules, package)} for m in modules.values()}
    graph = {
        name: {n for n in to if n in modules} for name, to in graph.items() if name not in LAZY
    }
    while leaves := {name for name, to in graph.items() if not to & graph.keys()}:
        graph = {name: to for name, to in graph.items() if name not in leaves}
    return [f"{name}: in or above a circle of imports" for name in graph]


def open_ended(modules):
    """Functions that take `**kwargs`, and statements that change module-level state."""
    found = []
    for module in modules.values():
        for node in nodes_of(module.path):
            if isinstance(node, ast.arguments) and node.kwarg:
                found.append(
                    f"{module.name}:{node.kwarg.lineno}: **{node.kwarg.arg} in a signature"
                )
            if isinstance(node, ast.Global):
                found.append(f"{module.name}:{node.lineno}: global {', '.join(node.names)}")
    return found


def too_long(paths):
    """Files of 400 lines and more, functions of more than 60 lines of code."""
    found = []
    for path in paths:
        if (lines := len(path.read_text().splitlines())) >= LINES:
            found.append(f"{path.name}: {lines} lines")
        code = {line for first, last in token_lines(path) for line in range(first, last + 1)}
        for node in nodes_of(path):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                inside = (code & lines_of(node)) - lines_of(docstring_of(node))
                if len(inside) > CODE_LINES:
                    found.append(f"{path.name}:{node.lineno}: {node.name} has {len(inside)} lines")
    return found


def violations(root):
    """All that breaks a rule in the package in the folder root."""
    modules = read(root)
    return [
        *unlisted(modules),
        *wrong_way(modules, root.name),
        *cycles(modules, root.name),
        *open_ended(modules),
        *too_long(module.path for module in modules.values()),
    ]


def test_the_package_follows_the_rules():
    assert violations(ROOT / "frictionid") == []


@pytest.mark.parametrize("folder", ["tests", "comparisons", "peers"])
def test_what_stands_beside_the_package_stays_short(folder):
    assert too_long(sorted((ROOT / folder).rglob("*.py"))) == []


SOUND = {
    "__init__.py": "def __getattr__(name):\n    from pack.cli import main\n    return main\n",
    "arrays.py": "import numpy\n",
    "data.py": "from pack.arrays import Array\nfrom . import errors\n",
    "errors.py": "",
    "friction/__init__.py": (
        "from pack.friction.stribeck import Stribeck\nfrom .spline import Spline\n"
    ),
    "friction/stribeck.py": "from pack.data import Signal\nfrom pack.friction import spline\n",
    "friction/spline.py": "from ..data import Signal\nimport pack.arrays\n",
    "cli/__init__.py": "def main():\n    from pack.friction import Stribeck\n",
}
PLANTED = r"""
arrays.py: from pack.data import Signal             => arrays:1: may not import pack.data
arrays.py: import pack.friction.spline              => may not import pack.friction.spline
arrays.py: def f():\n    from . import friction      => arrays:2: may not import
friction/spline.py: from ..cli import main          => friction.spline:1: may not import
friction/spline.py: from pack import Law            => friction.spline:1: may not import pack
simulate/rig.py: import pack.friction               => simulate.rig:1: may not import
friction/__init__.py: from pack.arrays import Array => no leaf of its own
friction/spline.py: from pack.friction import stribeck => circle of imports
friction/spline.py: from pack.friction import Law   => friction.spline: in or above
extra.py: # new                                     => extra: not in the list
friction/utils.py: # new                            => friction.utils: say in the name
errors.py: def f(a, **rest):\n    pass              => errors:1: **rest
errors.py: f = lambda **rest: rest                  => errors:1: **rest
errors.py: def f():\n    global a\n    a = 1        => errors:2: global a
"""


def _write(folder, files):
    for name, text in files.items():
        path = folder / "pack" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder / "pack"


def test_the_checker_accepts_a_sound_package(tmp_path):
    full = 'def f():\n    """Text.\n\n    More.\n    """\n    # why\n\n' + "    a = 1\n" * 59
    assert violations(_write(tmp_path, {**SOUND, "config.py": full})) == []


@mistakes(PLANTED)
def test_the_checker_finds_a_planted_violation(wrong, words, tmp_path):
    name, text = wrong.replace(r"\n", "\n").split(": ", 1)
    found = violations(_write(tmp_path, {**SOUND, name: text}))
    assert any(words in line for line in found), found


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("# line\n" * 400, "errors.py: 400 lines"),
        ("def f():\n" + "    a = 1\n" * 60, "errors.py:1: f has 61"),
    ],
    ids=["file", "function"],
)
def test_the_checker_finds_what_is_long(text, words, tmp_path):
    found = violations(_write(tmp_path, {**SOUND, "errors.py": text}))
    assert any(words in line for line in found), found


def test_the_list_of_layers_names_each_once():
    assert len(set(LAYERS)) == len(LAYERS)


def test_no_two_test_files_have_one_name():
    """pytest imports them by their names, and refuses the second where it sees both."""
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))
