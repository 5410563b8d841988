"""Round trip through Newton: its importer reads the stage, its MuJoCo solver moves as we do."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import frictionid as fid
from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.mechanics import Plant, pendulum

pytest.importorskip("newton", reason="`pip install newton[importers,sim]` installs it")
import newton
from pxr import Gf, Usd, UsdGeom, UsdPhysics

pytestmark = pytest.mark.filterwarnings("ignore")
ROTOR, LEVELS = 0.002, np.array([[0.12, 0.02]])
ROD = {"mass": 0.5, "length": 0.3, "inertia": 1e-4, "g": 9.81}
STEP, EVERY = 2.5e-4, 40  # [s], steps between samples


def stage_of(path):
    """A stage with a pendulum about y; its mass hangs below the joint."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, "Z")
    root = UsdGeom.Xform.Define(stage, "/arm").GetPrim()
    stage.SetDefaultPrim(root)
    UsdPhysics.ArticulationRootAPI.Apply(root)
    UsdPhysics.Scene.Define(stage, "/scene")
    link = UsdGeom.Xform.Define(stage, "/arm/link").GetPrim()
    UsdPhysics.RigidBodyAPI.Apply(link)
    mass = UsdPhysics.MassAPI.Apply(link)
    mass.CreateMassAttr(ROD["mass"])
    mass.CreateCenterOfMassAttr(Gf.Vec3f(0, 0, -ROD["length"]))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*3 * [ROD["inertia"]]))
    joint = UsdPhysics.RevoluteJoint.Define(stage, "/arm/hip")
    joint.CreateAxisAttr("Y")
    joint.CreateBody1Rel().SetTargets([link.GetPath()])
    stage.Save()
    return path


@pytest.fixture
def model(tmp_path):
    """What Newton makes of an exported stage."""
    path = stage_of(tmp_path / "arm.usda")
    friction = Friction(fid.CoulombViscous(), LEVELS, {"rotor": ROTOR})
    settings = ExportSettings(into=path, folder=tmp_path)
    made = writer_of("usd")(exported(friction, ("hip",), (5.0,)), settings)
    out = tmp_path / "out.usda"
    out.write_bytes(made.files[".usda"])
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.add_usd(str(out))
    return builder.finalize(device="cpu")


def test_newton_reads_the_numbers_of_the_model(model):
    read = [model.joint_friction, model.joint_damping, model.joint_armature]
    assert_allclose(np.ravel([x.numpy() for x in read]), [*LEVELS[0], ROTOR], rtol=1e-6)


def test_newton_moves_as_we_predict(model):
    """A swing of a second, in steps of a quarter of a millisecond and single precision."""
    solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True)
    state, after, control = model.state(), model.state(), model.control()
    state.joint_q.assign(np.array([2.0], dtype=np.float32))
    q = [2.0]
    for k in range(1, 100 * EVERY + 1):
        solver.step(state, after, control, None, STEP)
        state, after = after, state
        if k % EVERY == 0:
            q.append(float(state.joint_q.numpy()[0]))
    plant = Plant.from_parameters(pendulum(), {**ROD, "rotor": ROTOR})
    begin, u = State(np.array([2.0]), np.zeros(1)), np.zeros((100, 1))
    ours = rollout(plant, Friction(fid.CoulombViscous(), LEVELS), begin, u, np.full(100, 0.01))
    assert_allclose(q, ours.q[:, 0], rtol=0, atol=2e-3)
