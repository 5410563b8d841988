"""Seeds of the members of an ensemble, that of the first being its own."""

from __future__ import annotations


def member_seeds(seed: int, members: int) -> list[list[int]]:
    """Seed of each member: an ensemble of one is the network itself.

    >>> member_seeds(7, 3)
    [[7], [7, 1], [7, 2]]
    """
    return [[seed, k] if k else [seed] for k in range(members)]
