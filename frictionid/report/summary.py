"""The page summary.md: what the evidence supports, tables, pictures, where it comes from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from frictionid.report.figures.loops import loop_findings
from frictionid.report.hybrid_text import Question, question
from frictionid.report.learned_text import learned_findings
from frictionid.report.load import Evidence, Section, folds_told
from frictionid.report.memory_text import memory_findings
from frictionid.report.shooting_section import Found
from frictionid.report.tables import Table, code, escape_markdown, markdown
from frictionid.report.text import (
    Matter,
    foretold,
    held_out_findings,
    matter,
    unseen_findings,
)
from frictionid.report.warnings_text import cautions

KINDS = {"recordings": "whole recordings", "blocks": "contiguous blocks"}
EQUATIONS = "Equations from all data, coefficients with 95 % intervals (s: smooth sign)"
INCLUSION = "How often draws of the recordings had a term, of all data"


class Picture(NamedTuple):
    """A figure in the page: its file without ending, relative to the page, and its caption."""

    file: str
    words: str


class Part(NamedTuple):
    """What is shown of one scored data set: table, pictures, and tables to unfold with titles.

    found : what shooting found, where it was fitted by shooting
    """

    table: Table
    pictures: tuple[Picture, ...]
    details: tuple[tuple[str, Table], ...] = ()
    found: Found | None = None


def summary(evidence: Evidence, parts: Mapping[tuple[str, str], Part]) -> str:
    """Markdown of the page; `parts` by the data sets fitted and scored."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("frictionid.report"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,
    )
    provenance = evidence.provenance
    scored = [
        matter(section, dataset, evidence.horizons, evidence.about[dataset])
        for section in evidence.sections
        for dataset in (section.dataset, *section.tests)
    ]
    fitted = [m for m in scored if m.dataset == m.section.dataset]
    text = environment.get_template("summary.md.j2").render(
        title=escape_markdown(provenance.get("title") or provenance["suite"]),
        sections=[_section(evidence, section, parts) for section in evidence.sections],
        cautions=cautions(evidence, fitted, scored),
        shooting=any(part.found for part in parts.values()),
        settings={
            "every": provenance["settings"].get("every", "…"),
            "true_initial_states": any(
                provenance["settings"].get(key) for key in ("true_initial_states", "true_starts")
            ),
        },
        data=_data(evidence),
        origins=_origins(evidence),
        provenance=_provenance(evidence),
        rerun=_rerun(evidence),
    )
    return text


def _section(
    evidence: Evidence, section: Section, parts: Mapping[tuple[str, str], Part]
) -> dict[str, Any]:
    name = section.dataset
    own = parts[name, name]
    told = matter(section, name, evidence.horizons, evidence.about[name])
    lead = [own.found.lead] if own.found and own.found.lead else []
    return {
        "name": escape_markdown(name),
        "size": _size(evidence.about[name]),
        "folds": _folds(folds_told(evidence.provenance, name)),
        "words": foretold(told),
        "findings": [
            *held_out_findings(told),
            *learned_findings(told),
            *lead,
            *_memory(told, evidence.about[name]),
        ],
        "table": markdown(own.table),
        "question": _question(question(section, evidence.horizons, evidence.about)),
        "pictures": [_shown(picture) for picture in own.pictures],
        "details": [
            *({"title": t, "table": markdown(table)} for t, table in own.details),
            *_lines(section, "equation", EQUATIONS),
            *_lines(section, "inclusion", INCLUSION),
        ],
        "found": own.found and _found(own.found),
        "tests": [_test(evidence, section, test, parts[name, test]) for test in section.tests],
    }


def _question(asked: Question | None) -> dict[str, Any] | None:
    return asked and {"words": asked.words, "table": markdown(asked.table)}


def _lines(section: Section, key: str, title: str) -> list[dict[str, str]]:
    """What the models tell of themselves under a key, in one part of the page."""
    lines = [
        f"- {escape_markdown(entry.title)}: `{line}`\n"
        for entry in section.entries
        for line in entry.model.get("provenance", {}).get(key, ())
    ]
    return [{"title": title, "table": "".join(lines)}] if lines else []


def _memory(told: Matter, about: Mapping[str, Any]) -> list[str]:
    """What is told of memory, where models remember."""
    return memory_findings(told) + loop_findings(told.section, about)


