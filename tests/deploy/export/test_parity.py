"""Whatever language a friction is exported to, it computes what the model computes."""

import numpy as np
import pytest
from targets import TARGETS, used
from test_programs import LAWS, N, friction_by

from frictionid.deploy.export.exported import exported
from frictionid.friction import Inputs

OF_ALL = (
    *("stribeck", "motor_load", "spline_asymmetric", "lugre", "film_lag"),
    *("mlp", "window_mlp", "lstm"),
)
SAMPLES, MOTIONS = 20, 500  # 10,000 velocities, each with the history before it
DT = 1 / 60


# the fewest lines that have every operation of those laws
SLOW_PARSER = {"st": ("motor_load", "dahl"), "st_float": ("film_lag",)}
CASES = [(to, name) for to in TARGETS for name in SLOW_PARSER.get(to, OF_ALL)]
CASES.append(("python", "library"))


@pytest.mark.parametrize("to, name", CASES)
def test_ten_thousand_velocities_give_the_torques_of_the_model(to, name, tmp_path):
    """Static laws and histories of dynamic ones, three times beyond the measured speeds, too."""
    rng = np.random.default_rng(5)
    own = exported(friction_by(LAWS[name], rng), speeds=(2.0, 3.0))
    law, theta = own.friction.law, own.friction.theta
    target, tolerance = TARGETS[to][0](own, tmp_path), TARGETS[to][1]
    memory = found_memory = ()
    for k in range(SAMPLES):
        x = Inputs(*(3.0 * rng.standard_normal((4, MOTIONS, N))))
        if tolerance > 1e-6:  # the same numbers, as floats hold them
            x = x.each(lambda v: v.astype(np.float32).astype(float))
        given = used(own, x)
        if k == 0 and law.has_memory:
            memory, found_memory = law.start(theta, x), target.start(given)
        elif law.has_memory:
            memory = law.advance(theta, x, memory, np.array([DT]))
            found_memory = target.advance(given, found_memory, DT)
        found = target.torque(given, found_memory)
        np.testing.assert_allclose(
            found, law.torque(theta, x, memory), rtol=tolerance, atol=tolerance
        )
