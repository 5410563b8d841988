"""Parameter files of BAM: its formula, read and written back, and damaged ones."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from drive_logs import ServoPendulum
from fixtures.bam_formula import bam_friction
from fixtures.mistakes import mistakes
from fixtures.refusals import assert_refused
from numpy.random import default_rng
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.plants import Calibration
from frictionid.data.readers.dataset import load_dataset
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.formats.bam import held
from frictionid.deploy.export.nearest import nearest
from frictionid.friction import Friction, Inputs, along
from frictionid.friction.bam_files import GEAR, GRAVITY, MODELS, read_bam
from frictionid.friction.laws import CoulombViscous, GearLoad, MotorLoad, Quadratic, Stribeck

MOMENT = 0.48
RIG = ServoPendulum(coulomb=0.03, viscous=0.02)


def published(model, rng):
    """Numbers of a model of BAM, drawn."""
    values = {name: float(rng.uniform(0.01, 0.3)) for name in MODELS[model]}
    if "alpha" in values:
        values |= {"alpha": 1.7, "dtheta_stribeck": 0.8}
    return {"model": model, "actuator": "xl330", "moment": MOMENT, **values}


@pytest.mark.parametrize("model", MODELS)
def test_each_model_is_that_of_bam(model, tmp_path):
    rng = default_rng(3)
    path = tmp_path / "it.json"
    path.write_text(json.dumps(published(model, rng)))
    friction = fid.load_model(path).friction
    q, w, u = 2.0 * rng.standard_normal((3, 10_000, 1))
    own = friction.law.sharpened().torque(friction.theta, Inputs(q, w, u, 0 * u), ())[:, 0]
    p, te = published(model, default_rng(3)), -MOMENT * np.sin(q)
    wanted = [np.sign(b) * bam_friction(p, a, c, b) for a, b, c in np.stack([u, w, te], -1)[:, 0]]
    assert_allclose(own, wanted, rtol=1e-9, atol=1e-9)


def written(friction, speeds=()):
    own = exported(friction, speeds=speeds)
    return own, writer_of("bam")(own, ExportSettings(name="xl330"))


ROW = dict(zip(GEAR, (0.02, 0.01, 0.2, 0.1, 0.05, 0.1, 0.05, 0.01, 0.02, 0.8, 1.5), strict=True))
FRICTIONS = {
    "m1": (CoulombViscous(), [0.1, 0.02]),
    "m2": (Stribeck(), [0.1, 0.05, 0.5, 0.02]),
    "m3": (GearLoad(MOMENT), [0.02, 0.01, 0.2, 0.2, 0, 0, 0, 0, 0, 1.0, 2.0]),
    "m4": (GearLoad(MOMENT), [0.02, 0.01, 0.2, 0.2, 0.1, 0.3, 0.3, 0, 0, 1.0, 2.0]),
    "m5": (MotorLoad(), [0.02, 0.01, 0.2]),
    "m6": (GearLoad(MOMENT), list(ROW.values())),
}


@pytest.mark.parametrize("model", FRICTIONS)
def test_what_bam_holds_is_written_and_read_back_as_it_is(model):
    law, row = FRICTIONS[model]
    friction = Friction(law, [row], {"rotor": 0.002, "kt": 0.4, "R": 3.0})
    _, made = written(friction)
    document = json.loads(made.files[".json"])
    assert document["model"] == model and set(MODELS[model]) <= set(document)
    assert made.lost == () and made.held is None
    back = read_bam(document, "it")
    assert {k: back.parameters[k] for k in friction.parameters} == dict(friction.parameters)
    rng = default_rng(1)
    x = Inputs(*(2.0 * rng.standard_normal((4, 10_000, 1))))
    own, read = (f.law.torque(f.theta, x, ()) for f in (friction, back))
    assert_allclose(read, own, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    "output, R, missing", [("voltage", 5.4, ""), ("current", None, "R of the motor")]
)
def test_the_motor_of_a_geared_servo_is_that_at_its_output(output, R, missing):
    actuator = {"target": "target", "output": output, "P": 4.0, "kt": 0.005, "gear": 200}
    actuator |= {} if R is None else {"R": R}
    frames = {"soft": pd.DataFrame(RIG.log(4.0, 0.05, seed=1, seconds=2.0))}
    machine = fid.mechanisms.pendulum(mass=RIG.mass, length=RIG.length, rotor=1e-7, gear=200)
    data = fid.Dataset.from_frames(frames, machine, time="t", angle="q", actuator=actuator)
    friction = Friction(CoulombViscous(), [[0.03, 0.02]])
    made = writer_of("bam")(exported(friction, data=data), ExportSettings())
    back = read_bam(json.loads(made.files[".json"]), "it").parameters
    wanted = {"rotor": 1e-7 * 200**2, "kt": 0.005 * 200, "R": R}
    assert back == {k: pytest.approx(v) for k, v in wanted.items() if v} | {"g": GRAVITY}
    assert " ".join(made.lost).partition(" are not")[0] == missing


def test_a_fitted_motor_has_no_torque_constant_without_its_gear():
    motor = replace(Calibration.ideal(1), motor=np.array([0.005, 5.4]))
    friction = Friction(CoulombViscous(), [[0.1, 0.02]], calibration=motor)
    _, made = written(friction)
    assert json.loads(made.files[".json"])["R"] == 5.4 and "armature, kt of" in made.lost[0]


def test_other_laws_are_held_by_the_nearest_one():
    friction = Friction(Quadratic(), [[0.1, 0.02, 0.001]])
    own, made = written(friction, (5.0,))
    assert made.held is not None and "BAM has no Quadratic: M" in made.lost[0]
    grid = np.linspace(0.1, 5.0, 50)
    off = held(own).curve(grid) - friction.curve(grid)
    assert np.sqrt((off**2).mean()) < 0.003  # of torques up to 0.2 N m
    assert "armature, kt, R of the motor are not known" in made.lost[1]


def test_a_law_that_follows_the_motor_is_held_by_one_that_does():
    """Along recorded motion, its square of the motor torque is nearly a share of it."""
    whole = load_dataset("acrobot_clean")
    driven = [r for r in whole.recordings if np.ptp(r.torque.value) > 0]
    friction = Friction(MotorLoad(squared=True), [[0.02, 0.01, 0.3, 0.1]] * 2)
    own = exported(friction, data=replace(whole, recordings=tuple(driven[:1])))
    nodes = own.prepared.integral.nodes
    model, other = (along(f, nodes) for f in (friction, held(own)))
    plain = along(nearest(own), nodes)
    rms = [np.sqrt(((x - model) ** 2).mean(axis=0)) for x in (other, plain)]
    assert rms[0][1] < 0.2 * rms[1][1]  # of the second joint, which has the motor
    made = writer_of("bam")(own, ExportSettings())
    assert json.loads(made.files["_2.json"])["model"] == "m5" and "M5" in made.lost[0]


DAMAGES = r"""
{"model": ["m1"]}          => model "\['m1'\]" is unknown
{"model": "m7"}            => model 'm7' is unknown; known are m1, m2
{"friction_viscous": null} => needs the number 'friction_viscous', it is None
{"alpha": NaN}             => 'alpha', it is nan
{"friction_base": -0.1}    => friction_base = -0.1 must not be negative
{"moment": null}           => 'moment', it is None
{"kt": "x"}                => 'kt', it is 'x'
{"moment": "gone"}         => add "moment", mass times gravity times length
{"dtheta_stribeck": "gone"} => 'dtheta_stribeck', it is missing
"""


@mistakes(DAMAGES)
def test_damaged_files_are_refused_in_one_line(wrong, words):
    document = published("m6", default_rng(0)) | json.loads(wrong)
    document = {name: value for name, value in document.items() if value != "gone"}
    with assert_refused(words) as caught:
        read_bam(document, "it.json")
    assert str(caught.value).startswith("it.json: ")
