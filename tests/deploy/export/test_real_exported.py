"""Real motion replayed in MuJoCo, and by BAM's files: rows of comparisons/exported.py in little."""

from dataclasses import replace

import numpy as np
import pytest
from exported import halves, row
from fixtures.paths import DATA
from fixtures.shared import shared

import frictionid as fid
from frictionid.data.readers.dataset import load_dataset
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.nearest import at_horizon, reaching
from frictionid.evaluation.predicted_motion import predict

pytestmark = pytest.mark.real


def test_swing_ups_in_mujoco_err_as_ours(real_data):
    """Of the one-step fit to dfki_c1, rounded."""
    swingups = load_dataset(DATA / "dfki_c1_swingup", real_data / "dfki_double_pendulum")
    theta = np.array([[0.1257, 0.1337, 3.45, 0.0154], [0.0, 0.1365, 5.851, 0.02012]])
    done = row("swing-ups", fid.Friction(fid.Stribeck(), theta), swingups, swingups, 6)
    assert done.callback == pytest.approx(done.ours, rel=0.1)
    assert done.callback_apart < 0.002


@shared
def servo(real_data):
    return load_dataset(DATA / "bam_xl330", real_data / "bam_xl330")


def test_a_fitted_servo_is_the_same_after_a_file_of_bam(servo, tmp_path):
    training, held_out = halves(servo)
    fit = fid.fit(training, fid.GearLoad(moment=0.48052585), method="one_step")
    done = fit.export("bam", tmp_path / "m6.json", settings=ExportSettings("xl330"))
    assert done.lost == ()
    back = fid.load_model(tmp_path / "m6.json").friction
    motor = {name: back.parameters[name] for name in ("kt", "R", "rotor", "g")}
    own = replace(fit.friction, parameters=motor)
    prepared = exported(back, data=held_out).prepared
    initial = reaching(prepared.initial_states).take(np.arange(0, 60, 10))
    plant = prepared.plant[initial.recording]
    q = [
        at_horizon(predict(plant, f[None][np.zeros(len(initial.q), dtype=int)], initial).q, initial)
        for f in (own, back)
    ]
    np.testing.assert_allclose(q[1], q[0], atol=1e-9)


def test_the_published_servo_in_mujoco_errs_as_ours(servo):
    friction = fid.load_model(DATA / "bam_xl330/m6.json").friction
    done = row("M6", friction, *halves(servo), 4)
    assert done.callback_apart < 0.002
    assert done.alone > 1.5 * done.ours  # what a file without the callback loses
