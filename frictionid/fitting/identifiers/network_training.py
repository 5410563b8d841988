"""What training networks takes: held-out recordings, scales, batches, steps, compiled costs.

A fold's rows alone decide, together with the seed: so it is the same alone and among others.
Recordings held out inside each training fold say when its cost was lowest.
"""

import os
import shutil
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from frictionid.arrays import Array, times
from frictionid.errors import InputError, needs
from frictionid.friction.laws import CoulombViscous

from ..one_step.residual import Problem
from .least_squares import LeastSquares

_FEW = 4  # recordings of a fold: fewer are divided into pieces
_PIECES = 8

Share = Annotated[float, Field(gt=0, le=0.5)]  # of a fold's weight that is held out


def held_out(problem: Problem, weights: Array, share: float, seed: Any) -> Array:
    """Whether each row is held out within each fold, (F, K): a share of its weight, or a bit more.

    Whole recordings, in an order drawn by the seed; where a fold has fewer than four, pieces.
    """
    rng = np.random.default_rng(seed)
    whole = problem.recording
    pieces = _pieces(problem)
    orders = rng.permutation(int(whole.max()) + 1), rng.permutation(int(pieces.max()) + 1)
    out = np.zeros(weights.shape, dtype=bool)
    for f, weight in enumerate(weights):
        few = len(np.unique(whole[weight > 0])) < _FEW
        label, order = (pieces, orders[1]) if few else (whole, orders[0])
        sizes = np.bincount(label, weight, len(order))[order]
        chosen = (np.cumsum(sizes) - sizes < share * weight.sum()) & (sizes > 0)
        out[f] = np.isin(label, order[chosen]) & (weight > 0)
    return out


def _pieces(problem: Problem) -> Array:
    """Piece (K,) of each row: each recording is cut into eight."""
    _, first, counts = np.unique(problem.recording, return_index=True, return_counts=True)
    place = np.arange(len(problem.recording)) - np.repeat(first, counts)
    return problem.recording * _PIECES + place * _PIECES // np.repeat(counts, counts)


def member_seeds(seed: int, members: int) -> list[list[int]]:
    """Seed of each member: an ensemble of one is the network itself.

    >>> member_seeds(7, 3)
    [[7], [7, 1], [7, 2]]
    """
    return [[seed, k] if k else [seed] for k in range(members)]


_FAST = 0.99  # quantile of the rows' speeds that counts as the fastest
_SMALLEST = 0.01  # of the torques that move the joints: less friction hardly matters


def friction_scales(problem: Problem, weights: Array) -> Array:
    """Torque [N m] and speed [rad/s] of each fold and joint, (F, n, 2).

    The torque is that of Coulomb and viscous friction at the root mean square speed, or a small one
    where there is no friction; 99 % of the fold's rows are slower than the speed.

    Raises
    ------
    InputError
        Where a joint slides in no row.
    """
    speed = np.abs(problem.mean(problem.nodes.inputs.w))
    theta = LeastSquares(CoulombViscous()).fit(problem, weights, 0).theta
    share = weights / weights.sum(axis=1, keepdims=True)
    usual = np.sqrt(share @ speed**2)
    inertia = np.abs(np.linalg.pinv(problem.G, rcond=1e-9))
    force = np.sqrt(share @ times(inertia, np.abs(problem.r)) ** 2)
    torque = np.maximum(theta[..., 0] + theta[..., 1] * usual, _SMALLEST * force)
    fast = [np.quantile(speed[weight > 0], _FAST, axis=0) for weight in weights]
    return np.stack([torque, np.maximum(np.stack(fast), 1e-2)], axis=-1)


def batches(used: Array, size: int, seeds: Sequence[Sequence[int]]) -> Iterator[Array]:
    """Items (F, size) of each fold without end: all used ones shuffled, then all again.

    used (F, C) says which of the C items a fold uses; its draws depend on nothing else but its
    seed.
    """
    queues = [
        _queue(np.flatnonzero(items), size, seed) for items, seed in zip(used, seeds, strict=True)
    ]
    while True:
        yield np.stack([next(queue) for queue in queues])


