"""How a script is called: the parameters of its `main` are its arguments and options."""

from collections.abc import Callable

import typer

from frictionid.cli.command import add_command


def call(main: Callable[..., None]) -> None:
    """Call a function with what the command line says, see `add_command`; exit at the end."""
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    add_command(app, main)
    app()
