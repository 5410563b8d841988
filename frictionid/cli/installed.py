"""frictionid laws, identifiers, mechanisms, data and warm: what there is on this machine."""

from pathlib import Path
from typing import Any

import typer

from .command import add_command, running


def list_kinds(command: str, name: str, json: bool) -> None:
    """Print all kinds that a command lists in short, or all of one, or either as JSON."""
    from frictionid.comparison import kind_descriptions
    from frictionid.files import json_text
    from frictionid.report.terminal import show_kind, show_kinds

    kinds = getattr(kind_descriptions, command)()
    chosen = [kind_descriptions.described(kinds, name)] if name else kinds
    if json:
        print(json_text(chosen), end="")
    elif name:
        show_kind(chosen[0])
    else:
        show_kinds(chosen, f"All of one: frictionid {command} NAME")


def laws(name: str = "", *, json: bool = False) -> None:
    """List the friction laws of model files, with their equations, parameters and units.

    Parameters
    ----------
    name : Show all of this one.
    """
    list_kinds("laws", name, json)


def identifiers(name: str = "", *, json: bool = False) -> None:
    """List what --identifier of fit and [[identifiers]] of a suite can name, with settings.

    Parameters
    ----------
    name : Show all of this one.
    """
    list_kinds("identifiers", name, json)


def mechanisms(name: str = "", *, json: bool = False) -> None:
    """List the mechanisms that [mechanism] of a data set can name, with parameters and units.

    Parameters
    ----------
    name : Show all of this one.
    """
    list_kinds("mechanisms", name, json)


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


def warm() -> None:
    """Compile what commands run as machine code, once on a machine; the first run does it else."""
    from frictionid.api.warm import STEPS, warm_up

    with running([name for name, _ in STEPS], "compiling") as done:
        warm_up(done)
    print("compiled: the next run of a command begins at once")
