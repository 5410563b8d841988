"""Run the notebooks of docs/notebooks from start to end, and write what their cells show.

    python comparisons/notebooks.py            # the outputs that the site shows, made anew

No Jupyter is needed. Each notebook runs in an empty folder beside copies of the tables that its
metadata name.
"""

from __future__ import annotations

import ast
import io
import json
import os
import shutil
import sys
import tempfile
from base64 import b64encode
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def outputs(notebook: dict[str, Any]) -> list[list[dict[str, Any]]]:
    """Outputs of each cell of code, run one after the other in a fresh folder."""
    names: dict[str, Any] = {"__name__": "__main__"}
    with folder(notebook["metadata"]["frictionid"]["tables"]):
        return [shown("".join(c["source"]), names) for c in cells(notebook)]


def cells(notebook: dict[str, Any]) -> list[dict[str, Any]]:
    """Its cells of code."""
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


@contextmanager
def folder(tables: str) -> Any:
    """A fresh working folder with a copy of the tables of docs/, under the name `arm`."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as place:
        shutil.copytree(ROOT / "docs" / tables, Path(place) / "arm")
        os.chdir(place)
        sys.path.insert(0, place)  # as Jupyter has it
        try:
            yield
        finally:
            os.chdir(before)
            sys.path.remove(place)


def shown(code: str, names: dict[str, Any]) -> list[dict[str, Any]]:
    """What a notebook shows below a cell: what it prints, and its last expression."""
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    out: list[dict[str, Any]] = []
    with redirect_stdout(io.StringIO()) as printed:
        exec(compile(tree, "cell", "exec"), names)
        value = None
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    if text := printed.getvalue():
        out.append({"output_type": "stream", "name": "stdout", "text": text.splitlines(True)})
    if value is not None:
        out.append({"output_type": "display_data", "metadata": {}, "data": data_of(value)})
    return out


def data_of(value: Any) -> dict[str, Any]:
    """The richest form of a value, beside its text."""
    data: dict[str, Any] = {"text/plain": repr(value).splitlines(True)}
    if hasattr(value, "_repr_png_"):
        return {"image/png": b64encode(value._repr_png_()).decode(), "text/plain": ["a picture"]}
    if hasattr(value, "_repr_html_"):
        data["text/html"] = value._repr_html_().splitlines(True)
    return data


def main() -> int:
    """Write the outputs into the notebooks."""
    for path in NOTEBOOKS:
        notebook = json.loads(path.read_text(encoding="utf-8"))
        for count, (cell, out) in enumerate(
            zip(cells(notebook), outputs(notebook), strict=True), 1
        ):
            cell["execution_count"], cell["outputs"] = count, out
        path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", "utf-8")
        print(f"written to {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
