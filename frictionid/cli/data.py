"""frictionid data: public recordings, what is known of them and how they get here."""

from pathlib import Path
from typing import Any

import typer

from .options import add_command

data = typer.Typer(help="List and get public recordings.", no_args_is_help=True)


def list_(*, json: bool = False) -> None:
    """Say which public recordings there are, their licences and what of them is here."""
    import json as texts

    from frictionid.data.readers.public_collections import cached, collections, count_present

    facts = {
        name: {
            "title": c.title,
            "files": len(c.files),
            "present": count_present(name),
            "folder": str(cached(name)),
            "hashes_known": sum(file.sha256 is not None for file in c.files),
            "licence": c.licence,
            "redistribution": c.redistribution,
            "citation": c.citation,
            "origin": c.page,
        }
        for name, c in collections().items()
    }
    if json:
        print(texts.dumps(facts, indent=1))
        return
    for name, fact in facts.items():
        print(name, f"  {fact['title']}", sep="\n")
        print("  files            {files}, here {present} ({folder})".format_map(fact))
        print(f"  SHA-256          {_hashes(fact['hashes_known'], fact['files'])}")
        for key in ("licence", "redistribution", "citation", "origin"):
            print(f"  {key:<16} {fact[key]}")


def get(
    name: str,
    *,
    from_: Path | None = None,
) -> None:
    """Put the files of a public collection into its folder, each checked by its hash.

    Parameters
    ----------
    name : Name of the collection, see: frictionid data list.
    from_ : Folder that has the files, instead of a network.
    """
    from frictionid.data.readers.public_collections import (
        cached,
        collection_named,
        copy_collection,
        download,
    )

    collection = collection_named(name)
    print(f"{name}: licence {collection.licence}; redistribution {collection.redistribution}")
    if from_ is not None:
        missing = copy_collection(name, from_)
        if missing:
            print(f"not there: {len(missing)} of {len(collection.files)}, {', '.join(missing)}")
    else:
        download(name, lambda file: print(f"  {file}", flush=True))
    if any(file.sha256 is None for file in collection.files):
        print("the SHA-256 of the original is not known: it was not verified")
    print(f"in {cached(name)}")


def _hashes(hashed: Any, total: Any) -> str:
    if hashed == total:
        return "of all originals known"
    return f"of {hashed} of {total} originals known: the others are taken as they are"


add_command(data, list_, "list")
add_command(data, get)
