"""Options that several commands have."""

from __future__ import annotations

from typing import Annotated

import typer

Replace = Annotated[
    bool, typer.Option("--replace", help="Write over files that exist (never over what is read).")
]
