"""Every mechanism passes `check_mechanism`, and a mistake in any of its parts does not."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from fixtures.random_machines import MECHANISMS

from frictionid.errors import InputError
from frictionid.mechanics import (
    Mechanism,
    acrobot,
    check_mechanism,
    linear_axis,
    unit_inertia,
)

ALL = {**MECHANISMS, "linear_axis": linear_axis(), "unit": unit_inertia(("m", "rad"))}


@pytest.mark.parametrize("name", ALL)
def test_built_in_mechanisms_keep_to_the_protocol(name):
    check_mechanism(ALL[name])


@dataclass(frozen=True, kw_only=True)
class Wrong(Mechanism):
    """A mechanism that is right but for one part."""

    right: Mechanism
    part: str

    def base(self, parameters):
        p = self.right.base(parameters)
        return p * 1.001 if self.part == "base" and p.ndim > 1 else p

    def dynamics(self, p, q, w):
        M, h = self.right.dynamics(p, q, w)
        return M, h + 1e-4 if self.part == "dynamics" else h

    def inertia(self, p, q):
        M = self.right.inertia(p, q)
        if self.part == "asymmetric":
            return M * np.array([[1.0, 1.01], [1.0, 1.0]])
        return -M if self.part == "negative" else M

    def terms(self, p, q, w):
        t = self.right.terms(p, q, w)
        changed = {
            "momentum": {"momentum": 1.001 * t.momentum},
            "dLdq": {"dLdq": 1.001 * t.dLdq},
            "energy": {"energy": t.energy + 0.01 * q.sum(-1)},
            "batch": {"energy": t.energy + 0.01} if q.ndim < 2 else {},
        }
        return t._replace(**changed.get(self.part, {}))

    def partials(self, p, q, w, a):
        d = self.right.partials(p, q, w, a)
        if self.part in ("by_q", "by_w", "by_p"):
            return d._replace(**{self.part: 1.001 * getattr(d, self.part)})
        return d

    def load(self, parameters, q, w, u):
        load = self.right.load(parameters, q, w, u)
        return -load if self.part == "load" else load


def wrong(part):
    right = acrobot()
    names = ("kind", "joints", "position_units", "driven", "parameters")
    names += ("base_names", "base_units", "base_meanings")
    return Wrong(**{name: getattr(right, name) for name in names}, right=right, part=part)


def test_a_wrapped_mechanism_passes():
    check_mechanism(wrong(""))


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ("base", "acrobot: base of a batch must be that of each entry"),
        ("batch", "energy of a batch must be that of each entry"),
        ("dynamics", "dynamics and terms must have the same h"),
        ("asymmetric", "M must be symmetric"),
        ("negative", "these parameters give no inertia|M must be positive definite"),
        ("momentum", "momentum must be M w"),
        ("dLdq", "dLdq must be the derivative of T - V"),
        ("energy", "dLdq must be the derivative of T - V"),
        ("by_q", "partials by q must be"),
        ("by_w", "partials by w must be"),
        ("by_p", "the regressor times p must be"),
        ("load", "load must be finite and not negative"),
    ],
)
def test_a_wrong_part_is_named(part, message):
    with pytest.raises((AssertionError, InputError), match=message):
        check_mechanism(wrong(part))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joints": ("a", "a")}, "joints must be different"),
        ({"position_units": ("rad",)}, "position_units must have one entry per joint"),
        ({"driven": (False, True, True)}, "driven must have one entry per joint"),
        ({"base_units": ()}, "base_units must have one entry per base parameter"),
        ({"driven": (False, False)}, "terms must have the mechanism's B"),
    ],
)
def test_facts_that_contradict_each_other_are_named(change, message):
    with pytest.raises(AssertionError, match=message):
        check_mechanism(replace(wrong(""), **change))
