"""Steps of Adam [Kingma2015]: written here, PyTorch's own takes seconds to import."""

from __future__ import annotations

from typing import Any

_FIRST, _SECOND = 0.9, 0.99  # how much of the running means of gradient and square is kept
_SMALL = 1e-8
_LONGEST = 1.0  # gradient of a fold, whose cost is one without friction


class Adam:
    """Running means of the gradients in parameters theta (F, n, P), and the steps they give.

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
        gradient = _clipped(self.theta.grad * self.learned)
        self.count += 1
        self.mean.mul_(_FIRST).add_(gradient, alpha=1.0 - _FIRST)
        self.square.mul_(_SECOND).addcmul_(gradient, gradient, value=1.0 - _SECOND)
        size = (self.square / (1.0 - _SECOND**self.count)).sqrt_().add_(_SMALL)
        self.theta.detach().addcdiv_(self.mean, size, value=-rate / (1.0 - _FIRST**self.count))
        return costs.detach()


def _clipped(gradient: Any) -> Any:
    """Gradients (F, n, P), those of each fold together no longer than a limit."""
    size = (gradient**2).sum((1, 2), keepdim=True).sqrt()
    return gradient * (_LONGEST / size.clamp(min=_LONGEST))
