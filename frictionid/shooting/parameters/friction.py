"""The block of the friction law's own parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.shooting.parameters.parameter_block import Block, Entry, Guess, checked


@dataclass(frozen=True)
class FrictionBlock:
    """Parameters of the law, but for those whose names are `fixed`.

    `prior` is a standard deviation relative to each value. `support` are the places (joint,
    parameter) that may be free, None for all: see `on_support`.
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    support: tuple[tuple[int, int], ...] | None = None
    name: str = "friction"
    enters: str = "friction"

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        law, theta = guess.friction.law, np.asarray(guess.friction.theta)
        for name in self.fixed:
            if name not in law.names:
                raise InputError(
                    f"block 'friction': {law} has no parameter {name!r} to fix; "
                    f"known are {', '.join(law.names)}"
                )
        relative = checked(self.prior, self.name)
        joints = guess.mechanism.description.joints
        units = guess.friction.units
        return tuple(
            Entry(
                block=self.name,
                name=f"{name} of {joints[j]}",
                unit=units[i],
                value=float(theta[j, i]),
                low=law.bounds[i][0],
                high=law.bounds[i][1],
                prior=relative * max(abs(float(theta[j, i])), 1e-12) if self.prior else relative,
                place=(j, i),
            )
            for j in range(theta.shape[0])
            for i, name in enumerate(law.names)
            if name not in self.fixed and (self.support is None or (j, i) in self.support)
        )

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        theta = np.array(guess.friction.theta, dtype=float)
        for entry, value in zip(entries, values, strict=True):
            theta[entry.place] = value
        return guess._replace(friction=replace(guess.friction, theta=theta))


def on_support(blocks: Sequence[Block], friction: Friction) -> tuple[Block, ...]:
    """The blocks; where the law is sparse, friction's only frees what the friction (n, P) has."""
    if not friction.law.is_sparse:
        return tuple(blocks)
    has = tuple((int(j), int(i)) for j, i in np.argwhere(np.asarray(friction.theta) != 0))
    return tuple(replace(b, support=has) if isinstance(b, FrictionBlock) else b for b in blocks)
