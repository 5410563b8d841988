"""The monitor on an arm whose URDF lacks rotors: wear and a payload are called by their names."""

import numpy as np
import pandas as pd
import pytest
from fixtures.changed_data import changed
from fixtures.shared import shared
from fixtures.sines import sines, torque_without_friction

import frictionid as fid
from frictionid.arrays import picked
from frictionid.deploy.monitor.judgement import judge
from frictionid.mechanics import urdf

ARM = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0 0 0.15"/><mass value="3"/>
<inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.003"/></inertial></link>
<link name="fore"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
<inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.002"/></inertial></link>
<link name="hand"><inertial><origin xyz="0 0 {centre!r}"/><mass value="{mass!r}"/>
<inertia ixx="{inertia!r}" ixy="0" ixz="0" iyy="{inertia!r}" iyz="0" izz="0.002"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<axis xyz="0 1 0"/></joint><joint name="elbow" type="revolute"><parent link="upper"/>
<child link="fore"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/></joint>
<joint name="wrist" type="revolute"><parent link="fore"/>
<child link="hand"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/></joint></robot>"""
MASS, LENGTH = 2.0, 0.4
COULOMB, VISCOUS = np.array([1.2, 0.6, 0.4]), np.array([0.4, 0.15, 0.1])
ANGLES, TORQUES = ["q1", "q2", "q3"], ["u1", "u2", "u3"]
ROTORS = np.array([0.3, 0.2, 0.1])  # [kg m^2], as their joints see them


def arm(folder, payload=0.0):
    """The arm with a point mass at its tip."""
    mass = MASS + payload
    centre = (MASS * LENGTH / 2 + payload * LENGTH) / mass
    origin = MASS * LENGTH**2 / 3 + payload * LENGTH**2  # second moment about the elbow
    path = folder / f"arm_{payload:g}.urdf"
    path.write_text(ARM.format(mass=mass, centre=centre, inertia=origin - mass * centre**2))
    return urdf(path)


def recorded(folder, seed, count, payload=0.0, wear=0.0):
    """Recordings along sines, with noise of encoders and of the torque."""
    machine, rng = arm(folder, payload), np.random.default_rng(seed)
    time, out = np.arange(0.0, 12.0, 0.005), {}
    for k in range(count):
        size = rng.uniform(0.3, 0.9, (3, 3))
        rate = rng.uniform(0.9, 3.5, (3, 3))
        q, w, a = sines(
            time, *(tuple(zip(*row, strict=True)) for row in zip(size, rate, strict=True))
        )
        level = COULOMB * (1 + rng.normal(scale=0.01, size=3)) * np.array([1.0, 1.0 + wear, 1.0])
        torque = torque_without_friction(machine, q, w, a) + level * np.sign(w) + VISCOUS * w
        torque += ROTORS * a
        torque = torque * (1 + rng.normal(scale=0.01, size=torque.shape))
        angle = q + rng.normal(scale=1e-4, size=q.shape)
        columns = np.column_stack([time, angle, torque])
        out[f"r{seed}_{k}"] = pd.DataFrame(columns, columns=["t", *ANGLES, *TORQUES])
    return fid.Dataset.from_frames(out, arm(folder), time="t", angle=ANGLES, torque=TORQUES)


@shared
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("arm")


@shared
def known(folder):
    return fid.baseline(recorded(folder, 1, 10))


@shared
def carrying(known, folder):
    return fid.monitor(known, recorded(folder, 2, 4, payload=0.1))


@pytest.mark.parametrize("payload", [0.02, 0.1])
def test_a_payload_at_the_tip_is_no_friction(known, carrying, folder, payload):
    new = recorded(folder, 2, 3, payload=payload)
    found = carrying if payload == 0.1 else fid.monitor(known, new)
    assert found.answer == "other"
    assert found.judgement.causes[0].startswith("the payload's inertia: mass +")
    share = float(found.judgement.causes[0].split("mass +")[1].split(" ")[0]) / 100
    assert share == pytest.approx(payload / MASS, rel=0.3)


def test_wear_of_one_joint_is_named_alone(known, folder):
    found = fid.monitor(known, recorded(folder, 3, 3, wear=0.25))
    assert found.answer == "changed" and found.judgement.joints == (1,)
    assert len(found.judgement.causes) == 1
    frame = found.frame.set_index(["joint", "part"])
    assert frame.change["elbow", "total"] == pytest.approx(0.25 * COULOMB[1], rel=0.1)
    assert frame.p["shoulder", "total"] > 0.01


@pytest.mark.parametrize("late", [-0.01, 0.002, 0.005, 0.02])
def test_a_late_torque_is_no_friction(known, folder, late):
    """Up to four samples: a torque jumps where friction turns, a sample further on."""
    data = changed(recorded(folder, 2, 3), "torque", lambda u: u, late)
    found = fid.monitor(known, data).judgement
    assert found.answer == "other" and found.changed == ("the torque's delay",)
    said = float(found.causes[0].split(": ")[1].split(" ms")[0])
    assert said == pytest.approx(-1e3 * late, rel=0.1)


def test_a_negative_mass_is_no_payload(known):
    lighter = picked(known.changes, [0, 1, 2])
    lighter.value[:, [e.name for e in known.reference.effects].index("mass")] -= 3.0
    found = judge(known, lighter)
    assert found.answer == "cannot_tell" and found.changed == ("the payload's inertia",)
    assert "no mass is negative" in found.notes[-1]


def test_torques_in_another_unit_are_no_judgement(known, folder):
    data = changed(recorded(folder, 5, 2), "torque", lambda u: 1e3 * u)
    found = fid.monitor(known, data)
    assert found.answer == "cannot_tell"
    assert any("check the torque's unit" in note for note in found.judgement.notes)


def test_a_baseline_is_said_in_a_line_and_comes_first(known, folder):
    assert repr(known) == "Baseline(10 recordings of shoulder, elbow, wrist)"
    with pytest.raises(fid.InputError, match="is no baseline; give one, or its file, first"):
        fid.monitor(recorded(folder, 6, 1), known)


def test_the_picture_shows_friction_beside_what_changed(carrying):
    picture = carrying.plot()
    for axis in picture.axes[:3]:
        _, healthy, new = (np.asarray(drawn.get_ydata()) for drawn in axis.lines[:3])
        assert abs(new.mean() - healthy.mean()) < 2.0  # % of the friction
        assert max(np.ptp(healthy), np.ptp(new)) < 6.0
