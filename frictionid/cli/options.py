"""Options that several commands have."""

from __future__ import annotations

from typing import Annotated

import typer

Trust = Annotated[
    bool, typer.Option("--trust", help="Run the reader that a data set names by its module.")
]
Json = Annotated[bool, typer.Option("--json", help="Print all numbers as JSON.")]
Replace = Annotated[
    bool, typer.Option("--replace", help="Write over files that exist (never over what is read).")
]
