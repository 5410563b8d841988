"""The page summary.md: findings, tables, pictures, and where the numbers come from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

from frictionid.comparison.results import Results
from frictionid.evaluation import Split
from frictionid.report import families, findings
from frictionid.report.exhibits import Exhibits, shooting_fits
from frictionid.report.memory import memory_analysis
from frictionid.report.reliability import fold_settings, warnings_of
from frictionid.report.render import render
from frictionid.report.sections import EULER, Model, Section, SummaryData
from frictionid.report.verdict import verdict_of

SETTINGS = ("horizons", "every", "history", "sample_time", "seeds", "folds")
ORIGIN = ("description", "origin", "licence", "citation")


def page(
    results: Results,
    sections: Sequence[Section],
    exhibits: Mapping[tuple[str, str], Exhibits],
    stems: Mapping[Model, str],
) -> str:
    """Markdown of the page.

    exhibits : by the data sets fitted and scored; stems : of the files about fits by shooting
    """
    provenance = results.provenance
    context = {
        "results": results,
        "title": provenance.get("title") or provenance["suite"],
        "settings": provenance["settings"],
        "warnings": warnings_of(results, sections),
        "sections": [_section(results, section, exhibits, stems) for section in sections],
        "data": [
            (name, len(hashes), _digest(hashes), provenance.get("folds", {}).get(name, ""))
            for name, hashes in provenance.get("data", {}).items()
        ],
        "origins": {
            name: [origin[key].rstrip(". ") for key in ORIGIN if origin.get(key)]
            for name, origin in provenance.get("origin", {}).items()
        },
        "versions": provenance.get("versions", {}),
        "used": {k: json.dumps(v) for k, v in provenance["settings"].items() if k in SETTINGS},
        "recipes": {m.recipe: m.settings["recipe"] for s in sections for m in s.models if m.recipe},
        "identifiers": {m.identifier: m for s in sections for m in s.models},
    }
    return render("summary.md.j2", context)


def _digest(hashes: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(hashes, sort_keys=True).encode()).hexdigest()


def _section(
    results: Results,
    section: Section,
    exhibits: Mapping[tuple[str, str], Exhibits],
    stems: Mapping[Model, str],
) -> dict[str, Any]:
    fits = shooting_fits(section, stems)
    folds = fold_settings(results.provenance, section.dataset)
    kind = Split(kind=folds.get("kind")).kind_of(section.description.recordings)
    return {
        "section": section,
        "verdict": verdict_of(section),
        "folds": {**folds, "kind": kind},
        "data": [scored_findings(data) for data in section.data],
        "exhibits": [exhibits[section.dataset, data.dataset] for data in section.data],
        "recipe_gains": findings.recipe_gains(section),
        "fits": fits,
        "family_table": families.family_table(section),
        "notes": {key: _notes(section, key) for key in ("equation", "inclusion")},
    }


def scored_findings(data: SummaryData) -> dict[str, Any]:
    """Findings on one data set, each by its name in the template."""
    lowest, closest = data.best(data.of_role("fitted"), EULER), findings.closest_curves(data)
    return {
        "scores": data,
        "predictions": findings.predictions(data),
        "truth": findings.truth_contrast(data),
        "true_start": findings.true_start_contrast(data),
        "loss": findings.loss_contrast(data),
        "lowest_loss": data.value(lowest, EULER) if lowest else None,
        "closest": closest,
        "below_truth": findings.below_truth(data),
        "families": families.families(data),
        "memory": memory_analysis(data) if data.held_out else None,
    }


def _notes(section: Section, key: str) -> list[tuple[Model, str, str]]:
    """Lines that models tell of themselves under a key, each with what its errors are."""
    models = [(model, model.document.get("provenance", {})) for model in section.models]
    return [
        (model, text, own.get(f"{key}_errors", ""))
        for model, own in models
        for text in own.get(key, ())
    ]
