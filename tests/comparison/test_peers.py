"""The comparison with mujoco.sysid: the same machine and windows, answers from two processes."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from fixtures.paths import ROOT
from fixtures.random_machines import physical, states
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.mechanics import acrobot
from frictionid.simulate import load_rig, noise_free, simulate

FOLDER = ROOT / "comparisons/peers"
ROTORLESS = {"rotor": 0.0}


@pytest.fixture
def peers(monkeypatch):
    """The comparison's script as a module."""
    monkeypatch.syspath_prepend(str(FOLDER))
    import mujoco_sysid

    return mujoco_sysid


def need_toolbox():
    """Skip where the peer is not installed."""
    pytest.importorskip("mujoco", reason="the peer; the test extra installs it")
    from mujoco import sysid

    if not hasattr(sysid, "optimize"):
        pytest.skip("mujoco.sysid without its packages; the extra `peers` installs them")


def test_the_mjcf_is_the_same_machine(peers):
    """Mass matrix, gravity and velocity terms, and the motor's joint, at random states."""
    mujoco = pytest.importorskip("mujoco", reason="the peer; the test extra installs it")
    mechanism, rng = acrobot(), np.random.default_rng(1)
    for _ in range(20):
        v = {k: float(x) for k, x in physical(mechanism, rng).items()} | ROTORLESS
        q, w = states(mechanism, rng, ())
        model = mujoco.MjModel.from_xml_string(peers.mjcf(v))
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, w, 0.3
        mujoco.mj_forward(model, data)
        M, h = mechanism.dynamics(mechanism.base(v), q, w)
        mass = np.zeros((2, 2))
        mujoco.mj_fullM(model, data, mass)
        assert_allclose(mass, M, rtol=1e-10)
        assert_allclose(-data.qfrc_bias, h, rtol=1e-10, atol=1e-10)
        assert_array_equal(data.qfrc_actuator, [0.0, 0.3])


def test_a_rotor_is_refused(peers):
    with pytest.raises(ValueError, match="motor without rotor"):
        peers.mjcf({**acrobot().defaults, "rotor": 1e-5})


def short(rig, samples=62):
    """The rig with two of its recordings, made short, and a perfect camera."""
    camera = replace(rig.camera, samples=samples)
    return noise_free(replace(rig, recordings=rig.recordings[4:6], camera=camera))


def task_of_two(peers):
    return peers.task_of(simulate(short(load_rig(peers.RIG))))


def test_windows_are_whole_and_share_their_ends(peers):
    dataset = simulate(short(load_rig(peers.RIG)))
    task = peers.task_of(dataset)
    windows = task.windows(task.angle)
    assert windows.shape == (task.count, peers.LENGTH + 1, 2) == (6, 21, 2)
    recorded = dataset.recordings[1].angle.value
    assert_array_equal(windows[4], recorded[20:41])
    assert_array_equal(windows[4, -1], windows[5, 0])
    assert_allclose(task.start.reshape(-1, 4)[:, :2], windows[:, 0], atol=2e-3)
    time = task.start.shape[1] * peers.LENGTH / 60.0
    assert task.time[-1] == pytest.approx(time)


def test_the_methods_of_the_peer_agree_and_come_near_the_truth(peers):
    """Each in its own process; what is left is the peer's step, and that starts are smoothed."""
    need_toolbox()
    dataset = simulate(short(peers.truths(load_rig(peers.RIG))["coulomb_viscous"]))
    task = peers.task_of(dataset)
    found = {}
    for way in ("documented", "batched"):
        theta, wall, cpu = peers.solve(task, "mujoco_side.py", way)
        assert wall > 0.0 and cpu > 0.0
        assert np.all(peers.error_of(theta, "coulomb_viscous", dataset) < 0.05)
        found[way] = theta
    assert_allclose(found["batched"], found["documented"], rtol=1e-3, atol=1e-5)


def test_ours_comes_nearer(peers, tmp_path):
    import our_side
    from exchange import save

    dataset = simulate(short(peers.truths(load_rig(peers.RIG))["coulomb_viscous"]))
    task, result = tmp_path / "task.npz", tmp_path / "result.npz"
    save(peers.task_of(dataset), task)
    our_side.main(task, result, "coulomb_viscous")
    theta = np.load(result)["theta"]
    assert np.all(peers.error_of(theta, "coulomb_viscous", dataset) < 0.01)


def test_a_side_runs_in_its_own_process_which_is_timed(peers, tmp_path):
    side = tmp_path / "side.py"
    side.write_text("import sys, numpy as np; np.savez(sys.argv[2], theta=[float(sys.argv[3])])")
    theta, wall, cpu = peers.solve(task_of_two(peers), str(side), "0.5")
    assert theta == [0.5] and wall > 0.0 and cpu > 0.0


def test_a_tool_that_ends_is_reported(peers):
    task = task_of_two(peers)
    with pytest.raises(RuntimeError, match="no_side.py: .*No such file"):
        peers.solve(task, "no_side.py")


def run(peers, error, wall):
    return peers.Run("stribeck", "", 6, np.array(error), wall, wall)


def test_ratios_are_those_of_the_worst_seed(peers):
    ours = [run(peers, (0.1, 0.2), 1.0), run(peers, (0.1, 0.1), 2.0)]
    theirs = [run(peers, (1.0, 1.0), 20.0), run(peers, (2.0, 0.2), 20.0)]
    errors, faster = peers.ratios(ours, theirs)
    assert_allclose(errors, [0.1, 0.5])
    assert faster == 10.0


def test_nothing_that_a_side_would_import_is_imported_for_it():
    """The task's file needs NumPy only: importing more would hide it from one side's time."""
    code = "import sys; sys.path.insert(0, sys.argv[1]); import exchange; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code, str(FOLDER)], capture_output=True, text=True, check=True
    )
    assert not {"frictionid", "mujoco", "scipy"} & set(done.stdout.split())
