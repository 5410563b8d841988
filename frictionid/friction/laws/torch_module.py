"""Any network of PyTorch as a law, as `MLP` [DeMeester2020], its weights in one row of theta."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.errors import needs
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import laid, unlaid
from frictionid.friction.laws.levels import above_zero
from frictionid.friction.laws.network_law import (
    Features,
    NetworkLaw,
    level_of,
    side_of,
    stacked,
    within,
)
from frictionid.friction.smooth_sign import smooth_sign


@dataclass(frozen=True)
class TorchModule(NetworkLaw):
    """Tf = level sgn(w), the level what a `module` of PyTorch makes of speed and direction.

    module : maps (rows, 2), the speed over the fastest measured one and the direction, 1 or -1, to
        (rows, 1). Each joint has weights of its own; they begin at the module's.
    dissipative, monotone_tail, width, shape : as in `MLP`

    A model file of it can be read only where the class is at hand.
    """

    module: Any
    dissipative: bool = True
    monotone_tail: bool = True
    width: float = 0.02
    shape: str = "tanh"
    left_out_of_files = ("module",)
    kind = ""

    @property
    def sizes(self) -> tuple[int, ...]:
        return (2, 1)

    @property
    def weights(self) -> int:
        return sum(p.numel() for p in self.module.parameters())

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return ((*(scale.start for scale in self.scales), *self._own().tolist()),)

    def _own(self) -> Array:
        """Weights of the module."""
        parts = [p.detach().double().numpy().ravel() for p in self.module.parameters()]
        return np.concatenate(parts)

    def drawn(self, rng: np.random.Generator) -> Array:
        own = self._own()  # and a tenth of their size at random
        return own + 0.1 * own.std() * rng.standard_normal(len(own))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        still = 0.0 * (x.w + theta[..., 0])
        return above_zero(self.level(theta, stacked([still, side_of(x.w)]), still))

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        share = namespace(x.w).abs(x.w) / theta[..., 1]
        z = stacked([within(share), side_of(x.w)])
        return Features(z, share, smooth_sign(x.w, self.width, self.shape))

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        y = self._outputs(theta[..., 3:], z)
        return level_of(theta, y, share, self.dissipative, self.monotone_tail)

    def _outputs(self, weights: Array, z: Array) -> Array:
        """Outputs (..., n) of the module with each set of weights."""
        with needs("networks"):
            import torch  # late: who has no such law need not wait for it

        row: Any
        inputs: Any
        row, inputs, many = laid(torch.as_tensor(weights), torch.as_tensor(z))
        sets = np.broadcast_shapes(row.shape[:-1], inputs.shape[:-2])
        row = row.expand(*sets, row.shape[-1]).reshape(-1, row.shape[-1])
        inputs = inputs.expand(*sets, *inputs.shape[-2:]).reshape(-1, *inputs.shape[-2:])
        y = torch.func.vmap(self._applied, randomness="error")(row, inputs)
        out: Any = unlaid(y.reshape(*sets, *y.shape[-2:]), many)[..., 0]
        return out if torch.is_tensor(weights) or torch.is_tensor(z) else out.detach().numpy()

    def _applied(self, row: Any, inputs: Any) -> Any:
        """Outputs (rows, 1) of the module with one row of weights."""
        import torch

        named, at = {}, 0
        for name, p in self.module.named_parameters():
            named[name] = row[at : at + p.numel()].reshape(p.shape)
            at += p.numel()
        return torch.func.functional_call(self.module, named, (inputs,))
