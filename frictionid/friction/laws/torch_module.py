"""Any network of PyTorch as a friction law, its weights in one row of theta."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import laid, unlaid
from frictionid.friction.laws.learned import (
    BOUNDS,
    FREE,
    HEAD,
    START,
    UNITS,
    level_of,
    side_of,
    stacked,
    weight_names,
    within,
)
from frictionid.friction.laws.smooth_sign import check_sign, smooth_sign


@dataclass(frozen=True)
class TorchModule:
    """Tf = level sgn(w), the level what a `module` of PyTorch makes of speed and direction.

    module : maps (rows, 2), the speed over the fastest measured one and the direction, 1 or -1, to
        (rows, 1). Each joint has weights of its own; they begin at the module's.
    dissipative, monotone_tail, width, shape : as in `MLP`

    A model file of it can be read only where the class is at hand.
    """

    module: Any = field(metadata={"saved": False})
    dissipative: bool = True
    monotone_tail: bool = True
    width: float = 0.02
    shape: str = "tanh"
    sample_time: ClassVar[float | None] = None
    uses_load: ClassVar[bool] = False
    network: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_sign("torch_module", self.width, self.shape)

    @property
    def names(self) -> tuple[str, ...]:
        return HEAD + weight_names(self._count)

    @property
    def units(self) -> tuple[str, ...]:
        return UNITS + ("1",) * self._count

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return BOUNDS + (FREE,) * self._count

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return ((*START, *self._weights().tolist()),)

    @property
    def _count(self) -> int:
        return sum(p.numel() for p in self.module.parameters())

    def _weights(self) -> Array:
        parts = [p.detach().double().numpy().ravel() for p in self.module.parameters()]
        return np.concatenate(parts)

    def begin(self, torque: Array, speed: Array, rng: np.random.Generator) -> Array:
        """Parameters (..., n, P) to learn from; a tenth of the weights' size is drawn."""
        head = np.stack([torque, speed, 0.0 * torque + START[2]], axis=-1)
        first = self._weights()
        drawn = first + 0.1 * first.std() * rng.standard_normal((torque.shape[-1], len(first)))
        return np.concatenate([head, np.broadcast_to(drawn, (*torque.shape, len(first)))], axis=-1)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return ()

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        speed = namespace(x.w).abs(x.w)
        return self._level(theta, speed, side_of(x.w)) * smooth_sign(x.w, self.width, self.shape)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return memory

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = self._level(theta, 0.0 * x.w, side_of(x.w))
        return namespace(level).maximum(level, 0.0 * level)

    def _level(self, theta: Array, speed: Array, side: Array) -> Array:
        share = speed / theta[..., 1]
        y = self._outputs(theta[..., 3:], stacked([within(share), side]))
        return level_of(theta, y, share, self.dissipative, self.monotone_tail)

    def _outputs(self, weights: Array, z: Array) -> Array:
        """Outputs (..., n) of the module with each set of weights."""
        import torch  # late: who has no such law need not wait for it

        row, inputs, many = laid(torch.as_tensor(weights), torch.as_tensor(z))
        sets = np.broadcast_shapes(row.shape[:-1], inputs.shape[:-2])
        row = row.expand(*sets, row.shape[-1]).reshape(-1, row.shape[-1])
        inputs = inputs.expand(*sets, *inputs.shape[-2:]).reshape(-1, *inputs.shape[-2:])
        y = torch.func.vmap(self._one, randomness="error")(row, inputs)
        out = unlaid(y.reshape(*sets, *y.shape[-2:]), many)[..., 0]
        return out if torch.is_tensor(weights) or torch.is_tensor(z) else out.detach().numpy()

    def _one(self, row: Any, inputs: Any) -> Any:
        """Outputs (rows, 1) of the module with one row of weights."""
        import torch

        named, at = {}, 0
        for name, p in self.module.named_parameters():
            named[name] = row[at : at + p.numel()].reshape(p.shape)
            at += p.numel()
        return torch.func.functional_call(self.module, named, (inputs,))
