"""Classic mistakes in recordings: what `check` says of each, and what the fit would have been.

    python comparisons/failures.py            # the table of docs/failures.md

Each mistake is made in a copy of a simulated acrobot whose friction is known; Stribeck friction
with a level in each direction is then fitted in one step, and by shooting with inertia and delay
free. A bias of the torque and the difference of the levels say the same.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from outliers import error_of as curve_errors

import frictionid as fid
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Signal

LATE = 0.03  # [s]
GEAR = 2.0
_FAR = 10.0  # times as large: nothing of the friction is left


def changed(data: Dataset, quantity: str, change: Callable[[Signal], Signal]) -> Dataset:
    """The data set with other signals of a quantity, "angle" or "torque"."""
    new = [replace(r, **{quantity: change(getattr(r, quantity))}) for r in data.recordings]
    return replace(data, recordings=tuple(new))


def held(signal: Signal) -> Signal:
    """Every second sample repeats the one before."""
    value = signal.value.copy()
    value[1::2] = value[0::2][: len(value[1::2])]
    return signal._replace(value=value)


def without_rotor() -> Dataset:
    """The second simulated acrobot with its torque's clock corrected: only the rotor is missing."""
    data = fid.load_dataset("acrobot_sim")
    delay = data.truth["rig"]["torque_delay"]
    return changed(data, "torque", lambda u: u._replace(time=u.time + delay))


def mistakes() -> Mapping[str, Callable[[], Dataset]]:
    """Data sets with one mistake, by its name."""
    good = fid.load_dataset("acrobot_clean")
    return {
        "nothing": lambda: good,
        f"torque logged {1e3 * LATE:g} ms late": lambda: changed(
            good, "torque", lambda u: u._replace(time=u.time + LATE)
        ),
        "unsigned torque": lambda: changed(
            good, "torque", lambda u: u._replace(value=np.abs(u.value))
        ),
        "degrees taken for radians": lambda: changed(
            good, "angle", lambda q: q._replace(value=np.degrees(q.value))
        ),
        "held samples (30 Hz as 60 Hz)": lambda: changed(good, "angle", held),
        f"wrong gear (torque {GEAR:g} times)": lambda: changed(
            good, "torque", lambda u: u._replace(value=GEAR * u.value)
        ),
        "rotor inertia missing": without_rotor,
    }


def consequence(data: Dataset) -> Iterator[str]:
    """What `check` says first, and the curve errors of a fit in one step, and of one by default."""
    verdict = fid.check(data)
    yield next(iter(verdict.findings.text), "nothing")
    yield error_of(data, "one_step")
    yield error_of(data, None, ["inertia", "delay"])


def error_of(data: Dataset, method: str | None, free: list[str] | None = None) -> str:
    """Curve errors of the joints, or that there is no fit."""
    try:
        fit = fid.fit(data, "stribeck", method=method, free=free, settings={"symmetric": False})
    except fid.InputError:
        return "no fit"
    return " / ".join(map(share, curve_errors(fit.friction, data)))


def share(error: float) -> str:
    """A relative error in words.

    >>> share(0.0123), share(0.997), share(4.67), share(275.0)
    ('1.2 %', '100 %', '4.7 times', 'over 10 times')
    """
    if error < 1:
        return f"{float(f'{100 * error:.2g}'):g} %"
    return f"{error:.2g} times" if error < _FAR else f"over {_FAR:g} times"


def main() -> int:
    """Print the table."""
    print("| mistake | what `check` says first | curves wrong by, in one step | by default |")
    print("| --- | --- | --- | --- |")
    for name, make in mistakes().items():
        found, *errors = consequence(make())
        print(f"| {name} | {' '.join(found.split())} | {' | '.join(errors)} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
