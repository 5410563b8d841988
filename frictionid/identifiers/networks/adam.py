"""Steps of Adam [Kingma2015]: written here, PyTorch's own takes seconds to import."""

from __future__ import annotations

from typing import Any

_FIRST, _SECOND = 0.9, 0.99  # how much of the running means of gradient and square is kept
_LEAST = 1e-8


class Adam:
    """Running means of the gradients of weights, and steps that follow from them."""

    def __init__(self, theta: Any):
        self.mean, self.square, self.count = 0.0 * theta, 0.0 * theta, 0

    def step(self, theta: Any, gradient: Any, rate: float) -> None:
        """Change theta in place, by about the rate, against its gradient."""
        self.count += 1
        self.mean.mul_(_FIRST).add_(gradient, alpha=1.0 - _FIRST)
        self.square.mul_(_SECOND).addcmul_(gradient, gradient, value=1.0 - _SECOND)
        size = (self.square / (1.0 - _SECOND**self.count)).sqrt_().add_(_LEAST)
        theta.addcdiv_(self.mean, size, value=-rate / (1.0 - _FIRST**self.count))
