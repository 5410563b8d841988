"""Designed trajectories: limits, rest at both ends, and errors that a fit then has."""

import io
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from fixtures.changed_data import changed
from fixtures.refusals import assert_refused
from fixtures.true_curves import plain_friction

from frictionid.comparison.fit_model import fit_model
from frictionid.excitation import TrajectoryTask, design_trajectories, limits_of, prior_friction_of
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.torque_balance import InverseDynamics
from frictionid.friction.laws import CoulombViscous
from frictionid.mechanics import Plant, acrobot, double_pendulum
from frictionid.simulate import Camera, Controller, Drive, Rig, Run, simulate

LINKS = {"m1": 0.6, "m2": 0.5, "l1": 0.25, "r1": 0.12, "r2": 0.13, "I1": 0.013, "I2": 0.012}
ARM = double_pendulum(**LINKS)
LIMITS = limits_of("torque=[4,2],velocity=[6,8],angle=[2.5,2.0]", ARM)
TEXT = "coulomb=[0.12,0.05],viscous=[0.05,0.02]"
PRIOR = prior_friction_of(TEXT, LIMITS)
TASK = TrajectoryTask(Plant.from_parameters(ARM, {}), PRIOR, LIMITS, 6.0, recordings=2)


@pytest.fixture(scope="module")
def design():
    return design_trajectories(TASK, effort=80, seed=1)


def hasty():
    return design_trajectories(replace(TASK, recordings=1), effort=4, seed=1)


def test_all_limits_are_kept_between_the_samples_too(design):
    time = np.linspace(0.0, 12.0, 4001)  # two periods
    for trajectory in design.trajectories:
        q, w, a = (
            np.stack(part, axis=-1)
            for part in zip(*(r.motion(time) for r in trajectory.references), strict=True)
        )
        assert (np.abs(q) <= LIMITS.angle).all()
        assert (np.abs(w) <= LIMITS.velocity).all()
        assert np.abs(w[[0, -1]]).max() < 1e-9
        assert np.abs(a[[0, -1]]).max() < 1e-9
        assert (np.abs(trajectory.torque) <= LIMITS.torque).all()


def test_more_effort_and_more_trajectories_tell_more(design):
    assert design.values[1] < design.values[0]
    assert design.values[0] < hasty().values[0]


def test_the_same_seed_gives_the_same():
    assert hasty().trajectories[0].references == hasty().trajectories[0].references


def test_a_fit_has_the_errors_that_were_expected(design):
    """Twelve simulated experiments with independent torque noise, against the expected errors."""
    noise = TASK.torque_noise * LIMITS.torque
    rig = Rig(
        "played",
        ARM,
        plain_friction((0.12, 0.05), (0.05, 0.02)),
        Camera(samples=1200, rate=200.0),
        tuple(
            Run(f"{k}", references=trajectory.references)
            for k, trajectory in enumerate(design.trajectories)
        ),
        drive=Drive(rate=200.0),
        controller=Controller((60.0, 20.0), (2.0, 0.7)),
        substeps=2,
    )
    exact, off = simulate(rig), []
    for seed in range(12):
        draw = np.random.default_rng(seed)
        # ten samples make a window: their mean has the noise that the design counts on
        data = changed(
            exact, "torque", lambda u, d=draw: u + np.sqrt(10.0) * noise * d.normal(size=u.shape)
        )
        friction = fit_model(data, LeastSquares(CoulombViscous()), InverseDynamics())
        off.append(friction.theta / PRIOR.theta - 1.0)
    spread = np.sqrt(np.mean(np.square(off), axis=0))
    ratio = spread / design.error
    assert 0.5 < np.exp(np.log(ratio).mean()) < 1.6
    assert ratio.max() < 3.0


def test_unsure_joints_are_named():
    weak = replace(TASK, recordings=1, torque_noise=0.5)
    assert design_trajectories(weak, effort=10).unsure


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"limits": limits_of("torque=[4,2],velocity=6", ARM)}, "limit of each joint's position"),
        ({"length": 0.1}, "length: .* not 0.1"),
        ({"recordings": 0}, "recordings: .* not 0"),
        ({"plant": Plant.from_parameters(acrobot(), {})}, "joint 1 of acrobot has none"),
    ],
)
def test_what_cannot_be_is_refused(change, says):
    with assert_refused(says):
        replace(TASK, **change)


def test_torques_that_do_not_lift_the_arm_are_named():
    weak = limits_of("torque=[0.01,0.01],velocity=[6,8],angle=2.5", ARM)
    with assert_refused("no motion of 6 s keeps the limits"):
        design_trajectories(replace(TASK, limits=weak), effort=10)


def test_the_command_writes_what_a_controller_follows(tmp_path, run):
    parameters = "\n".join(f"{name} = {value}" for name, value in LINKS.items())
    (tmp_path / "arm.toml").write_text(
        f'[mechanism]\nkind = "double_pendulum"\n[mechanism.parameters]\n{parameters}\n',
        encoding="utf-8",
    )
    given = ("suggest", "--mechanism", "arm.toml", "--trajectory", "--length", "4")
    limits = ("--limits", "torque=[4,2],velocity=[6,8],angle=2.5", "--friction", TEXT)
    more = ("--recordings", "1", "--effort", "20", "--drive-rate", "100", "--figure", "p.png")
    out = ("--out", "t.csv")
    code, text, _ = run(tmp_path, *given, *limits, *more, *out)
    assert (code, "coulomb" in text, (tmp_path / "p.png").stat().st_size > 5000) == (0, True, True)
    table = pd.read_csv(io.BytesIO((tmp_path / "t.csv").read_bytes()))
    assert list(table) == ["time", "q1", "w1", "a1", "q2", "w2", "a2"]
    assert len(table) == 401
    assert np.gradient(table["q1"], table["time"])[5:-5] == pytest.approx(
        table["w1"][5:-5].to_numpy(), abs=0.02
    )
    again = (*given, *limits, *more, *out, "--replace", "--json")
    code, text, _ = run(tmp_path, *again)
    document = json.loads(text)
    assert (code, document["joints"][0]["joint"], len(document["written"])) == (0, "joint 1", 2)
