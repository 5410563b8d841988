"""Shooting finds the friction of a motor that turns with two joints, from MuJoCo's motion."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

pytest.importorskip("mujoco")
from fixtures.slopes import assert_slopes
from fixtures.wrist import motion, wrist

from frictionid.data.calibration import Calibration
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.fitting.parameters import DelayBlock, FrictionBlock, InertiaBlock
from frictionid.fitting.parameters.parameter_block import values_of
from frictionid.fitting.shooting import Settings, refine
from frictionid.fitting.shooting.sample_intervals import intervals_of
from frictionid.fitting.shooting.stages import prepare_fit
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, LoadDependent

TRUE = np.array([[0.25, 0.05], [0.06, 0.02], [0.12, 0.03]])  # of bend, turn and motor
BEGIN = Friction(CoulombViscous(), np.array([[0.15, 0.02], [0.1, 0.01], [0.2, 0.01]]))
DT, NOISE = 0.01, 1e-4


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Two recordings of a second at 100 Hz, in which all three parts come to rest at times."""
    rng, t = np.random.default_rng(0), DT * np.arange(101)
    recordings = []
    for k in range(2):
        u = np.stack(
            [2.5 * np.sin((1.9 + 0.5 * k) * t + k), 0.9 * np.sin((3.1 - 0.4 * k) * t)], axis=-1
        )
        q, _ = motion(TRUE, [0.3 * k, -0.5], [0.0, 0.0], u[:-1], DT, step=4e-5)
        angle = Signal(t, q + rng.normal(scale=NOISE, size=q.shape))
        recordings.append(Recording(f"{k}", angle, Signal(t, u)))
    return Dataset("wrist", wrist(tmp_path_factory.mktemp("wrist")), tuple(recordings))


def test_truth_comes_out(dataset):
    found = refine(BEGIN, dataset, (FrictionBlock(),), Settings(windows=(0.3,)))
    assert_allclose(np.asarray(found.friction.theta), TRUE, rtol=0.003)
    off = (found.covariance.values - TRUE.ravel()) / found.covariance.error
    assert (np.abs(off) < 3.5).all()


@pytest.mark.parametrize("law", [CoulombViscous(), LoadDependent()])
def test_derivatives_are_those_of_central_differences(dataset, law):
    theta = np.abs(np.random.default_rng(0).normal(size=(3, len(law.names)))) * 0.1
    blocks = (FrictionBlock(), InertiaBlock(prior=0.3), DelayBlock())
    intervals = intervals_of(dataset)
    calibration = replace(Calibration.ideal(2), delay=np.asarray(0.003))  # at 0 it has a kink
    begin = Friction(law, theta, calibration=calibration)
    problem, estimate = prepare_fit(begin, intervals, blocks, Settings())
    # a part that meets rest has a kink there
    parts = intervals.w @ dataset.mechanism.friction_map.T
    smooth = np.flatnonzero((np.abs(parts) > 0.8).all(axis=1))[:50]
    assert len(smooth) == 50
    assert assert_slopes(problem, estimate, smooth) == len(values_of(estimate, problem.blocks))
