"""The double pendulum as a URDF has the numbers of the built-in one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frictionid.mechanics import double_pendulum, urdf

PARAMETERS = {"m1": 0.6, "m2": 0.4, "l1": 0.25, "r1": 0.12, "r2": 0.15, "I1": 0.013, "I2": 0.012}
URDF = """<robot name="pendulum"><link name="base"/>
<link name="upper"><inertial><origin xyz="0 0 -{r1}"/><mass value="{m1}"/>
 <inertia ixx="{J1}" ixy="0" ixz="0" iyy="{J1}" iyz="0" izz="0"/></inertial></link>
<link name="lower"><inertial><origin xyz="0 0 -{r2}"/><mass value="{m2}"/>
 <inertia ixx="{J2}" ixy="0" ixz="0" iyy="{J2}" iyz="0" izz="0"/></inertial></link>
<joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>
 <axis xyz="0 -1 0"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
 <origin xyz="0 0 -{l1}"/><axis xyz="0 -1 0"/></joint></robot>"""


@pytest.fixture
def both(tmp_path):
    """The built-in one and the one of a URDF; both swing in a vertical plane."""
    v = PARAMETERS
    J = {f"J{i}": v[f"I{i}"] - v[f"m{i}"] * v[f"r{i}"] ** 2 for i in (1, 2)}
    path = tmp_path / "pendulum.urdf"
    path.write_text(URDF.format(**v, **J))
    return double_pendulum().with_values(v), urdf(path)


def test_drawings_are_the_same(both):
    q = np.random.default_rng(0).uniform(-3, 3, (5, 3, 2))
    ours, theirs = (m.points(q) for m in both)
    assert ours.shape == (5, 3, 3, 2)  # the origin, the elbow, the lower link's centre of mass
    # the URDF draws base, shoulder, elbow and the centre of mass, in space
    assert_allclose(theirs[..., 1:, ::2], ours, atol=1e-12)
    assert_allclose(theirs[..., 1], 0.0, atol=1e-12)
    assert_allclose(np.linalg.norm(np.diff(ours, axis=-2)[..., 0, :], axis=-1), 0.25)


def test_a_centre_of_mass_beside_the_link_and_a_rotor_have_parameters_of_their_own(both):
    assert both[1].base_names == (
        *("mx_upper", "mz_upper", "Iyy_upper"),
        *("mx_lower", "mz_lower", "Iyy_lower", "rotor_elbow"),
    )