def _found(part: Found) -> dict[str, Any]:
    pictures = [Picture(f"figures/{stem}", words) for stem, words in part.pictures]
    return {
        "head": part.head,
        "words": part.words,
        "table": markdown(part.table),
        "pictures": [_shown(picture) for picture in pictures],
        "windows": "" if part.windows is None else markdown(part.windows),
        "others": part.others,
    }


def _test(evidence: Evidence, section: Section, test: str, part: Part) -> dict[str, Any]:
    told = matter(section, test, evidence.horizons, evidence.about[test])
    return {
        "name": escape_markdown(test),
        "words": " ".join([unseen_findings(told), *learned_findings(told)]).strip(),
        "size_sentence": f"{_size(evidence.about[test])}, no part of any fit.",
        "table": markdown(part.table),
        "pictures": [_shown(picture) for picture in part.pictures],
    }


def _shown(picture: Picture) -> dict[str, str]:
    return {"file": picture.file, "words": escape_markdown(picture.words)}


def _size(about: Mapping[str, Any]) -> str:
    count = about["recordings"]
    recordings = "1 recording" if count == 1 else f"{count} recordings"
    return f"{recordings}, {about['samples']} samples, {about['seconds']:.0f} s"


def _folds(settings: Mapping[str, Any]) -> str:
    if "count" not in settings:
        return "judged on held-out data"
    kind = KINDS.get(settings.get("kind", ""), "shuffled samples")
    gap = f" with gaps of {settings['gap']:g} s" if settings.get("kind") == "blocks" else ""
    return f"{settings['count']} folds of {kind}{gap}"


def _data(evidence: Evidence) -> list[dict[str, str]]:
    folds = evidence.provenance.get("folds", {})
    return [
        {
            "name": escape_markdown(name),
            "files": str(len(hashes)),
            "hash": _digest(hashes)[:16],
            "folds": f"`{folds[name][:16]}`" if name in folds else "",
        }
        for name, hashes in evidence.provenance.get("data", {}).items()
    ]


def _digest(hashes: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(hashes, sort_keys=True).encode()).hexdigest()


def _origins(evidence: Evidence) -> list[str]:
    lines = []
    for name, origin in evidence.provenance.get("origin", {}).items():
        keys = ("description", "origin", "licence", "citation")
        words = [origin[key].rstrip(". ") for key in keys if origin.get(key)]
        if words:
            text = ". ".join(word[:1].upper() + word[1:] for word in words)
            lines.append(f"{code(name)}: {escape_markdown(text)}.")
    return lines


def _provenance(evidence: Evidence) -> list[str]:
    versions = evidence.provenance.get("versions", {})
    lines = [f"Versions: {', '.join(f'{name} {version}' for name, version in versions.items())}."]
    settings = evidence.provenance["settings"]
    shown = ("horizons", "every", "history", "sample_time", "seeds", "folds")
    told = [f"{name} = {json.dumps(settings[name])}" for name in shown if name in settings]
    if told:
        lines.append(f"Settings: {code('; '.join(told))}.")
    return lines + _calls(evidence.sections)


def _calls(sections: Sequence[Section]) -> list[str]:
    """Constructor calls of recipes and identifiers, and where given numbers are from."""
    recipes: dict[str, str] = {}
    identifiers: dict[str, str] = {}
    for section in sections:
        for entry in section.entries:
            if entry.recipe:
                recipes[entry.recipe] = code(entry.settings["recipe"])
            call = code(entry.settings["identifier"])
            identifiers[entry.identifier] = _source(entry.model) if entry.role in FIXED else call
    lines = [f"Recipe {code(name)}: {call}." for name, call in recipes.items()]
    return lines + [f"{code(name)}: {call}." for name, call in identifiers.items()]


FIXED = ("given", "truth")


def _source(model: Mapping[str, Any]) -> str:
    about = model.get("provenance", {})
    if about.get("source") == "truth":
        return "the true friction of the simulation, from the data set's description"
    words = [str(about[key]).rstrip(". ") for key in ("source", "note") if about.get(key)]
    own = ", with mechanism parameters of its own" if model.get("parameters") else ""
    return escape_markdown(f"fixed numbers{own}: {'; '.join(words) or 'source not told'}")


def _rerun(evidence: Evidence) -> str:
    name = evidence.provenance["suite"]
    return f"the suite {name}; --data or FRICTIONID_DATA where recordings lie elsewhere"
