"""What the torques are: the motors', those of links, or commands; declared, checked, held to."""

import numpy as np
import pandas as pd
import pytest
from fixtures.refusals import assert_refused
from fixtures.verdicts import identifiable

from frictionid.check import check
from frictionid.comparison.fit_model import fit_model
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import pendulum

RIG = pendulum(mass=0.5, length=0.4)
COULOMB, VISCOUS = 0.2, 0.05


@pytest.fixture(scope="module")
def frames():
    """Torques of the motor, and what a sensor at the link would have measured."""
    t, draw = np.arange(0.0, 12.0, 0.005), np.random.default_rng(0)
    q, w, a = np.zeros((3, len(t)))
    for size, pace in ((0.9, 1.3), (0.4, 2.9)):
        q += size * np.sin(pace * t)
        w += size * pace * np.cos(pace * t)
        a -= size * pace**2 * np.sin(pace * t)
    M, h = RIG.dynamics(RIG.base({}), q[:, None], w[:, None])
    link = M[:, 0, 0] * a - h[:, 0]
    motor = link + COULOMB * np.sign(w) + VISCOUS * w
    noise = 0.01 * draw.standard_normal(len(t))
    return pd.DataFrame(
        {
            "t": t,
            "q": q + 2e-5 * draw.standard_normal(len(t)),
            "motor": motor + noise,
            "link": link + noise,
        }
    )


def dataset(frames, torque, at):
    return Dataset.from_frames(
        frames, RIG, time="t", angle="q", torque=torque, hold="linear", torque_at=at
    )


def test_sensors_at_links_show_no_friction_and_no_fit_finds_any(frames):
    verdict = check(dataset(frames, "link", "link"))
    assert [f.kind for f in verdict.findings] == ["link_torque"]
    assert "friction, and the inertia of rotors, is not in what is measured" in (
        verdict.findings[0].text
    )
    friction = identifiable(verdict, "friction of joint 1")
    assert not friction.possible and "does not feel friction" in friction.reason
    with assert_refused(r'torque.at = "link".*no fit can find it; give the'):
        fit_model(dataset(frames, "link", "link"), LeastSquares(CoulombViscous()))


def test_friction_that_a_sensor_at_the_link_could_not_feel_is_held_against_it(frames):
    kinds = {f.kind: f for f in check(dataset(frames, "motor", "link")).findings}
    assert set(kinds) == {"link_torque", "friction_at_link"}
    assert kinds["friction_at_link"].numbers["coulomb"] == pytest.approx(COULOMB, rel=0.1)
    assert 'torque.at = "motor"' in kinds["friction_at_link"].remedy


def test_a_command_is_not_called_measured_and_is_fitted(frames):
    data = dataset(frames, "motor", "command")
    verdict = check(data)
    assert verdict.level == "good" and [f.kind for f in verdict.findings] == ["commanded_torque"]
    first = verdict.questions[0]
    assert first.question == "is the torque measured" and first.passed is False
    assert "declared" in first.words
    assert check(dataset(frames, "motor", "motor")).questions[0].passed is True
    theta = fit_model(data, LeastSquares(CoulombViscous())).theta[0]
    np.testing.assert_allclose(theta, [COULOMB, VISCOUS], rtol=0.1)


FRAME = pd.DataFrame({"t": [0.0, 0.1, 0.2], "q": [0.0, 0.1, 0.1], "u": [0.0, 0.2, 0.1]})
COLUMNS = {"time": "t", "angle": "q", "torque": "u"}
TOML = """
name = "one"
[mechanism]
kind = "pendulum"
parameters = { mass = 0.5, length = 0.4 }
[columns]
time = "t"
angle = "q"
torque = "u"
[recordings]
patterns = ["*.csv"]
"""


@pytest.mark.parametrize("at", ["motor", "link", "command"])
def test_files_and_frames_say_it_alike(tmp_path, at):
    FRAME.to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "dataset.toml").write_text(f'{TOML}[torque]\nat = "{at}"\n')
    made = Dataset.from_frames(FRAME, RIG, **COLUMNS, torque_at=at)
    assert load_dataset(tmp_path).torque_at == made.torque_at == at
    assert made.with_frames(FRAME).torque_at == at


def test_what_contradicts_itself_is_refused(tmp_path):
    FRAME.to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "dataset.toml").write_text(
        f'{TOML}[torque]\nat = "link"\n[motor]\ngear = 3.0\ntorque = "motor"\n'
    )
    with assert_refused("says that the torques are of the motors: delete one"):
        load_dataset(tmp_path)
    with assert_refused("torque.at"):
        Dataset.from_frames(FRAME, RIG, **COLUMNS, torque_at="joint")
    arrays = {name: FRAME[column] for name, column in COLUMNS.items()}
    with assert_refused("torque_at = 'joint'"):
        Dataset.from_arrays({"a": arrays}, RIG, torque_at="joint")
