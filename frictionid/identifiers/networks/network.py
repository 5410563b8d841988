"""Networks trained by gradients: all folds and joints as one model of stacked weights.

Steps are those of Adam [Kingma2015] under a rate that falls to zero along a cosine. Recordings that
are held out inside each fold tell when it was best. What a fold learns depends on its own rows and
on the seed, not on the folds beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.laws.ensemble import together
from frictionid.friction.laws.mlp import MLP
from frictionid.friction.laws.network_law import NetworkLaw, is_learned
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.networks.adam import Adam
from frictionid.identifiers.networks.batches import batches, side_by_side
from frictionid.identifiers.networks.compiled import check_compiler, compiled
from frictionid.identifiers.networks.early_stopping import check_share, held_out
from frictionid.identifiers.networks.ensemble_seeds import member_seeds
from frictionid.identifiers.networks.scales import speed_scale, torque_scale
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import normalised

_LONGEST = 1.0  # gradient of a cost that is one without friction


@dataclass(frozen=True)
class Network(Identifier):
    """Trains the weights of a law: `MLP`, `WindowMLP`, `LSTM`, or a module of PyTorch.

    epochs : how often the rows are gone through, at most; a fold ends where `patience` of them have
        brought no better cost on the recordings held out in it, a `share` of its weight
    batch : rows of each fold in a step, no more than there are
    rate : the first learning rate
    members : networks with other starts and other recordings held out; friction is their mean
    inputs : "all" for an `MLP` that sees the velocities of all joints
    burn_in, targets : a law that reads samples learns from pieces of recordings, so many samples to
        fill its memory and so many that count
    device : "cpu", or "cuda" where there is one
    compile : let PyTorch compile the cost, with a C++ compiler; that takes half a minute first

    The sample time of a law that remembers samples is that of the problem.

    Raises
    ------
    InputError
        For settings that mean nothing, or a device or compiler that is not there.
    """

    law: Any
    epochs: int = 40
    batch: int = 256
    rate: float = 1e-2
    share: float = 0.15
    patience: int = 10
    members: int = 1
    inputs: str = "own"
    burn_in: int = 8
    targets: int = 40
    device: str = "cpu"
    compile: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.law, NetworkLaw):
            raise InputError(f"{self.law} has no weights to train: choose least squares")
        for name in ("epochs", "batch", "patience", "targets", "members"):
            if type(getattr(self, name)) is not int or getattr(self, name) < 1:
                raise InputError(f"{name} = {getattr(self, name)!r} must be a positive integer")
        if type(self.burn_in) is not int or self.burn_in < 0:
            raise InputError(f"burn_in = {self.burn_in!r} must be a number of samples, or 0")
        if not 0 < self.rate < math.inf:
            raise InputError(f"rate = {self.rate!r} must be positive and finite")
        check_share(self.share)
        if self.inputs not in ("own", "all"):
            raise InputError(f"inputs = {self.inputs!r} is unknown; known are own, all")
        if self.inputs == "all" and not isinstance(self.law, MLP):
            raise InputError(f'inputs = "all" needs a law that sees other joints, such as {MLP()}')
        if self.device not in ("cpu", "cuda"):
            raise InputError(f"device = {self.device!r} is unknown; known are cpu, cuda")
        if self.device != "cpu":  # now, for a comparison has other work before it
            check_device(self.device)
        if self.compile:
            check_compiler()

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        check_device(self.device)
        weights, law = normalised(weights, problem), self.law
        if law.sample_time is not None:
            law = replace(law, sample_time=float(np.median(problem.dt)))
        if self.inputs == "all":
            law = replace(law, others=problem.r.shape[1] - 1)
        scales = np.stack([torque_scale(problem, weights), speed_scale(problem, weights)], axis=-1)
        seeds = member_seeds(seed, self.members)
        draws = [np.random.default_rng(s) for s in seeds]
        start = np.concatenate([law.initial_parameters(scales, rng) for rng in draws])
        inner = np.concatenate([held_out(problem, weights, self.share, s) for s in seeds])
        every = np.tile(weights, (self.members, 1))
        queues = [s for s in seeds for _ in weights]
        told: list[tuple[Array, Array]] = []
        parts = every * ~inner, every * inner
        theta = self.trained(law, problem, start, parts, queues, told)
        friction = together(law, np.split(theta, self.members))
        return replace(friction, provenance={**friction.provenance, "learning": self._told(told)})

    def _told(self, told: Sequence[tuple[Array, Array]]) -> dict[str, Array]:
        """Costs (F, E) of each epoch, without friction 1: in training, and held out in the fold."""
        training, held = (np.stack(each, axis=-1) for each in zip(*told, strict=True))
        mean = [np.mean(np.split(c, self.members), axis=0).round(5) for c in (training, held)]
        return {"training": mean[0], "held_out": mean[1]}

    def trained(
        self,
        law: Any,
        problem: Problem,
        start: Array,
        parts: tuple[Array, Array],
        seeds: Sequence[Sequence[int]],
        told: list[tuple[Array, Array]] | None = None,
    ) -> Array:
        """Weights (F, n, P) that were best on the held-out part of each fold.

        told : takes the costs (F,) of each epoch, in training and on the held-out part
        """
        import torch  # late: who trains no network need not wait for it

        learn, judge = (self._lessons(law, problem, start, part) for part in parts)
        # a batch larger than all rows, or the usual one, would only repeat them
        size = max(1, min(self.batch, max(len(problem.r), Network.batch)) // learn.rows)
        steps = -(-len(problem.r) // (size * learn.rows))
        draws = batches(learn.counted(parts[0]), size, seeds)
        held = learn.tensor(side_by_side(judge.counted(parts[1]), judge.items))
        free = learn.tensor(is_learned(law))
        theta = learn.tensor(start).requires_grad_()
        adam, best = Adam(theta.detach()), Best(theta.detach())
        cost = compiled(learn.cost) if self.compile else learn.cost
        for epoch in range(self.epochs):
            seen = theta.detach()[:, 0, 0] * 0.0
            for step in range(steps):
                theta.grad = None
                costs = cost(theta, learn.tensor(next(draws)))
                costs.sum().backward()
                seen += costs.detach() / steps
                rate = self.rate * _share(epoch + step / steps, self.epochs)
                adam.step(theta.detach(), _shortened(theta.grad * free), rate)
            with torch.no_grad():
                now = judge.cost(theta, held)
            if told is not None:
                told.append((seen.cpu().numpy(), now.cpu().numpy()))
            if best.ended(theta.detach(), now, self.patience):
                break
        found: Array = best.theta.cpu().numpy()
        return found

    def _lessons(self, law: Any, problem: Problem, start: Array, weights: Array) -> Any:
        from frictionid.identifiers.networks.lstm_training import Sequences
        from frictionid.identifiers.networks.mlp_training import Rows

        if law.cells:
            longest = -(-int(np.diff(problem.nodes.first).max()) // problem.nodes.per_sample)
            if self.burn_in > max(longest, Network.burn_in):
                raise InputError(
                    f"burn_in = {self.burn_in} samples is more than the longest recording has "
                    f"({longest}): choose a smaller one"
                )
            # pieces longer than a recording are the recording, and nothing
            targets = min(self.targets, max(longest, Network.targets))
            return Sequences(law, problem, start, weights, self.device, self.burn_in, targets)
        return Rows(law, problem, start, weights, self.device)


def check_device(device: str) -> None:
    """Refuse a device that is not there.

    Raises
    ------
    InputError
        Saying what PyTorch sees.
    """
    import torch

    if device == "cuda" and not torch.cuda.is_available():
        raise InputError(
            'device = "cuda": PyTorch sees no CUDA device here: leave the device out, or install '
            "PyTorch with CUDA"
        )


def _share(epoch: float, epochs: int) -> float:
    """Share of the first rate: a cosine from one to zero."""
    return 0.5 * (1.0 + math.cos(math.pi * epoch / epochs))


def _shortened(gradient: Any) -> Any:
    """Gradients (F, n, P), those of a fold together no longer than a limit."""
    size = (gradient**2).sum((1, 2), keepdim=True).sqrt()
    return gradient * (_LONGEST / size.clamp(min=_LONGEST))


class Best:
    """The weights (F, n, P) of each fold when its cost was lowest."""

    def __init__(self, theta: Any):
        self.theta = theta.clone()
        self.cost = theta[:, 0, 0] * 0.0 + math.inf
        self.since = theta[:, 0, 0] * 0.0

    def ended(self, theta: Any, cost: Any, patience: int) -> bool:
        """Whether all folds have ended; each ends by itself, and keeps what it has from then on."""
        running = self.since < patience
        better = running & (cost < self.cost)
        self.theta[better] = theta[better]
        self.cost = cost.where(better, self.cost)
        self.since = (self.since + running) * ~better
        return bool((self.since >= patience).all())
