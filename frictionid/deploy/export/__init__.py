"""Friction as code and files for simulators, controllers and drives, one format per file."""

from pathlib import Path

FORMATS = tuple(sorted(path.stem for path in (Path(__file__).parent / "formats").glob("[!_]*.py")))
