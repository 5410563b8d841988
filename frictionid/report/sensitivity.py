"""The outcome of a sensitivity study: a table, pictures, a short page, and all numbers as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from frictionid.comparison.results import Results
from frictionid.errors import InputError
from frictionid.files import file_names, json_text, read_json
from frictionid.outputs import replace_files
from frictionid.report.exhibits import Names, Picture
from frictionid.report.figures.sensitivity import (
    CHANGE,
    ERROR,
    LOSS,
    ROLLOUT,
    is_known,
    over_amounts,
    summarised,
    tornado,
)
from frictionid.report.figures.style import drawing, rendered
from frictionid.report.numbers import NOTHING, short
from frictionid.report.render import render
from frictionid.report.sections import Section
from frictionid.report.tables import Column, Table, latex, line, markdown, text_columns

PAGE, FRAME, PROVENANCE = "summary.md", "sensitivity.csv", "provenance.json"
Study = tuple[str, str]  # data set, identifier


def studies(frame: pd.DataFrame) -> Iterator[tuple[Study, pd.DataFrame]]:
    """The summarised frame of each data set and identifier."""
    whole = summarised(frame)
    for key in dict.fromkeys(zip(whole.dataset, whole.identifier, strict=True)):
        yield key, whole[(whole.dataset == key[0]) & (whole.identifier == key[1])]


def write_sensitivity(
    folder: Path, frame: pd.DataFrame, provenance: Mapping[str, Any], *, replace: bool = False
) -> Path:
    """Path of the page written, with sensitivity.csv, tables and pictures beside it.

    replace : write also over files that were changed since
    """
    contents = {
        FRAME: frame.to_csv(index=False, float_format="%.9g").encode(),
        PROVENANCE: json_text(dict(provenance)).encode(),
    }
    own = list(studies(frame))
    stems = file_names("--".join(key) for key, _ in own)
    shown = []
    with drawing():
        for key, part in own:
            stem, table = stems["--".join(key)], sensitivity_table(part)
            pictures = {f"tornado--{stem}": tornado(part), f"amounts--{stem}": over_amounts(part)}
            for name, picture in pictures.items():
                if picture is not None:
                    kinds = rendered(picture)
                    contents |= {f"figures/{name}.{kind}": kinds[kind] for kind in kinds}
            contents[f"tables/sensitivity--{stem}.md"] = markdown(table).encode()
            contents[f"tables/sensitivity--{stem}.tex"] = latex(table).encode()
            shown.append((key, table, [n for n, p in pictures.items() if p is not None]))
    context = {"studies": shown, "provenance": provenance}
    contents[PAGE] = render("sensitivity.md.j2", context).encode()
    replace_files(folder, contents, replace=replace)
    return folder / PAGE


def sensitivity_table(frame: pd.DataFrame) -> Table:
    """Errors and changes of one data set and identifier, a block for each recipe.

    frame : summarised
    """
    dataset, identifier = frame.dataset.iloc[0], frame.identifier.iloc[0]
    shown = [CHANGE, *([ERROR] if is_known(frame) else []), ROLLOUT, LOSS]
    columns = [*text_columns("recipe", "what is wrong", "by")]
    columns += [Column(measure.label) for measure in shown]
    words, numbers = frame[["recipe", "name", "text"]], frame[[m.column for m in shown]]
    lines = [
        line([*map(str, own), *map(_number, values)], str(own[0]))
        for own, values in zip(words.to_numpy(), numbers.to_numpy(), strict=True)
    ]
    caption = (
        f"{dataset}, {identifier}: fitted with one thing wrong, judged on held-out recordings that "
        "have it wrong, too. Curves: RMS over RMS, of the worst joint. Changes: against the fit "
        "with nothing wrong."
    )
    return Table(caption, f"sensitivity-{dataset}-{identifier}", tuple(columns), tuple(lines))


def _number(value: float) -> str:
    return short(value, 3) if np.isfinite(value) else NOTHING


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
