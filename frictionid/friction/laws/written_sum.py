"""Sums of terms as people write them, with intervals of the coefficients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array


def written_sum(coefficients: Array, half: Array | None, terms: Sequence[str]) -> str:
    """Text of the sum of coefficients (P,) times terms, but for those that are zero.

    half : (P,), half widths of intervals, written behind those coefficients where they are finite

    >>> written_sum(np.array([-2.0, 0.0, 0.5]), np.array([0.1, 0.1, np.nan]), ["w", "w^2", ""])
    '-(2 +- 0.1) w + 0.5'
    """
    half = np.full(len(terms), np.nan) if half is None else half
    parts = [
        ("-" if value < 0 else "+", f"{_number(abs(value), wide)} {term}".rstrip())
        for value, wide, term in zip(coefficients, half, terms, strict=True)
        if value != 0
    ]
    text = " ".join(f"{sign} {part}" for sign, part in parts) or "+ 0"
    return text.removeprefix("+ ") if text[0] == "+" else f"-{text[2:]}"


def _number(value: float, half: float) -> str:
    return f"({value:.4g} +- {half:.2g})" if np.isfinite(half) else f"{value:.4g}"
