"""Steps of `make docs`: the README as home, files that pages link to, the gallery."""

from __future__ import annotations

import json
import re
from base64 import b64decode
from pathlib import Path
from posixpath import dirname, normpath, relpath
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parent.parent
LINK = re.compile(r"\]\(([^)#:\s]+)(#[^)\s]*)?\)")
EMPTY = "No report has been made in this clone: `make compare` makes the first one.\n"


def on_files(files: Files, config: Any) -> Files:
    """Add the home page, the gallery with the reports that are there, and linked files."""
    home = (ROOT / "README.md").read_text(encoding="utf-8")
    home = re.sub(r"\]\(docs/", "](", home)
    home = re.sub(r"\]\((data/|comparisons/|frictionid/|CONTRIBUTING)", r"](../\1", home)
    files.append(File.generated(config, "index.md", content=home.replace(".ipynb)", ".md)")))
    for path in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")):
        for name, content in _notebook(path).items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    files.append(File.generated(config, "gallery.md", content=_gallery(files, config)))
    linked = {
        path for page in files.documentation_pages() for path in _outside(page, page.content_string)
    }
    for path in sorted(linked):
        name = f"files/{path}" + (".txt" if path.endswith(".md") else "")
        files.append(
            File.generated(config, name, content=(ROOT / path).read_text(encoding="utf-8"))
        )
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Lead links to files of the repository to their copies in the site."""

    def there(found: re.Match[str]) -> str:
        path = _path(page.file.src_uri, found[1])
        if path is None:
            return found[0]
        name = f"files/{path}" + (".txt" if path.endswith(".md") else "")
        return f"]({relpath(name, dirname(page.file.src_uri) or '.')})"

    return LINK.sub(there, markdown)


def _notebook(path: Path) -> dict[str, str | bytes]:
    """A notebook as a page, and its pictures."""
    pictures: dict[str, str | bytes] = {}
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        for out in cell["outputs"]:
            data = out.get("data", {})
            if "image/png" in data:
                name = f"{path.stem}-{len(pictures)}.png"
                pictures[name] = b64decode(data["image/png"])
                parts.append(f"![what the cell shows]({name})")
            elif "text/html" in data:
                shown = "".join(data["text/html"]).replace(
                    '<pre style="', '<pre style="font-size:.52rem;'
                )
                parts.append(f"<div>{shown}</div>")
            else:
                text = "".join(out.get("text") or data["text/plain"])
                parts.append(f"```text\n{text.rstrip()}\n```")
    parts.append(f"[The notebook itself]({path.name})")
    return {f"{path.stem}.md": "\n\n".join(parts) + "\n", **pictures}


def _outside(page: File, text: str) -> list[str]:
    """Files of the repository, outside docs/, that a page links to."""
    found = (_path(page.src_uri, match[1]) for match in LINK.finditer(text))
    return [path for path in found if path is not None]


def _path(page: str, link: str) -> str | None:
    """Path in the repository of a link that leaves docs/; None of one that does not."""
    place = normpath(f"docs/{dirname(page)}/{link}")
    return None if place.startswith("docs/") or not (ROOT / place).is_file() else place


def _gallery(files: Files, config: Any) -> str:
    """Links to the reports of this clone's result folders, copied into the site."""
    pages = sorted((ROOT / "report").glob("*/index.html"))
    for page in pages:
        name = f"reports/{page.parent.name}.html"
        files.append(File.generated(config, name, content=page.read_text(encoding="utf-8")))
    lines = [f"- [{p.parent.name}](reports/{p.parent.name}.html)\n" for p in pages]
    head = "# Gallery\n\nReports of `frictionid compare`, each one page that needs no network.\n\n"
    return head + ("".join(lines) or EMPTY)
