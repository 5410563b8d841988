"""An alignment as text, and as a document beside the recording."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from frictionid.mechanics import Mechanism
from frictionid.rig.align.clock import Alignment
from frictionid.rig.align.drive_response import DriveResponse
from frictionid.rig.align.sync_edges import MarkerClock

_WIDE = 1e-3  # [s], half-width of an interval from which on the offset is too uncertain
_LARGE = 0.1  # share of a viscous coefficient from which on the clock's uncertainty matters

Responses = list[DriveResponse | None]


def alignment_text(
    alignment: Alignment, mechanism: Mechanism, marker: MarkerClock | None, responses: Responses
) -> str:
    """Result of an alignment, a line for each quantity."""
    parts = (
        _clock(alignment),
        _viscous(alignment, mechanism),
        _marker(alignment, marker),
        _responses(responses),
    )
    return "\n".join(line for part in parts for line in part)


def _clock(alignment: Alignment) -> Iterator[str]:
    clock, t = alignment.clock, alignment.t_quantile
    begin, end = alignment.span
    if alignment.marker_only:
        yield f"warning  the clocks are aligned by the marker alone: {alignment.marker_only}"
    yield (
        f"offset   {clock.offset:.5f} s, 95 % interval "
        f"+-{1e3 * t * alignment.error_at(clock.at):.3f} ms, at {clock.at:.2f} s of the log's clock"
    )
    yield (
        f"drift    {1e6 * clock.drift:.1f} ppm, +-{1e6 * t * alignment.drift_error:.1f} ppm "
        f"({'the log' if clock.drift > 0 else 'the camera'}'s clock is too slow)"
    )
    yield (
        f"span     {begin:.2f} to {end:.2f} s of the log's clock; at its ends the offset is known "
        f"to +-{1e3 * t * alignment.error_at(begin):.3f} and "
        f"+-{1e3 * t * alignment.error_at(end):.3f} ms"
    )
    coarse = alignment.coarse
    if math.isfinite(coarse.unexplained):
        yield (
            f"match    leaves {100 * coarse.unexplained:.2g} % of the torque unexplained, the next "
            f"best offset {_percent(coarse.runner_up[1])}"
        )
    half = max(t * alignment.error_at(time) for time in (begin, end))
    if half > _WIDE:
        yield (
            f"warning  the offset is known to {1e3 * half:.1f} ms only: record longer, or livelier "
            "motion in which the driven joints slide most of the time"
        )
    if not alignment.converged:
        yield "warning  the fit did not converge: its intervals are too narrow"


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %" if math.isfinite(share) else "none"


def _viscous(alignment: Alignment, mechanism: Mechanism) -> Iterator[str]:
    """Effect of the offset, and of its interval, on viscous friction."""
    if alignment.marker_only:
        return
    half = alignment.t_quantile * alignment.error_at(alignment.clock.at)
    units = zip(mechanism.torque_units, mechanism.position_units, strict=True)
    numbers = zip(alignment.viscous_slope, alignment.viscous, strict=True)
    for name, (force, angle), (slope, value) in zip(mechanism.joints, units, numbers, strict=True):
        uncertain = abs(slope) * half
        share = f", {100 * uncertain / abs(value):.2g} % of it" if value else ""
        yield (
            f"viscous  of {name}: 1 ms of offset changes it by {1e-3 * slope:.2g} "
            f"{force} s/{angle}; the interval of the offset by +-{uncertain:.2g}{share}"
            + ("; it is not known better" if value and uncertain > _LARGE * abs(value) else "")
        )


def _marker(alignment: Alignment, marker: MarkerClock | None) -> Iterator[str]:
    if marker is None:
        return
    delay = alignment.clock.offset_at(marker.at) - marker.offset
    both = math.hypot(1.96 * marker.error, alignment.t_quantile * alignment.error_at(marker.at))
    yield (
        f"marker   {marker.edges} edges: offset {marker.offset:.5f} s, "
        f"+-{1.96e3 * marker.error:.2f} ms, at {marker.at:.2f} s"
    )
    if alignment.marker_only:
        yield "marker   a delay between log and torque remains unknown: fit it, too"
    elif abs(delay) > both:
        yield (
            f"marker   by the motion the torque acts {1e3 * delay:.2f} ms later than it was logged "
            f"(+-{1e3 * both:.2f} ms): a delay of the drive; the data set has the motion's clock"
        )
    else:
        yield f"marker   and motion agree ({1e3 * delay:.2f} ms apart, +-{1e3 * both:.2f} ms)"


def _responses(responses: Responses) -> Iterator[str]:
    for k, r in enumerate(responses, start=1):
        label = "command " if len(responses) == 1 else f"motor {k} "
        if r is None:
            yield f"{label} does not change: nothing to compare the measured torque with"
            continue
        e = r.t_quantile * r.error
        yield (
            f"{label} measured = {r.gain:.4f} (+-{e[0]:.4f}) command {r.bias:+.4g} (+-{e[1]:.2g}) "
            f"N m, {1e3 * r.delay:.2f} (+-{1e3 * e[2]:.2f}) ms later; {_saturation(r)}; "
            f"{r.rms:.2g} N m unexplained"
        )


def _saturation(r: DriveResponse) -> str:
    levels = [f"{level:.4g}" for level in (r.low, r.high) if math.isfinite(level)]
    return f"saturates at {' and '.join(levels)} N m" if levels else "no saturation"


def alignment_document(
    alignment: Alignment,
    marker: MarkerClock | None,
    responses: Responses,
    sources: dict[str, str],
) -> dict[str, Any]:
    """The alignment as a table of plain numbers in SI units; intervals are those of 95 %."""
    clock, t = alignment.clock, alignment.t_quantile
    offset, drift = t * alignment.error_at(clock.at), t * alignment.drift_error
    out: dict[str, Any] = {
        "clock": {
            "offset": clock.offset,
            "offset_interval": [clock.offset - offset, clock.offset + offset],
            "at": clock.at,
            "drift": clock.drift,
            "drift_interval": [clock.drift - drift, clock.drift + drift],
            "span": list(alignment.span),
            "converged": alignment.converged,
        },
        "sources": sources,
    }
    if not alignment.marker_only:
        out["viscous"] = {
            "estimate": alignment.viscous.tolist(),
            "per_second_of_offset": alignment.viscous_slope.tolist(),
        }
    if marker is not None:
        out["marker"] = {k: float(v) for k, v in marker._asdict().items()}
    out["command"] = [_response_table(r) for r in responses if r is not None]
    return out


def _response_table(r: DriveResponse) -> dict[str, Any]:
    levels = {name: getattr(r, name) for name in ("low", "high")}
    return {
        "gain": r.gain,
        "bias": r.bias,
        "delay": r.delay,
        "errors": r.error.tolist(),
        **{name: level for name, level in levels.items() if math.isfinite(level)},
    }
