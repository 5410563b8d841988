"""What an identifier is: one method, from a one-step problem to friction."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from frictionid.arrays import Array
from frictionid.friction import Friction

from .one_step.residual import Problem


class Identifier(ABC):
    """Fits friction to a one-step problem; an instance holds settings only, frozen.

    One's own identifier derives from this class, has `fit`, and overrides those of the properties
    that differ, for example by a class attribute `seeded = False`.
    """

    @abstractmethod
    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        """Friction whose theta has the batch axis of the weights, shape (F, n, P).

        Row k counts in fold f with weights[f, k] >= 0, shape (F, K): all folds are fitted at once,
        and a fold's result does not depend on the others, nor on the size of its weights. The same
        seed gives the same numbers.
        """

    def fit_each(self, problems: Sequence[Problem], weights: Array, seed: int) -> Friction | None:
        """The same for folds that have each a problem of its own, of the same rows and nodes.

        None where they are to be fitted one by one.
        """
        return None

    @property
    def seeded(self) -> bool:
        """Whether the seed may change the result; if not, it is fitted once for all seeds."""
        return True

    @property
    def fixed(self) -> bool:
        """Whether the friction is given: no data, recipe or seed changes it, nor shooting."""
        return False

    @property
    def uses_mechanism(self) -> bool:
        """Whether friction acts on the data set's mechanism; if not, on joints of unit inertia.

        Without a mechanism the negative friction torque is the acceleration.
        """
        return True
