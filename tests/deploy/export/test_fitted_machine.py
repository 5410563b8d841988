"""A fitted machine in a file: its bodies have the base parameters, and what is left is said."""

import re
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest
from fixtures import driven_wrist as wrist
from fixtures.shared import shared
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.data.plants import Calibration
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.formats.mujoco import fitted_bodies, not_reached, physical_parameters
from frictionid.deploy.export.nearest import kept_inertias
from frictionid.mechanics import configurations
from frictionid.mechanics.mjcf_text import mjcf_of
from frictionid.progress import listening


@shared
def arm(tmp_path_factory):
    return wrist.mechanism(tmp_path_factory.mktemp("arm"))


@shared
def described(tmp_path_factory):
    """The arm as a file describes it whose last body is lighter, without the coupled part."""
    path = tmp_path_factory.mktemp("described") / "arm.urdf"
    path.write_text(wrist.URDF.replace('value="2"', 'value="1.5"'))
    return fid.mechanisms.urdf(path)


@shared
def data(described, tmp_path_factory):
    true = wrist.mechanism(tmp_path_factory.mktemp("true"), driven=True)
    return wrist.dataset(described, wrist.frame(true, seconds=4.0))


@shared
def fit(data):
    return fid.fit(data, "coulomb_viscous", method="inverse_dynamics")


def dynamics(text, q, w):
    """M(q) and h(q, w) by MuJoCo."""
    model = mujoco.MjModel.from_xml_string(text)
    state, M, h = mujoco.MjData(model), np.empty((len(q), model.nv, model.nv)), np.empty(w.shape)
    for k in range(len(q)):
        state.qpos[:], state.qvel[:] = q[k], w[k]
        mujoco.mj_forward(model, state)
        mujoco.mj_fullM(model, state, M[k])
        h[k] = -state.qfrc_bias
    return M, h


def test_masses_and_inertias_with_base_parameters_are_those_of_bodies():
    """Also where the nearest ones are not: the second link's mass lies too far out."""
    nominal = {"m1": 0.61, "m2": 0.63, "r1": 0.275, "r2": 0.166, "I1": 0.0547, "I2": 0.0252}
    true = {"m1": 0.49, "m2": 0.57, "r1": 0.22, "r2": 0.187, "I1": 0.042, "I2": 0.0208}
    arm = fid.mechanisms.double_pendulum(**nominal, l1=0.3, Ir=6e-5, gr=6.0)
    base = np.asarray(arm.base(arm.nominal(true | {"l1": 0.28, "Ir": 9.4e-5})))
    values = physical_parameters(arm, base)
    assert_allclose(arm.base(values), base, rtol=1e-8)
    assert_same(mjcf_of(arm, values), arm, base)


def assert_same(text, arm, base):
    q = configurations(arm.n, 5)
    found, wanted = dynamics(text, q, np.sin(7 * q)), arm.dynamics(base, q, np.sin(7 * q))
    for ours, theirs in zip(wanted, found, strict=True):
        assert_allclose(theirs, ours, rtol=1e-6, atol=1e-6 * np.abs(ours).max())


def test_mujoco_has_the_inertia_of_any_bodies_by_their_base_parameters(arm):
    base = wrist.base_of_other_bodies(arm, np.random.default_rng(0))
    written, parameters = fitted_bodies(arm, base)
    text = mjcf_of(written, parameters)
    assert_same(text, arm, base)
    assert not_reached(written, parameters, base) == []
    assert mujoco.MjModel.from_xml_string(text).tendon("turner")


def test_of_base_parameters_that_no_bodies_have_the_nearest_are_written_and_named(arm):
    base = np.array(arm.nominal_base)
    base[arm.base_names.index("rotor_turner")] = -0.2
    written, parameters = fitted_bodies(arm, base)
    (said,) = not_reached(written, parameters, base)
    assert "rotor_turner -0.2 kg m^2 (written " in said and "--consistent" in said
    assert_same(mjcf_of(written, parameters), arm, written.base(parameters))


def test_a_machine_whose_fit_no_bodies_have_is_written_with_the_nearest(tmp_path):
    """An acrobot's second inertia stands at two places, which a fit tells apart by its noise."""
    data = fid.load_dataset("acrobot_clean")
    base = np.array(data.mechanism.nominal_base)
    base[1] *= 1.004
    calibration = replace(Calibration.ideal(2), base=base)
    model = fid.Friction(fid.CoulombViscous(), np.full((2, 2), 0.01), calibration=calibration)
    made = fid.export(model, "mujoco", tmp_path / "acrobot.xml", data=data)
    assert made.round_trip.predictions == 48  # of more
    (said,) = [line for line in made.lost if "no bodies have" in line]
    assert "inertia_12 0.003965 kg m^2 (written 0.003957)" in said and "--consistent" not in said


