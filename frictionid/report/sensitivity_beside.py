"""The sensitivity study beside a result folder, for its page.

`frictionid sensitivity SUITE` writes `<folder>-sensitivity` beside what `compare` writes. Its
pictures stand on the page where it was made of the same recordings.
"""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from frictionid.comparison.results import Results
from frictionid.errors import InputError
from frictionid.files import file_names, read_json
from frictionid.report.exhibits import Names, Picture
from frictionid.report.figures.sensitivity import over_amounts, tornado
from frictionid.report.sections import Section
from frictionid.report.sensitivity import FRAME, PROVENANCE, studies


def beside(results: Results, section: Section, names: Names) -> Iterator[Picture]:
    """Pictures of the study of a section's data set; none where there is no study of these data."""
    folder = results.folder.resolve()
    study = folder.with_name(f"{folder.name}-sensitivity")
    if not (study / FRAME).is_file():
        return
    try:
        data = read_json(study / PROVENANCE).get("data", {})
        frame = pd.read_csv(study / FRAME, dtype={"text": str})
    except (InputError, ValueError):
        return  # a damaged study is no reason to have no report
    known = results.provenance.get("data", {}).get(section.dataset)
    if known is None or data.get(section.dataset) != known:
        return
    stem = names.stems[section.dataset, section.dataset]
    found = [(name, own) for (dataset, name), own in studies(frame) if dataset == section.dataset]
    files = file_names(identifier for identifier, _ in found)
    for identifier, own in found:
        ending = f"{stem}--{files[identifier]}"
        words = f"{identifier} on {section.dataset} with one thing wrong at a time"
        yield Picture(f"tornado--{ending}", tornado(own), f"{words}: what it changes.")
        lines = over_amounts(own)
        if lines is not None:
            yield Picture(f"amounts--{ending}", lines, f"{words}, over the amounts.")
