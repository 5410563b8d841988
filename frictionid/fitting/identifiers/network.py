"""Networks trained by gradients: all folds and joints as one model of stacked weights.

Steps are those of Adam [Kingma2015], with a rate that falls to zero along a cosine, and early
stopping by recordings held out inside each fold. What a fold learns depends on its own rows and on
the seed, not on the folds beside it.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from frictionid.arrays import Array
from frictionid.config import Count, Positive, validated
from frictionid.errors import InputError, needs
from frictionid.friction import Friction, Law
from frictionid.friction.laws.mlp import MLP, together
from frictionid.friction.laws.network_law import NetworkLaw, is_learned
from frictionid.friction.laws.state_laws import StateMLP

from ..identifier import Identifier
from ..one_step.residual import Problem, normalised
from .network_training import (
    Adam,
    Share,
    batches,
    check_compiler,
    compiled,
    friction_scales,
    held_out,
    member_seeds,
    padded_items,
)
from .sindy import accelerations

if TYPE_CHECKING:
    from .network_data import FoldStack, RowTrainingSet, SequenceTrainingSet


@validated
class Network(Identifier):
    """Trains the weights of a law: `MLP`, `WindowMLP`, `LSTM`, or a module of PyTorch.

    A `StateMLP` or a `StateLSTM` has the joints of the problem, all of whose rows are explained.

    epochs : passes through the rows, at most
    batch : rows of each fold in a step
    rate : the first learning rate
    share : of a fold's weight that is held out in it for early stopping
    patience : epochs without a lower held-out cost after which a fold stops
    members : networks with other initial weights and other recordings held out; friction is their
        mean
    inputs : "all" for an `MLP` that sees the velocities of all joints
    burn_in, targets : samples of a piece of a recording that fill the memory of recurrent networks,
        and samples after them that count
    device : "cpu" or "cuda"
    compile : let PyTorch compile the cost, with a C++ compiler; that takes half a minute first

    The sample time of a law with a memory of samples is that of the problem.
    """

    law: Law
    epochs: Count = 40
    batch: Count = 256
    rate: Positive = 1e-2
    share: Share = 0.15
    patience: Count = 10
    members: Count = 1
    inputs: Literal["own", "all"] = "own"
    burn_in: Annotated[int, Field(ge=0)] = 8
    targets: Count = 40
    device: Literal["cpu", "cuda"] = "cpu"
    compile: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.law, NetworkLaw):
            raise InputError(f"{self.law} has no weights to train: choose least squares")
        if self.inputs == "all" and not isinstance(self.law, MLP):
            raise InputError(f'inputs = "all" needs a law that sees other joints, such as {MLP()}')
        if self.device != "cpu":  # now: a comparison may have other work before this fit
            check_device(self.device)
        if self.compile:
            check_compiler()

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        scales = self._scales(problem, normalised(weights, problem))
        return self._fitted([problem] * len(weights), weights, scales, seed)

    def fit_each(self, problems: Sequence[Problem], weights: Array, seed: int) -> Friction | None:
        each = zip(problems, normalised(weights, problems[0]), strict=True)
        scales = np.concatenate([self._scales(p, weight[None]) for p, weight in each])
        return self._fitted(problems, weights, scales, seed)

    def _scales(self, problem: Problem, weights: Array) -> Array:
        """Scales (F, n, k) of the first parameters of the law."""
        of_states = isinstance(self.law, StateMLP)
        return (state_scales if of_states else friction_scales)(problem, weights)

    def _fitted(
        self, problems: Sequence[Problem], weights: Array, scales: Array, seed: int
    ) -> Friction:
        weights, law = normalised(weights, problems[0]), self.law
        if self.inputs == "all":
            law = replace(law, others=problems[0].r.shape[1] - 1)
        if isinstance(law, StateMLP):
            law = replace(law, joints=problems[0].r.shape[1])
        friction, costs = self.train(law, problems, weights, scales, seed)
        training, held = costs.round(5)
        return friction.noted({"learning": {"training": training, "held_out": held}})

    def train(
        self, law: Any, problems: Sequence[Problem], weights: Array, scales: Array, seed: int
    ) -> tuple[Friction, Array]:
        """Friction of a network law, and the costs (2, F, E) of its epochs, without friction 1.

        problems : of the same rows, one of each fold
        scales : (F, n, k) of the first k parameters of the law
        costs : in training and on what is held out; means over the members
        """
        from .network_data import FoldStack  # imports torch: late

        check_device(self.device)
        problem = problems[0]
        if law.sample_time is not None:
            law = replace(law, sample_time=float(np.median(problem.dt)))
        seeds = member_seeds(seed, self.members)
        draws = [np.random.default_rng(start) for start in seeds]
        initial = np.concatenate([law.initial_parameters(scales, rng) for rng in draws])
        held = np.concatenate([held_out(problem, weights, self.share, start) for start in seeds])
        weights = np.tile(weights, (self.members, 1))
        form: Any = problem.fitted_form(law)
        stack = FoldStack(form, [*problems] * self.members, initial, self.device)
        by_fold = [start for start in seeds for _ in range(len(scales))]
        theta, costs = self._descended(stack, weights * ~held, weights * held, by_fold)
        friction = together(law, np.split(theta, self.members))
        return friction, np.mean(np.split(costs, self.members, axis=1), axis=0)

    def _descended(
        self, stack: "FoldStack", training: Array, held: Array, seeds: Sequence[Sequence[int]]
    ) -> tuple[Array, Array]:
        """Parameters (F, n, P) at the lowest held-out costs, and costs (2, F, E) of the epochs.

        A fold stops after `patience` epochs without a lower cost, and keeps what it has then.

        training, held : weights (F, K) of the rows that are fitted and of those that are held out
        """
        with needs("networks"):
            import torch

        fitted, held_out_set = (self._training_set(stack, part) for part in (training, held))
        rows, per_item = len(stack.problem.r), fitted.rows_per_item
        # a batch larger than all rows, or the default, would only repeat them
        size = max(1, min(self.batch, max(rows, Network.batch)) // per_item)
        steps = -(-rows // (size * per_item))
        draws = batches(fitted.used, size, seeds)
        held_items = stack.tensor(padded_items(held_out_set.used, held_out_set.items))
        cost = compiled(fitted.cost) if self.compile else fitted.cost
        theta = stack.tensor(stack.theta).requires_grad_()
        adam = Adam(theta, stack.tensor(is_learned(stack.law)))
        best, since = theta.detach().clone(), stack.tensor(np.zeros(len(stack.theta)))
        lowest, costs = since + math.inf, []
        for epoch in range(self.epochs):
            rates = [self._rate(epoch + step / steps) for step in range(steps)]
            each = (adam.step(cost(theta, stack.tensor(next(draws))), rate) for rate in rates)
            during = sum(before / steps for before in each)
            with torch.no_grad():
                after = held_out_set.cost(theta, held_items)
            costs.append(torch.stack([during, after]).cpu().numpy())
            running = since < self.patience
            better = running & (after < lowest)
            best[better] = theta.detach()[better]
            lowest = after.where(better, lowest)
            since = (since + running) * ~better
            if bool((since >= self.patience).all()):
                break
        return best.cpu().numpy(), np.stack(costs, axis=-1)

    def _rate(self, epoch: float) -> float:
        """Learning rate: a cosine from the first rate to zero."""
        return self.rate * (0.5 * (1.0 + math.cos(math.pi * epoch / self.epochs)))

    def _training_set(
        self, stack: "FoldStack", weights: Array
    ) -> "RowTrainingSet | SequenceTrainingSet":
        from .network_data import RowTrainingSet, SequenceTrainingSet

        if not stack.law.cells:
            return RowTrainingSet(stack, weights)
        nodes = stack.problem.nodes
        longest = -(-int(np.diff(nodes.first).max()) // nodes.per_sample)
        if self.burn_in > max(longest, Network.burn_in):
            raise InputError(
                f"burn_in = {self.burn_in} samples is more than the longest recording has "
                f"({longest}): choose a smaller one"
            )
        # pieces longer than a recording hold the recording, and nothing more
        targets = min(self.targets, max(longest, Network.targets))
        return SequenceTrainingSet(stack, weights, self.burn_in, targets)


def check_device(device: str) -> None:
    """Refuse a device that is not there."""
    with needs("networks"):
        import torch

    if device == "cuda" and not torch.cuda.is_available():
        raise InputError(
            'device = "cuda": PyTorch sees no CUDA device here: leave the device out, or install '
            "PyTorch with CUDA"
        )


_SMALLEST = 1e-3  # of the largest speed or torque of any joint


def state_scales(problem: Problem, weights: Array) -> Array:
    """Root mean squares (F, n, 3) of each joint's acceleration, and of speeds and torques of all.

    Of speeds and torques, the same for all joints, those of the joint that has most of it.
    """
    y, _ = accelerations(problem)
    inputs = problem.nodes.inputs
    share = weights / weights.sum(axis=1, keepdims=True)
    out = np.empty((len(weights), y.shape[1], 3))
    out[..., 0] = np.sqrt(share @ y**2)
    for i, values in enumerate((inputs.w, inputs.u), start=1):
        size = np.sqrt((share @ problem.mean(values) ** 2).max(axis=1, keepdims=True))
        out[..., i] = np.where(size > 0, size, 1.0)
    return np.maximum(out, _SMALLEST * out.max(axis=1, keepdims=True))