def _queue(items: Array, size: int, seed: Sequence[int]) -> Iterator[Array]:
    rng = np.random.default_rng(seed)
    waiting = np.empty(0, dtype=int)
    while True:
        while len(waiting) < size:
            waiting = np.concatenate([waiting, rng.permutation(items)])
        yield waiting[:size]
        waiting = waiting[size:]


def padded_items(used: Array, padding: int) -> Array:
    """Items (F, most) that each fold uses, then `padding` up to the longest of them.

    >>> padded_items(np.array([[True, False, True], [False, True, False]]), padding=-1)
    array([[ 0,  2],
           [ 1, -1]])
    """
    most = int(used.sum(axis=1).max())
    rows = [np.flatnonzero(items) for items in used]
    return np.stack([np.pad(r, (0, most - len(r)), constant_values=padding) for r in rows])


_FIRST, _SECOND = 0.9, 0.99  # how much of the running means of gradient and square is kept
_SMALL = 1e-8
_LONGEST = 1.0  # gradient of a fold, whose cost is one without friction


class Adam:
    """Running means of the gradients in parameters theta (F, n, P), and the steps they give.

    That of PyTorch agrees to 1e-14, but its steps take 2 % longer, and it a second to load.

    learned : (P,), which parameters change
    """

    def __init__(self, theta: Any, learned: Any):
        self.theta, self.learned = theta, learned
        self.mean, self.square, self.count = 0.0 * theta.detach(), 0.0 * theta.detach(), 0

    def step(self, costs: Any, rate: float) -> Any:
        """Change theta in place, by about the rate, against the gradient of the costs (F,).

        The gradient of each fold is clipped. Gives the costs, without their gradient.
        """
        self.theta.grad = None
        costs.sum().backward()
        gradient = self.theta.grad * self.learned
        length = (gradient**2).sum((1, 2), keepdim=True).sqrt()  # of each fold together
        gradient = gradient * (_LONGEST / length.clamp(min=_LONGEST))
        self.count += 1
        self.mean.mul_(_FIRST).add_(gradient, alpha=1.0 - _FIRST)
        self.square.mul_(_SECOND).addcmul_(gradient, gradient, value=1.0 - _SECOND)
        size = (self.square / (1.0 - _SECOND**self.count)).sqrt_().add_(_SMALL)
        self.theta.detach().addcdiv_(self.mean, size, value=-rate / (1.0 - _FIRST**self.count))
        return costs.detach()


_DEFAULT = {"darwin": "clang++", "win32": "cl"}  # what PyTorch calls where CXX names no other


def compiler() -> str:
    """Path of the C++ compiler that PyTorch calls, which CXX may name; "" if there is none."""
    return shutil.which(_name()) or ""


def _name() -> str:
    return os.environ.get("CXX") or _DEFAULT.get(sys.platform, "g++")


def check_compiler() -> None:
    """Refuse to compile where there is no C++ compiler."""
    if not compiler():
        raise InputError(
            f"compile = true: PyTorch needs a C++ compiler, and {_name()!r} is not found: leave "
            "compile out, or install one (CXX names another)"
        )


def compiled(cost: Callable[..., Any]) -> Callable[..., Any]:
    """The cost as a function of tensors that is compiled when it is first called.

    Raises
    ------
    InputError
        In that call, where PyTorch cannot compile it.
    """
    with needs("networks"):
        import torch

    with _without_warnings():
        fast: Callable[..., Any] = torch.compile(cost)

    def compiled_cost(*tensors: Any) -> Any:
        try:
            with _without_warnings():
                return fast(*tensors)
        except Exception as error:  # whatever its compilers raise
            reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
            raise InputError(
                f"compile = true: PyTorch cannot compile this network ({reason}): leave compile out"
            ) from None

    return compiled_cost


@contextmanager
def _without_warnings() -> Iterator[None]:
    """PyTorch warns at length about the libraries that its compilers see."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
