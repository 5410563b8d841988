"""A real servo by shooting: a constant of its motor fitted with friction."""

from __future__ import annotations

import pytest

from frictionid.comparison.registry import friction_of
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.friction.laws import MotorLoad
from frictionid.identifiers import LeastSquares
from frictionid.identifiers.formulation import INTEGRAL, training_problem
from frictionid.shooting import Settings, refine
from frictionid.shooting.parameters import ActuatorBlock, FrictionBlock

pytestmark = pytest.mark.real

SHORT = Settings(windows=(0.1, 0.33), iterations=5)


def test_the_resistance_lies_where_published_models_have_it(request, real_data):
    folder = request.config.rootpath / "data"
    logs = load_dataset(folder / "bam_xl330_whole", real_data / "bam_xl330")
    # all kinds of motion: lifted and dropped with the motor disconnected, and driven
    assert any("lift_and_drop" in r.name for r in logs.recordings)
    problem = training_problem(logs, plant_of(logs), INTEGRAL)
    start = LeastSquares(MotorLoad()).fit(problem, 1.0 + 0.0 * problem.dt[None], 0)[0]
    blocks = (FrictionBlock(), ActuatorBlock(fixed=("kt",)))
    found = refine(start, logs, blocks, SHORT, sample_time=0.01)
    kt, R = found.calibration.motor
    assert kt == logs.recordings[0].servo.kt and found.covariance.identified[-1]
    published = [friction_of(folder / "bam_xl330" / f"{m}.json").parameters for m in ("m1", "m6")]
    low, high = sorted(kt / m["kt"] * m["R"] for m in published)  # with the same torque per volt
    assert 0.9 * low < R < 1.1 * high