def test_a_fit_to_an_arm_is_written_as_mjcf_with_its_inertias(fit, data, tmp_path):
    """What runs is said on the way: it takes seconds."""
    steps = []
    with listening(lambda what, left: steps.append((what, left))):
        made = fit.export("mujoco", tmp_path / "arm.xml")
    assert steps[0] == ("masses and inertias", 1) and steps[-1] == ("run in MuJoCo", 1)
    assert_same(made.paths[0].read_text(), data.mechanism, np.asarray(fit.calibration.base))


def test_the_command_shows_what_runs(fit, tmp_path, run, monkeypatch):
    fit.save(tmp_path / "arm.json")
    titles = []
    monkeypatch.setattr("frictionid.deploy.cli.heard", lambda t: titles.append(t) or nullcontext())
    assert run(tmp_path, "export arm.json --to c --out friction.c")[0] == 0
    assert titles == ["exporting (arm.json)"]


@pytest.mark.parametrize("to", ["mujoco", "isaac"])
def test_inertia_that_a_fit_has_more_is_armature_where_rotors_explain_it(to, data, tmp_path):
    """The first two are parts of the inertias of bodies."""
    arm, into = data.mechanism, tmp_path / "arm.xml"
    into.write_text(mjcf_of(arm))
    rotors = {"rotor_one": 0.4, "rotor_two": 0.3, "rotor_three": 0.05}
    base = np.asarray(arm.base(arm.nominal(rotors)))
    fitted = replace(Calibration.ideal(3), base=base)
    model = fid.Friction(fid.CoulombViscous(), np.full((3, 2), 0.1), calibration=fitted)
    made = writer_of(to)(exported(model, arm.joints, (), data), ExportSettings(into=into))
    (text,) = (content.decode() for content in made.files.values())
    if to == "mujoco":
        assert_same(text, arm, base)
    else:
        armature = eval(re.search("armature=(.*),", text)[1])
        assert armature == pytest.approx(dict(zip(arm.joints, rotors.values(), strict=True)))
    assert made.lost == ()


@pytest.mark.parametrize("rotor", [0.0, 0.004])
def test_a_rotor_that_nobody_has_described_is_said_to_be_in_the_bodies(rotor):
    rig = fid.mechanisms.pendulum(mass=0.5, length=0.15, rotor=rotor)
    fitted = replace(Calibration.ideal(1), base=np.array([0.01525, 0.7358]))
    model = fid.Friction(fid.CoulombViscous(), [[0.06, 0.03]], calibration=fitted)
    time = np.arange(400) / 100
    frames = {"a": pd.DataFrame({"t": time, "q": np.sin(time)})}
    data = fid.Dataset.from_frames(frames, rig, time="t", angle="q")
    made = writer_of("mujoco")(exported(model, rig.joints, (), data), ExportSettings())
    assert any("no rotor is described (rotor of" in note for note in made.notes) == (not rotor)
    assert ('armature="0.0"' in made.files[".xml"].decode()) == (not rotor)


@pytest.mark.parametrize("to", ["mujoco", "urdf", "isaac"])
def test_what_a_file_keeps_that_the_fit_has_otherwise_is_named(to, fit, described, tmp_path):
    """The mass of the last body, of which the base parameters of the second have a part."""
    into = Path(described.options["urdf"])
    if to == "mujoco":
        into = tmp_path / "arm.xml"
        into.write_text(mjcf_of(described))
    biased = replace(fit.friction.calibration, bias=np.array([0.1, 0.0, 0.0]))
    own = exported(replace(fit.friction, calibration=biased), described.joints)
    lost = "\n".join(writer_of(to)(own, ExportSettings(into=into)).lost)
    at = described.base_names.index("my_c")
    fitted, file = fit.calibration.base[at], described.nominal_base[at]
    assert f"my_c {fitted:.4g} kg m (described {file:.4g})" in lost
    assert "--to mujoco without --into writes them" in lost
    assert ("no constant torque (0.1, 0, 0 N m)" in lost) == (to == "urdf")


def test_a_file_that_the_fit_bears_out_keeps_nothing(fit):
    source = fit.friction.provenance
    borne_out = [replace(e, nominal=e.value) for e in source.refined.parameters]
    notes = {"refined": replace(source.refined, parameters=tuple(borne_out))}
    assert kept_inertias(exported(fit.friction), "URDF")
    assert kept_inertias(exported(fit.friction.noted(notes)), "URDF") == []
