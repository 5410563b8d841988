"""A real servo by shooting: a constant of its motor fitted with friction."""

import gzip
import json

import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.formats.bam import XL330_GAIN
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.formulation import INTEGRAL, training_problem
from frictionid.fitting.parameters import ActuatorBlock, FrictionBlock
from frictionid.fitting.shooting import Settings, refine
from frictionid.friction.laws import MotorLoad
from frictionid.friction.model_files import load_model

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
    published = [load_model(folder / "bam_xl330" / f"{m}.json").parameters for m in ("m1", "m6")]
    low, high = sorted(kt / m["kt"] * m["R"] for m in published)  # with the same torque per volt
    assert 0.9 * low < R < 1.1 * high


TOML = f"""
name = "xl330"
[mechanism]
kind = "pendulum"
motor = true
parameters = {{ mass = 0.49, length = 0.1, rotor = 0.0018141672784458866, g = 9.80665 }}
[columns]
time = "timestamp"
angle = "position"
[actuator]
target = "goal_position"
enabled = "torque_enable"
hold = "linear"
output = "duty"
P = 100
scale = {XL330_GAIN!r}
supply = 7.4
kt = 0.3866957639281311
R = 4.017129222290597
[actuator.recordings]
"kp400*" = {{ P = 400 }}
[recordings]
patterns = ["*.csv"]
"""


@pytest.fixture(scope="module")
def logs(request, real_data, tmp_path_factory):
    """The logs of all motions by the reader bam, and as tables with [actuator]."""
    folder = tmp_path_factory.mktemp("xl330")
    for path in (real_data / "bam_xl330").glob("*.json.gz"):
        entries = pd.DataFrame(json.loads(gzip.decompress(path.read_bytes()))["entries"])
        entries[["position", "goal_position"]] += 0.030871000250528358  # zero hangs down
        entries["torque_enable"] = entries["torque_enable"].astype(int)
        name = path.name.removesuffix(".json.gz")
        entries.to_csv(folder / f"{name}.csv", index=False, float_format="%.17g")
    (folder / "dataset.toml").write_text(TOML)
    whole = request.config.rootpath / "data" / "bam_xl330_whole"
    return load_dataset(whole, real_data / "bam_xl330"), load_dataset(folder)


SERVO = ("gain", "limit", "supply", "kt", "R", "damping", "target_delay", "backlash", "delay")


def test_tables_with_an_actuator_are_the_logs_of_the_reader_bam(logs):
    """All that fits read: angles, torques, and servos by which torques follow the motion."""
    bam, tables = logs
    assert tables.mechanism.nominal() == bam.mechanism.nominal()
    assert [r.name for r in tables.recordings] == [r.name for r in bam.recordings]
    for own, other in zip(tables.recordings, bam.recordings, strict=True):
        assert_array_equal(own.angle.time, other.angle.time)
        assert_allclose(own.angle.value, other.angle.value, atol=1e-15)
        assert_allclose(own.torque.value, other.torque.value, atol=1e-12)
        for name in ("goal", "enabled"):
            a, b = (getattr(r.servo, name) for r in (own, other))
            assert_allclose(a.value, b.value, atol=1e-15)
        for name in SERVO:
            assert getattr(own.servo, name) == pytest.approx(getattr(other.servo, name))


def test_check_says_of_tables_with_an_actuator_what_it_says_of_the_reader_bam(logs):
    bam, tables = (fid.check(data).findings.set_index("kind")["text"] for data in logs)
    assert set(tables.index) == set(bam.index) >= {"one_payload", "load", "tied_constants"}
    for kind in set(tables.index) - {"modelled_torque"}:
        assert tables[kind] == bam[kind]
