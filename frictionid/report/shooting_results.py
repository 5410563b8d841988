"""Results of shooting as facts: the machine and its sensors, and what is not identified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import stdtrit

from frictionid.fitting.parameters.parameter_block import IDEAL
from frictionid.report.estimates import Estimate, correlation_of, names_of

LATE = ("delay", "target_delay")
LIKE_DELAY = ("viscous", "lag")  # friction parameters that a late torque styles like


@dataclass(frozen=True)
class Calibration:
    """An identified parameter of a sensor or motor.

    text : value with its 95 % interval, delays in ms
    side : 1 above the ideal value, -1 below it, 0 where the interval holds it
    change : difference from the nominal value [%], or None
    """

    block: str
    name: str
    unit: str
    text: tuple[str, str, str]
    side: int
    nominal: float | None
    change: tuple[str, str, str] | None


@dataclass(frozen=True)
class ShootingResults:
    """What a fit by shooting tells beside friction, and what limits it.

    Attributes
    ----------
    calibration : identified parameters of sensors and motors
    nominal : number of identified base parameters with a nominal value
    differing : names of those whose interval does not hold it, with the difference [%]
    known, missed : number of identified parameters with a known true value; those names whose
        interval does not hold it
    delay_fixed : friction parameters that hold the share of a delay that was not free
    delay_explains : those that a delay within its interval explains entirely
    document : the result document, for windows, iterations and warnings of the fit itself
    """

    calibration: tuple[Calibration, ...]
    nominal: int
    differing: tuple[tuple[str, tuple[str, str, str]], ...]
    known: int
    missed: tuple[str, ...]
    not_identified: tuple[Estimate, ...]
    delay_fixed: tuple[str, ...]
    delay_explains: tuple[str, ...]
    priors: tuple[str, ...]
    document: Mapping[str, Any]

    @property
    def warnings(self) -> Sequence[str]:
        """Warnings of the fit itself."""
        warnings: Sequence[str] = self.document.get("warnings", ())
        return warnings


def shooting_results(document: Mapping[str, Any], read: Sequence[Estimate]) -> ShootingResults:
    """Facts of a result document; `read` are its estimates."""
    identified = [e for e in read if e.identified]
    order = (*IDEAL, "actuator")
    sensors = sorted(
        (e for e in identified if e.block in order), key=lambda e: order.index(e.block)
    )
    inertia = [e for e in identified if e.block == "inertia" and e.nominal]
    differing = [e for e in inertia if not e.holds(e.nominal or 0.0)]
    differing.sort(key=lambda e: -abs(e.value / (e.nominal or 1.0) - 1.0))
    known = [e for e in identified if e.true is not None]
    return ShootingResults(
        calibration=tuple(map(_calibration, sensors)),
        nominal=len(inertia),
        differing=tuple((e.name, e.change()) for e in differing),
        known=len(known),
        missed=names_of(e for e in known if e.true is not None and not e.holds(e.true)),
        not_identified=tuple(e for e in read if not e.identified),
        delay_fixed=delay_fixed(document, read),
        delay_explains=delay_explains(document, read),
        priors=names_of(e for e in read if e.prior),
        document=document,
    )


def _calibration(e: Estimate) -> Calibration:
    ideal = IDEAL.get(e.block)
    side = 0 if ideal is None or e.holds(ideal) else int(np.sign(e.value - ideal))
    late = e.block in LATE
    change = e.change() if e.block == "actuator" and e.nominal else None
    unit = "ms" if late else "" if e.block == "gain" else e.unit
    return Calibration(e.block, e.name, unit, e.span(1e3 if late else 1.0), side, e.nominal, change)


def _like_delay(read: Sequence[Estimate]) -> list[Estimate]:
    """Friction parameters that a late torque styles like."""
    friction = [e for e in read if e.block == "friction"]
    return [e for e in friction if e.parameter.partition("_")[0] in LIKE_DELAY]


def delay_fixed(document: Mapping[str, Any], read: Sequence[Estimate]) -> tuple[str, ...]:
    """Friction parameters that hold a delay's share, where a motor pulls and no delay was free."""
    free = any(e.block in LATE for e in read)
    free |= any(own["block"] in LATE for own in document.get("dropped", ()))
    return () if free or not document.get("driven", False) else names_of(_like_delay(read))


def delay_explains(document: Mapping[str, Any], read: Sequence[Estimate]) -> tuple[str, ...]:
    """Friction parameters that a delay within its own 95 % interval explains entirely.

    Such a delay moves a parameter by up to |r| t s, r their correlation, s the parameter's standard
    error and t the quantile of Student's distribution: is that its whole value, nothing is left.
    """
    delays = [i for i, e in enumerate(read) if e.block in LATE]
    if not delays:
        return ()
    r = dict(zip(read, np.abs(correlation_of(document)[delays[0]]), strict=True))
    quantile = float(stdtrit(document["freedom"], 0.975))
    return names_of(
        e
        for e in _like_delay(read)
        if np.isfinite(e.error) and r[e] * quantile * e.error >= abs(e.value)
    )
