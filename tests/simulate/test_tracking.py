"""Motion under a position controller: the same torques give the same motion, batch equals alone."""

import numpy as np
import pytest
from fixtures.refusals import assert_refused
from fixtures.true_curves import plain_friction

from frictionid.mechanics import Plant, double_pendulum
from frictionid.simulate import Camera, Drive, Rig, Run, simulate
from frictionid.simulate.integrate import TrueSystem, integrate_motion
from frictionid.simulate.torques import Controller, Fourier, sampled_loop, tracking

MACHINE = double_pendulum(m1=0.6, m2=0.5, l1=0.25, r1=0.12, r2=0.13, I1=0.013, I2=0.012)
NOMINAL = Plant.from_parameters(MACHINE, {})
TRUE = TrueSystem(MACHINE, 1.1 * NOMINAL.p, plain_friction((0.2, 0.1), (0.05, 0.02)))
CONTROLLER = Controller((40.0, 15.0), (2.0, 0.8))
REFERENCES = [
    [Fourier((1.0, 0.4), (0.2, 0.3), 0.5), Fourier((0.5, -0.8), (0.6, 0.0), 0.5, offset=0.3)],
    [Fourier((-0.7,), (0.5,), 0.7), Fourier((0.9,), (-0.4,), 0.7)],
]
ONE = tuple(REFERENCES[0])
TIME = np.arange(200) * 0.002


def motion(references=REFERENCES, **settings):
    command = tracking(TRUE, NOMINAL, CONTROLLER, references, TIME)
    return sampled_loop(TRUE, *command, TIME, **settings)


def test_a_reference_is_the_integral_of_its_velocity():
    fine = np.linspace(0.0, 3.0, 30001)
    q, w, a = REFERENCES[0][1].motion(fine)
    assert np.gradient(q, fine)[1:-1] == pytest.approx(w[1:-1], abs=1e-6)
    assert np.gradient(w, fine)[1:-1] == pytest.approx(a[1:-1], abs=1e-5)


@pytest.mark.parametrize("delay", [0.0, 0.0013, 0.005])
def test_its_torques_alone_give_the_same_motion(delay):
    """Played as commands without controller, to the controller's sampling."""
    tracked, torque = motion(delay=delay, substeps=8)
    edges = np.unique(np.concatenate([TIME, TIME + delay]).round(12))
    edges = edges[edges <= TIME[-1]]
    middle = (edges[1:] + edges[:-1]) / 2
    k = np.maximum(np.floor((middle - delay) / 0.002 + 1e-9).astype(int), 0)
    q, w = tracked[0, :2]
    states = integrate_motion(TRUE, q, w, torque[k], edges, 0.00025)
    again = states[np.searchsorted(edges, TIME - 1e-9)]
    assert again[:, 0] == pytest.approx(tracked[:, 0], abs=1e-6)


def test_alone_as_in_a_batch():
    (both, _), (alone, _) = motion(), motion(REFERENCES[1:])
    assert both[:, :, 1:] == pytest.approx(alone, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"controller": None}, "go together"),
        ({"controller": Controller((1.0,), (1.0,))}, "one number for each of 2 joints"),
        ({"drive": Drive(rate=100.0)}, "must be equal"),
        ({"true_mechanism": {"kind": "pendulum"}}, "must have the same ones"),
        ({"recordings": (Run("a", references=ONE[:1]),)}, "1 references for 2 joints"),
        ({"recordings": (Run("a", (0.0, 0.0), references=ONE),)}, "leave them out"),
    ],
)
def test_a_rig_that_cannot_be_is_refused(change, says):
    settings = {
        "name": "tracked",
        "mechanism": MACHINE,
        "friction": TRUE.friction,
        "camera": Camera(50, rate=500.0),
        "recordings": (Run("a", references=ONE),),
        "drive": Drive(rate=500.0),
        "controller": CONTROLLER,
    }
    assert simulate(Rig(**settings)).recordings[0].angle.value.shape == (50, 2)
    with assert_refused(says):
        Rig(**settings | change)


def test_sines_and_cosines_go_together():
    with assert_refused("as many sines as cosines"):
        Fourier((1.0, 2.0), (1.0,), 0.5)
