"""Laws of the momentum balance: exact midpoints, linear in the base parameters, one for all."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frictionid.check.motion import motions_of, unit_rows
from frictionid.data.integrals import integrals_of
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal
from frictionid.fitting.one_step.residual import one_step_problem
from frictionid.mechanics import Plant, pendulum
from frictionid.mechanics.plant import (
    interval_mean,
    interval_stencil,
    with_midpoints,
)


def test_midpoints_and_means_of_cubic_motions_are_exact():
    time = np.array([0.0, 0.3, 0.5, 1.1])[:, None]
    q, w = 1 + 2 * time - time**2 + time**3, 2 - 2 * time + 3 * time**2
    t, angle, velocity = with_midpoints(time[:, 0], q, w)
    t = t[:, None]
    assert_allclose(angle, 1 + 2 * t - t**2 + t**3, atol=1e-14)
    assert_allclose(velocity, 2 - 2 * t + 3 * t**2, atol=1e-14)
    travelled = interval_mean(velocity, interval_stencil(4)) * np.diff(time, axis=0)
    assert_allclose(travelled, np.diff(q, axis=0), atol=1e-14)


@pytest.mark.parametrize("hold", ["linear", "previous"])
def test_windows_of_check_sum_up_the_rows_of_the_one_step_problem(hold):
    """M1 r is what friction takes of an interval, and its sum what it takes of a window."""
    time = np.arange(200) / 100
    rng = np.random.default_rng(1)
    q = np.sin(4 * time)[:, None] + 1e-3 * rng.normal(size=(200, 1))
    torque = Signal(time, rng.normal(size=(200, 1)), hold)
    recordings = [Recording(name, Signal(time, q), torque) for name in "ab"]
    machine = pendulum()
    plant = Plant.from_parameters(machine, {"mass": np.array([0.5, 0.8])})
    motions = motions_of(recordings)
    rows = unit_rows(machine, motions)
    mean = rows.means(integrals_of([torque, torque])) - rows.required(plant.p)
    problem = one_step_problem("integral", plant, recordings, [m.states for m in motions])
    impulse = problem.dt[:, None] * np.linalg.solve(problem.G, problem.r[..., None])[..., 0]
    for k in (0, 7, len(mean) - 1):
        inside = (problem.recording == rows.recording[k]) & (problem.time > rows.start[k] - 1e-9)
        inside &= problem.time < rows.stop[k] - 1e-9
        length = rows.stop[k] - rows.start[k]
        assert_allclose(impulse[inside].sum(0), length * mean[k], atol=1e-12)
