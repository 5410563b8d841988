"""Models of other libraries as laws: regressors of scikit-learn, and networks of PyTorch.

Networks are learnt as `MLP` [DeMeester2020], their weights in one row of theta.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import needs
from frictionid.friction import Inputs, Law, LawParameter, Memory

from ..law import smooth_sign
from .layers import laid, stacked, unlaid
from .network_law import LevelNetwork, side_of, within


@dataclass(frozen=True, eq=False)
class Predicted(Law):
    """What one of the `models` predicts from `inputs`; theta holds its number.

    models : fitted regressors of features (B, 2 + others), see `features`
    inputs : "w", and "q", "u" of the joint
    width : of the smooth sign [rad/s]
    """

    models: tuple[Any, ...]
    inputs: tuple[str, ...] = ("w",)
    width: float = 0.02
    parameters: ClassVar = (LawParameter("model", "1"),)
    shape = ""
    kind = ""
    cannot_be_saved = "regressors of more than the velocity are no curve: use them in Python"

    def __repr__(self) -> str:
        return f"Predicted({len(self.models)} models of {', '.join(self.inputs)})"

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        which = np.asarray(theta[..., 0] + 0.0 * x.w).astype(int)
        parts = features(x, self.inputs, self.width)
        table = np.stack([np.broadcast_to(part, which.shape) for part in parts], axis=-1)
        out = np.empty(which.shape)
        for i in np.unique(which):
            out[which == i] = self.models[i].predict(table[which == i])
        return out

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        side = np.where(x.w > 0, 1.0, -1.0)
        beyond = self.torque(theta, x._replace(w=3.0 * self.width * side), memory)
        return np.maximum(side * beyond, 0.0)


def features(x: Inputs, inputs: Sequence[str], width: float) -> list[Array]:
    """What regressors see, each (...): smooth sign and asinh of w, on which friction bends alike.

    Other inputs as they are.
    """
    others = (getattr(x, name) for name in inputs if name != "w")
    return [smooth_sign(x.w, width), np.arcsinh(x.w), *others]


@dataclass(frozen=True)
class TorchModule(LevelNetwork):
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
    sizes: ClassVar = (2, 1)

    @property
    def weights(self) -> int:
        return sum(p.numel() for p in self.module.parameters())

    @cached_property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return ((*(scale.initial[0] for scale in self.scales), *self._module_weights().tolist()),)

    def _module_weights(self) -> Array:
        parts = [p.detach().double().numpy().ravel() for p in self.module.parameters()]
        return np.concatenate(parts)

    def drawn(self, rng: np.random.Generator) -> Array:
        weights = self._module_weights()  # and a tenth of their size at random
        return weights + 0.1 * weights.std() * rng.standard_normal(len(weights))

    def inputs(self, theta: Array, x: Inputs, speed: Array, memory: Memory) -> Array:
        return stacked([within(speed / theta[..., 1]), side_of(x.w)])

    def network(self, theta: Array, z: Array) -> Array:
        with needs("networks"):
            import torch  # late: who has no such law need not wait for it

        row: Any
        inputs: Any
        weights = self.layer_weights(theta)
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

        named, first = {}, 0
        for name, p in self.module.named_parameters():
            named[name] = row[first : first + p.numel()].reshape(p.shape)
            first += p.numel()
        return torch.func.functional_call(self.module, named, (inputs,))
