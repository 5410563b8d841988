"""An alignment in words, and as a document beside the recording."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from frictionid.acquire.align.clock import Alignment
from frictionid.acquire.align.drive_response import Response
from frictionid.acquire.align.sync_edges import Marked
from frictionid.mechanics import Mechanism

_WIDE = 1e-3  # [s], half of an interval: such an offset is not good enough
_LARGE = 0.1  # of a viscous coefficient: what the clock's interval leaves open matters


def described(
    found: Alignment, mechanism: Mechanism, marker: Marked | None, drives: list[Response | None]
) -> str:
    """All that was found, a line for each."""
    parts = (_clock(found), _viscous(found, mechanism), _marker(found, marker), _drives(drives))
    return "\n".join(line for part in parts for line in part)


def _clock(found: Alignment) -> Iterator[str]:
    clock, reach = found.clock, found.reach
    begin, end = found.span
    if found.why:
        yield f"caution  the marker alone ties the clocks: {found.why}"
    yield (
        f"offset   {clock.offset:.5f} s, 95 % interval "
        f"+-{1e3 * reach * found.error_at(clock.at):.3f} ms, at {clock.at:.2f} s of the log's clock"
    )
    yield (
        f"drift    {1e6 * clock.drift:.1f} ppm, +-{1e6 * reach * found.drift_error:.1f} ppm "
        f"({'the log' if clock.drift > 0 else 'the camera'}'s clock goes too slowly)"
    )
    yield (
        f"span     {begin:.2f} to {end:.2f} s of the log's clock; at its ends the offset is known "
        f"to +-{1e3 * reach * found.error_at(begin):.3f} and "
        f"+-{1e3 * reach * found.error_at(end):.3f} ms"
    )
    if math.isfinite(found.coarse.left):
        yield (
            f"match    leaves {100 * found.coarse.left:.2g} % of the torque unexplained, the next "
            f"best one {_share(found.coarse.second[1])}"
        )
    half = max(reach * found.error_at(t) for t in (begin, end))
    if half > _WIDE:
        yield (
            f"caution  the offset is known to {1e3 * half:.1f} ms only: record longer, or livelier "
            "motion in which the driven joints slide most of the time"
        )
    if not found.settled:
        yield "caution  the fit did not settle: trust its intervals less"


def _share(left: float) -> str:
    return f"{100 * left:.3g} %" if math.isfinite(left) else "none"


def _viscous(found: Alignment, mechanism: Mechanism) -> Iterator[str]:
    """What the interval of the offset means for viscous friction."""
    half = found.reach * found.error_at(found.clock.at)
    d = mechanism.description
    if found.why:
        return
    for name, slope, value in zip(d.joints, found.viscous, found.found, strict=True):
        open_ = abs(slope) * half
        share = f", {100 * open_ / abs(value):.2g} % of it" if value else ""
        yield (
            f"viscous  of {name}: 1 ms of offset changes it by {1e-3 * slope:.2g} {d.torque_unit} "
            f"s/{d.angle_unit}; what the interval leaves open is +-{open_:.2g}{share}"
            + ("; do not read more into it" if value and open_ > _LARGE * abs(value) else "")
        )


def _marker(found: Alignment, marker: Marked | None) -> Iterator[str]:
    if marker is None:
        return
    apart = found.clock.offset_at(marker.at) - marker.offset
    both = math.hypot(1.96 * marker.error, found.reach * found.error_at(marker.at))
    yield (
        f"marker   {marker.edges} edges: offset {marker.offset:.5f} s, "
        f"+-{1.96e3 * marker.error:.2f} ms, at {marker.at:.2f} s"
    )
    if found.why:
        yield "marker   a delay between log and torque is not known: compare with that fitted, too"
        return
    if abs(apart) > both:
        yield (
            f"marker   by the motion the torque acts {1e3 * apart:.2f} ms later than it was logged "
            f"(+-{1e3 * both:.2f} ms): a delay of the drive; the data set has the motion's clock"
        )
    else:
        yield f"marker   and motion agree ({1e3 * apart:.2f} ms apart, +-{1e3 * both:.2f} ms)"


def _drives(drives: list[Response | None]) -> Iterator[str]:
    for k, r in enumerate(drives, start=1):
        label = "command " if len(drives) == 1 else f"motor {k} "
        if r is None:
            yield f"{label} does not change: nothing to compare the measured torque with"
            continue
        e = r.reach * r.error
        yield (
            f"{label} measured = {r.gain:.4f} (+-{e[0]:.4f}) command {r.bias:+.4g} (+-{e[1]:.2g}) "
            f"N m, {1e3 * r.delay:.2f} (+-{1e3 * e[2]:.2f}) ms later; {_levels(r)}; "
            f"{r.left:.2g} N m unexplained"
        )


def _levels(r: Response) -> str:
    low, high = math.isfinite(r.low), math.isfinite(r.high)
    if not (low or high):
        return "no saturation"
    sides = [f"{v:.4g}" for v, there in ((r.low, low), (r.high, high)) if there]
    return f"saturates at {' and '.join(sides)} N m"


def document_of(
    found: Alignment, marker: Marked | None, drives: list[Response | None], sources: dict[str, str]
) -> dict[str, Any]:
    """What was found as a table of plain numbers, SI units; intervals are those of 95 %."""
    clock = found.clock
    half = found.reach * found.error_at(clock.at)
    out: dict[str, Any] = {
        "clock": {
            "offset": clock.offset,
            "offset_interval": [clock.offset - half, clock.offset + half],
            "at": clock.at,
            "drift": clock.drift,
            "drift_interval": [
                clock.drift - found.reach * found.drift_error,
                clock.drift + found.reach * found.drift_error,
            ],
            "span": list(found.span),
            "settled": found.settled,
        },
        "sources": sources,
    }
    if not found.why:
        out["viscous"] = {
            "per_second_of_offset": found.viscous.tolist(),
            "found": found.found.tolist(),
        }
    if marker is not None:
        out["marker"] = {k: float(v) for k, v in marker._asdict().items()}
    out["command"] = [
        {
            "gain": r.gain,
            "bias": r.bias,
            "delay": r.delay,
            "errors": r.error.tolist(),
            **{k: v for k, v in (("low", r.low), ("high", r.high)) if math.isfinite(v)},
        }
        for r in drives
        if r is not None
    ]
    return out
