"""frictionid laws, identifiers and mechanisms: the kinds that can be named."""


def list_kinds(command: str, name: str, json: bool) -> None:
    """Print all kinds that a command lists in short, or all of one, or either as JSON."""
    from frictionid.comparison import kind_descriptions
    from frictionid.files import json_text
    from frictionid.report.console import show_kind, show_kinds

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
