"""A network of one's own: any module of PyTorch, as the friction of each joint."""

from dataclasses import dataclass

import torch

from frictionid.fitting.identifiers.network import Network
from frictionid.friction.laws import TorchModule


class Bumps(torch.nn.Module):
    """Maps (rows, 2), speed and direction, to (rows, 1): a sum of bumps along the speed."""

    def __init__(self, count: int = 12):
        super().__init__()
        self.centre = torch.nn.Parameter(torch.linspace(0.0, 1.0, count))
        self.height, self.side = (torch.nn.Parameter(torch.zeros(count)) for _ in range(2))

    def forward(self, x):
        """Level before it is made positive."""
        speed, direction = x[..., :1], x[..., 1:]
        bumps = torch.exp(-((12.0 * (speed.sqrt() - self.centre)) ** 2))
        return (bumps * (self.height + self.side * direction)).sum(-1, keepdim=True)


@dataclass(frozen=True)
class OwnLaw(TorchModule):
    """Its law, with which `frictionid evaluate --law own_network:OwnLaw` reads its models."""

    module: torch.nn.Module = Bumps()


def own_network(epochs: int = 60) -> Network:
    """Identifier of the network, for suites: kind = "own_network:own_network"."""
    return Network(OwnLaw(), epochs=epochs)
