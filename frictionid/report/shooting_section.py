"""What shooting found on a data set: the fit that predicts best in full, the others in short."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from frictionid.files import file_names
from frictionid.report.figures.bands import curve_bands
from frictionid.report.figures.correlation import STRONG, correlation, strong_pairs
from frictionid.report.figures.panels import side_by_side
from frictionid.report.figures.style import Look
from frictionid.report.load import Entry, Section
from frictionid.report.numbers import listed, short
from frictionid.report.paired import best
from frictionid.report.shooting_numbers import estimates
from frictionid.report.shooting_tables import interval_table, window_table
from frictionid.report.shooting_text import coverage, doubts, findings
from frictionid.report.tables import Table, escape_markdown
from frictionid.report.text import Matter, named

PAIRS = 4  # strongly correlated pairs told one by one


class Found(NamedTuple):
    """What the page shows: sentences, the table and pictures of the best fit, lines of others.

    lead : the finding for the top of the page, "" where friction alone was free
    """

    lead: str
    head: str
    words: tuple[str, ...]
    table: Table
    pictures: tuple[tuple[str, str], ...]  # stem of the file, caption
    windows: Table | None
    others: tuple[str, ...]


def fits(section: Section) -> list[Entry]:
    """Entries that were fitted by shooting."""
    return [entry for entry in section.entries if entry.refined is not None]


def stems(section: Section, name: str) -> dict[Entry, str]:
    """Ending of the names of files about each of these fits; `name` is the data set's."""
    own = fits(section)
    several = len({entry.recipe for entry in own}) > 1
    words = [f"{name}--{e.label}" + (f"--{e.recipe}" if several else "") for e in own]
    unique = file_names(words)
    return {entry: unique[word] for entry, word in zip(own, words, strict=True)}


def first_fit(m: Matter) -> Entry | None:
    """The fit by shooting that predicts best; the first where none predicts."""
    own = fits(m.section)
    known = best(own, m.dataset, m.last) if m.horizons else None
    return known or (own[0] if own else None)


def found(m: Matter, about: Mapping[str, Any], name: str) -> Found | None:
    """What the page says of the fits by shooting; None where there are none."""
    first = first_fit(m)
    if first is None or first.refined is None:
        return None
    own = stems(m.section, name)
    read = estimates(first.refined, about)
    words = [*findings(read), coverage(read), *doubts(first.refined, read)]
    pictures = [(f"correlation--{own[first]}", correlation_caption(first, m.dataset, about))]
    pictures += [(stem, band_caption(m.dataset)) for stem in band_stems(m.section, name)]
    lead = escape_markdown(" ".join(findings(read)))
    return Found(
        lead and f"What else shooting found by {named(m.section, first)}: {lead}",
        _head(m, first),
        tuple(escape_markdown(sentence) for sentence in words if sentence),
        interval_table(first, m.dataset, about, m.section.of_role("given")),
        tuple(pictures),
        window_table(first, m.dataset),
        tuple(_line(m, entry, about, own[entry]) for entry in own if entry is not first),
    )


def _head(m: Matter, first: Entry) -> str:
    if len(fits(m.section)) == 1:
        return f"By {named(m.section, first)}, from all data:"
    return f"By {named(m.section, first)}, which predicts best of the fits by shooting:"


def _line(m: Matter, entry: Entry, about: Mapping[str, Any], stem: str) -> str:
    """One line about another fit, with links to all that is known of it."""
    document = entry.refined or {}
    read = estimates(document, about)
    loose = sum(not e.identified for e in read)
    told = [f"{len(read) - loose} of {len(read)} parameters are identified"]
    odd = {"left out": document["left_out"], "not explained": document["unexplained"]}
    told += [
        f"{len(places)} window{'s' * (len(places) > 1)} {words}"
        for words, places in odd.items()
        if places
    ]
    links = [f"[parameters](tables/shooting--{stem}.md)"]
    links.append(f"[correlation](figures/correlation--{stem}.png)")
    if document["left_out"] or document["unexplained"]:
        links.append(f"[windows](tables/windows--{stem}.md)")
    return f"{named(m.section, entry)}: {', '.join(told)}; {', '.join(links)}."


def correlation_caption(entry: Entry, dataset: str, about: Mapping[str, Any]) -> str:
    """Caption of a picture of correlations, with the strongest pairs."""
    document = entry.refined or {}
    pairs = strong_pairs(document, estimates(document, about))
    told = [f"{names} ({r:+.2f})".replace("-", "−") for names, r in pairs[:PAIRS]]
    if len(pairs) > PAIRS:
        told.append(f"{len(pairs) - PAIRS} more pairs")
    framed = f"framed where it exceeds {STRONG:g} in size: {listed(told)}" if told else ""
    none = f"none exceeds {STRONG:g} in size"
    sizes = [float(value) for value in document["singular_values"]]
    span = f"{short(max(sizes))} to {short(min(sizes))}" if sizes else "none"
    return (
        f"Correlation of the parameters of {entry.title} on {dataset}; {framed or none}. Names of "
        f"parameters that are not identified are grey. Singular values of the normal equations, "
        f"scaled to ones on the diagonal: {span}."
    )


def band_stems(section: Section, name: str) -> list[str]:
    """Names of the files of the pictures of bands."""
    count = len(side_by_side(fits(section)))
    return [f"bands--{name}" + (f"--{i + 1}" if count > 1 else "") for i in range(count)]


def band_caption(dataset: str) -> str:
    """Caption of the pictures of bands."""
    return (
        f"Friction found by shooting on {dataset} with its 95 % bands; below, the bands alone, and "
        "how far the truth is off where it is known. Grey: velocities that were not measured."
    )


def drawn_of_shooting(
    section: Section, about: Mapping[str, Any], name: str, looks: Mapping[str, Look]
) -> Iterator[tuple[str, Any]]:
    """Pictures of the fits by shooting, each with the name of its file."""
    own = fits(section)
    for entry, stem in stems(section, name).items():
        yield f"correlation--{stem}", correlation(entry, about)
    pictures = curve_bands(own, about, looks)
    yield from zip(band_stems(section, name), pictures, strict=True)
