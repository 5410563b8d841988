"""Where the numbers of a report come from: data, folds, versions, settings."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from frictionid.comparison.results import Results
from frictionid.evaluation import Split
from frictionid.report.reliability import fold_settings
from frictionid.report.sections import DataDescription, Model, Section

SETTINGS = ("horizons", "every", "history", "sample_time", "seeds", "folds")
ORIGIN = ("description", "origin", "licence", "citation")
KINDS = {
    "recordings": "whole recordings",
    "blocks": "contiguous blocks",
    "shuffled": "shuffled samples",
}


class Source(NamedTuple):
    """A data set: number of files, hashes over all of them and of its folds, and its origin."""

    name: str
    files: int
    data: str
    folds: str
    origin: tuple[str, ...]


class Provenance(NamedTuple):
    """What a comparison was made of; settings, recipes and identifiers by their names."""

    suite: str
    sources: tuple[Source, ...]
    versions: Mapping[str, str]
    settings: Mapping[str, str]
    recipes: Mapping[str, str]
    identifiers: Mapping[str, str]


def provenance_of(results: Results, sections: Sequence[Section]) -> Provenance:
    """The provenance of a report."""
    document = results.provenance
    models = [model for section in sections for model in section.models]
    return Provenance(
        suite=str(document["suite"]),
        sources=tuple(
            Source(
                name,
                len(hashes),
                hashlib.sha256(json.dumps(hashes, sort_keys=True).encode()).hexdigest(),
                document.get("folds", {}).get(name, ""),
                _origin(document.get("origin", {}).get(name, {})),
            )
            for name, hashes in document.get("data", {}).items()
        ),
        versions=document.get("versions", {}),
        settings={k: json.dumps(v) for k, v in document["settings"].items() if k in SETTINGS},
        recipes={m.recipe: m.settings["recipe"] for m in models if m.recipe},
        identifiers={m.identifier: _origin_of(m) for m in models},
    )


def _origin(origin: Mapping[str, str]) -> tuple[str, ...]:
    parts = [origin[key].rstrip(". ") for key in ORIGIN if origin.get(key)]
    return tuple(f"{part[:1].upper()}{part[1:]}." for part in parts)


def _origin_of(model: Model) -> str:
    """How a model came to its numbers."""
    if model.role == "truth":
        return "the true friction of the simulation, from the data set's description"
    if model.role == "given":
        source = model.provenance
        parts = ", with mechanism parameters of its own" if model.document.get("parameters") else ""
        said = "; ".join(filter(None, (source.source, source.note)))
        return f"fixed numbers{parts}: {said or 'source not given'}"
    return model.settings["identifier"]


def size_of(data: DataDescription) -> str:
    """How much was recorded, in words."""
    many = "s" if data.recordings != 1 else ""
    return f"{data.recordings} recording{many}, {data.samples} samples, {data.seconds:.0f} s"


def folds_of(results: Results, section: Section) -> str:
    """The folds of a data set in words."""
    settings = fold_settings(results.provenance, section.dataset)
    if "count" not in settings:
        return "judged on held-out data"
    kind = Split(kind=settings.get("kind")).kind_of(section.description.recordings)
    gaps = f" with gaps of {settings['gap']:g} s" if kind == "blocks" else ""
    return f"{settings['count'] or ''} folds of {KINDS[kind]}{gaps}".strip()
