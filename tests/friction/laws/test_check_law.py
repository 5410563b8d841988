"""What `check_law` finds: one law for each rule, which violates it and no other."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from fixtures.memory_laws import Sampled
from fixtures.refusals import assert_refused

from frictionid.friction import Law
from frictionid.friction.laws import CoulombViscous, check_law


@dataclass(frozen=True)
class Plain(Law):
    """Coulomb and viscous friction without a gradient, which keeps to the contract."""

    width: float = 0.02
    names = ("coulomb", "viscous")
    units = ("N m", "N m s/rad")
    bounds = ((0.0, float("inf")), (0.0, 2.0))
    initial = ((0.1, 0.0),)

    def __repr__(self):
        return type(self).__name__

    def level(self, theta, x):
        return theta[..., 0] + 0.0 * x.w

    def torque(self, theta, x, memory):
        return self.level(theta, x) * np.tanh(x.w / self.width) + theta[..., 1] * x.w

    def limit(self, theta, x, memory):
        return self.level(theta, x)


@dataclass(frozen=True, repr=False)
class Rough(Plain):
    """A smoothing that must not be narrowed, and a level that follows the load."""

    width: ClassVar[float] = 0.02
    shape = ""
    uses_load = True

    def level(self, theta, x):
        return theta[..., 0] * x.load + 0.0 * x.w


class Summed(Plain):
    def torque(self, theta, x, memory):
        return super().torque(theta, x, memory).mean(0) + 0.0 * x.w


class Loaded(Plain):
    def torque(self, theta, x, memory):
        return super().torque(theta, x, memory) * x.load


class Flat(Plain):
    def torque(self, theta, x, memory):
        return theta[..., 0].max() * np.tanh(x.w / self.width)


class Broken(Plain):
    def torque(self, theta, x, memory):
        return super().torque(theta, x, memory) / (x.w - 0.3)


class Turned(Plain):
    def torque(self, theta, x, memory):
        return -super().torque(theta, x, memory)


class Low(Plain):
    def limit(self, theta, x, memory):
        return super().limit(theta, x, memory) / 2


class Negative(Plain):
    def limit(self, theta, x, memory):
        return -super().limit(theta, x, memory)


class Sloped(Plain):
    def gradient(self, theta, x):
        return CoulombViscous().gradient(theta, x) * [1.0, 1.1]


class Greedy(Plain):
    def torque(self, theta, x, memory):
        x.w[...] = np.abs(x.w)
        return super().torque(theta, x, memory)


class Counting(Plain):
    calls: ClassVar[list[int]] = []

    def torque(self, theta, x, memory):
        self.calls.append(1)
        return super().torque(theta, x, memory) * len(self.calls)


class Unsteady(Plain):
    def start(self, theta, x):
        return (0.0 * (theta[..., 0] + x.w),)

    def advance(self, theta, x, memory, dt):
        return ()


class Wide(Plain):
    def start(self, theta, x):
        return (np.zeros(7),)


@dataclass(frozen=True, repr=False)
class Fixed(Plain):
    width: ClassVar[float] = 0.02


@dataclass(frozen=True, repr=False)
class Hidden(Fixed):
    """A smoothing that is not declared."""

    width: ClassVar[float] = 0.0

    def torque(self, theta, x, memory):
        return theta[..., 0] * np.tanh(x.w / 0.02) + theta[..., 1] * x.w


class Fast(Plain):
    def limit(self, theta, x, memory):
        return theta[..., 0] * abs(x.w)


class Linear(Plain):
    """Linear, as it says, but without a gradient."""

    is_sparse = True


class Curved(Linear):
    def torque(self, theta, x, memory):
        return super().torque(theta**2, x, memory)

    def limit(self, theta, x, memory):
        return super().limit(theta**2, x, memory)

    def gradient(self, theta, x):
        return 2.0 * theta * CoulombViscous().gradient(theta, x)


class Manifold(Plain):
    names = tuple(f"a{i}" for i in range(20))
    units = ("N m",) * 20
    bounds = ((0.0, 1.0),) * 20
    initial = ((0.0,) * 20,)


class Learning(Sampled):
    reads_window = True

    def advance(self, theta, x, memory, dt):
        return (*memory[1:], theta[..., 0] * x.w)


class Duck:
    """Everything that a law has, but not declared."""

    width, names, units, bounds = 0.02, Plain.names, Plain.units, Plain.bounds
    torque, limit = Plain.torque, Plain.limit


def described(**changes):
    """A law of the class Plain whose description is changed."""
    return type("Changed", (Plain,), changes)()


INF = float("inf")
VIOLATIONS = [
    (described(names=("a", "a")), "names must differ"),
    (described(units=("N m",)), "units needs 2 entries"),
    (described(bounds=((0.0, 1.0),)), "bounds needs 2 entries"),
    (described(bounds=((0.0, INF), (1.0, 0.0))), r"bounds of viscous must increase"),
    (described(initial=()), "initial needs at least one start"),
    (described(initial=((0.0,),)), "each start in initial needs 2 values"),
    (described(initial=((-1.0, 0.0),)), r"initial coulomb = -1.0 must lie in its bounds"),
    (described(uses_load=None), "uses_load must be True or False"),
    (described(sample_time=0.0), "sample_time must be None, or positive"),
    (described(), "it must pickle"),
    (Duck(), "it must subclass frictionid.friction.Law"),
    (Fixed(), "width must be a field"),
    (Hidden(), "its torque is smoothed at rest, but declares no width"),
    (Fast(), "limit must not depend on the speed"),
    (Linear(), "is_sparse is True, so it needs a gradient"),
    (Curved(), "is_sparse is True, so the torque must be gradient times theta"),
    (Manifold(), "20 parameters need a gradient, or is_network = True"),
    (Learning(), "reads_window is True, so its memory must not depend on theta"),
    (Summed(), "must not depend on the others"),
    (Flat(), "must not depend on the others in its batch"),
    (Loaded(), "uses_load is False"),
    (Turned(), "limit must be the torque just above rest, for positive velocity"),
    (Low(), "limit must be the torque just above rest"),
    (Negative(), "limit must not be negative"),
    (Sloped(), "gradient by viscous is"),
    (Greedy(), "must not change theta or the inputs"),
    (Counting(), "the same numbers must give the same torque"),
    (Unsteady(), "advance must keep the number of entries"),
    (Wide(), "entry 0 of start must have shape"),
]


@pytest.mark.parametrize(("law", "rule"), VIOLATIONS, ids=lambda v: v if isinstance(v, str) else "")
def test_the_check_names_the_broken_rule(law, rule):
    with pytest.raises(AssertionError, match=rule) as raised:
        check_law(law)
    assert "\n" not in str(raised.value)


def test_the_check_finds_torques_that_are_not_finite():
    with np.errstate(all="ignore"), pytest.raises(AssertionError, match="torque must be finite"):
        check_law(Broken())


def test_a_law_may_document_another_limit():
    check_law(Low(), level=False)
    with pytest.raises(AssertionError, match="just above rest"):
        check_law(Low())


def test_laws_without_a_gradient_or_a_width_pass():
    check_law(Plain())
    check_law(Rough())


def test_laws_of_ones_own_refuse_a_smoothing_that_means_nothing():
    with assert_refused("Plain: width = -1.0 rad/s must be positive and finite"):
        Plain(width=-1.0)
    with assert_refused("shape = 'step' is unknown; known are tanh, arctan"):
        described(shape="step")
