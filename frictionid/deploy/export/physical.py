"""Physical parameters of a mechanism that has given base parameters."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism

_EXACT = 1e-9


def physical_parameters(mechanism: Mechanism, base: Array) -> dict[str, float]:
    """Physical parameters with these base parameters (nb), near the mechanism's own.

    Motion shows the base parameters only; of the many masses, lengths and inertias that have them,
    these differ little from the nominal ones, in proportion. Parameters that are zero stay zero,
    and gravity stays.

    Raises
    ------
    InputError
        Where no positive parameters have them.

    Examples
    --------
    >>> from frictionid.mechanics import pendulum
    >>> m = pendulum(mass=0.4, length=0.25)
    >>> found = physical_parameters(m, 1.21 * m.base(m.nominal()))
    >>> round(found["mass"], 6), round(found["length"], 6)
    (0.484, 0.25)
    """
    nominal = mechanism.nominal()
    names = [k for k, v in nominal.items() if v and k not in ("g", "gr", "gravity")]
    start = np.array([nominal[k] for k in names])
    size = np.maximum(np.abs(base), 1e-3 * np.abs(base).max())

    def values(x: Array) -> dict[str, float]:
        return nominal | dict(zip(names, map(float, start * np.exp(x)), strict=True))

    def off(x: Array) -> Array:
        return np.asarray((mechanism.base(values(x)) - base) / size)

    # Gauss-Newton by minimum norm: of all solutions near the start, one that changes little
    found = least_squares(off, np.zeros(len(names)), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    if np.abs(found.fun).max() > _EXACT:
        raise InputError(
            f"{mechanism.kind}: no positive masses, lengths and inertias have the model's base "
            "parameters; name an MJCF (--into), and correct its inertias by the model's"
        )
    return values(found.x)
