"""The committed simulated data sets: what they are made from, what they contain, what they show."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from fixtures.paths import DATA

from frictionid.arrays import inverse, times
from frictionid.data.readers.dataset import load_dataset
from frictionid.simulate import load_rig, simulate

NAMES = ("acrobot_sim", "acrobot_clean", "acrobot_lag", "acrobot_lugre")


@pytest.fixture(scope="session")
def committed():
    return {name: load_dataset(DATA / name) for name in NAMES}


def speeds(dataset):
    """True velocities of all recordings, shape (K, n)."""
    return np.concatenate([r.truth.velocity.value for r in dataset.recordings if r.truth])


@pytest.mark.parametrize("name", NAMES)
def test_a_data_set_is_what_its_rig_makes(name, committed):
    """One to its end; the others in the first second of commands that depend on no length."""
    rig = load_rig(DATA / name / "rig.toml")
    found, kept = committed[name], rig.recordings
    if name != "acrobot_clean":
        kept = [r for r in kept if r.name[3:] not in ("chirp", "multisine", "noise")]
        rig = replace(rig, recordings=tuple(kept), camera=replace(rig.camera, samples=61))
    expected = simulate(rig)
    assert found.mechanism == expected.mechanism
    assert found.truth == expected.truth
    assert found.origin == expected.origin
    names = [run.name for run in kept]
    recordings = [r for r in found.recordings if r.name in names]
    for a, b in zip(recordings, expected.recordings, strict=True):
        assert a.name == b.name
        seen = len(b.angle.time)
        assert np.array_equal(a.angle.time[:seen], b.angle.time)
        torque = a.torque.value[: len(b.torque.value)]
        assert np.abs(torque - b.torque.value).max() < 1e-6, a.name
        assert np.abs(a.angle.value[:seen] - b.angle.value).max() < 1e-6, a.name
        assert a.truth and b.truth
        for quantity in ("angle", "velocity"):
            true, made = (getattr(r.truth, quantity).value for r in (a, b))
            assert np.abs(true[:seen] - made).max() < 1e-6, a.name


def test_rounding_does_not_grow_to_what_the_regeneration_tolerates():
    rig = replace(load_rig(DATA / "acrobot_sim/rig.toml"), substeps=2)
    moved = tuple(
        replace(run, start_angle=tuple(q + 1e-11 for q in run.start_angle))
        for run in rig.recordings
    )
    pairs = zip(
        simulate(rig).recordings, simulate(replace(rig, recordings=moved)).recordings, strict=True
    )
    growth = max(
        np.abs(a.truth.velocity.value - b.truth.velocity.value).max() / 1e-11
        for a, b in pairs
        if a.truth and b.truth
    )
    # one part in 1e-13 is what another processor's sine may add up to
    assert 1.0 < growth < 1e5


@pytest.mark.parametrize("name", NAMES)
def test_size_and_range(name, committed):
    dataset = committed[name]
    size = sum(path.stat().st_size for path in (DATA / name).iterdir())
    w = speeds(dataset)
    assert size < 1_000_000
    assert len(dataset.recordings) == 25
    assert len(w) == 8575
    assert dataset.origin["origin"] == "simulated by frictionid simulate"
    assert sum(not r.torque.value.any() for r in dataset.recordings) >= 3  # free decays
    assert np.abs(np.concatenate([r.torque.value for r in dataset.recordings])).max() <= 0.14
    for forward in (w > 0.05, w < -0.05):  # an elastic bristle never stands exactly still
        assert (forward.mean(axis=0) > 0.3).all()
    assert ((w > 0.05) | (w < -0.05)).mean(axis=0).min() > 0.65
    assert (np.quantile(np.abs(w), 0.95, axis=0) > (6.0, 12.0)).all()
    assert np.abs(w).max() < 40.0


def test_the_sets_differ_only_where_they_say(committed):
    curves = [
        {key: committed[name].truth[key] for key in ("coulomb_positive", "peak_negative")}  # type: ignore[index]
        for name in NAMES
    ]
    rigs = [load_rig(DATA / name / "rig.toml") for name in NAMES]
    assert all(curve == curves[0] for curve in curves)
    assert all(rig.recordings == rigs[0].recordings for rig in rigs)
    assert all(rig.camera == rigs[0].camera for rig in rigs)
    assert [rig.drive.delay for rig in rigs] == [0.018, 0.0, 0.0, 0.0]
    assert [rig.true_parameters for rig in rigs] == [{"rotor": 2e-6}, {}, {}, {}]
    assert [rig.friction.kind for rig in rigs] == ["stribeck", "stribeck", "film_lag", "lugre"]


def test_noise_is_that_of_the_camera(committed):
    for name in NAMES:
        noise = np.concatenate(
            [r.angle.value - r.truth.angle.value for r in committed[name].recordings if r.truth]
        )
        assert noise.std() == pytest.approx(np.deg2rad(0.093), rel=0.02)
        assert abs(noise.mean()) < 4 * noise.std() / np.sqrt(noise.size)


# The study's recipe, written down once more in plain NumPy: it is what `acrobot_sim` is tuned to.
HISTORY = 9


def one_step(dataset):
    """Euler residual r (K, n), G (K, n, n), last velocities (K, 9, n), number of recording (K,)."""
    mechanism = dataset.mechanism
    p = mechanism.base(mechanism.nominal())
    parts = []
    for number, recording in enumerate(dataset.recordings):
        q, u = recording.angle.value, recording.torque.value
        dt = float(recording.angle.time[1] - recording.angle.time[0])
        w = np.diff(q, axis=0) / dt  # w[k] belongs to sample k + 1
        at = np.arange(HISTORY, len(q) - 1)
        M, h = mechanism.dynamics(p, q[at], w[at - 1])
        G = inverse(M) * dt
        r = w[at - 1] + times(G, h + u[at]) - w[at]
        past = np.stack([w[at - 1 - lag] for lag in range(HISTORY)], axis=1)
        parts.append((r, G, past, np.full(len(at), number)))
    r, G, past, numbers = (np.concatenate(part) for part in zip(*parts, strict=True))
    return r, G, past, numbers


def hat_basis(w):
    """Hat functions of one joint's velocity, denser near zero, shape (K, 40)."""
    even = np.linspace(-1.0, 1.0, 40)
    nodes = np.abs(w).max() * np.sinh(5.0 * even) / np.sinh(5.0)
    return np.stack([np.interp(w, nodes, peak) for peak in np.eye(40)], axis=-1)


@cache
def losses(name):
    """Mean one-step loss [rad/s] of no, a static and a nine-sample friction, shape (10, 3)."""
    dataset = load_dataset(DATA / name)
    r, G, past, numbers = one_step(dataset)
    joints = range(r.shape[1])
    static = [hat_basis(past[:, 0, j]) for j in joints]
    nine = [np.hstack([static[j], past[:, :, j]]) for j in joints]
    designs = [
        np.concatenate([G[:, :, [j]] * basis[j][:, None, :] for j in joints], axis=2)
        for basis in (static, nine)
    ]
    order = np.random.default_rng(0).permutation(len(dataset.recordings))
    rows = []
    for fold in np.array_split(order, 10):
        out = np.isin(numbers, fold)
        errors = [r[out]]
        for A in designs:
            inside, target = A[~out].reshape(-1, A.shape[2]), r[~out].ravel()
            square = inside.T @ inside
            # a hat that the training recordings do not reach stays near zero
            ridge = 1e-6 * np.trace(square) / len(square) * np.eye(len(square))
            errors.append(r[out] - A[out] @ np.linalg.solve(square + ridge, inside.T @ target))
        rows.append([np.linalg.norm(error, axis=1).mean() for error in errors])
    return np.array(rows)


def test_the_study_s_recipe_gives_the_study_s_numbers():
    """Its three losses, in this order in every fold, need no friction with memory."""
    loss = losses("acrobot_sim")
    assert np.abs(loss.mean(axis=0) - (0.61, 0.44, 0.37)).max() < 0.015
    assert (np.diff(loss, axis=1) < 0).all()


def test_delay_and_rotor_make_most_of_what_nine_samples_find():
    clean, sim = (
        loss[:, 1].mean() - loss[:, 2].mean()
        for loss in map(losses, ("acrobot_clean", "acrobot_sim"))
    )
    assert clean < 0.25 * sim


@pytest.mark.parametrize("name", NAMES[2:])
def test_true_memory_leaves_less_trace_than_delay_and_rotor(name):
    loss = losses(name).mean(axis=0)
    assert loss[1] - loss[2] < 0.5 * 0.07
    assert loss[0] - loss[1] > 0.1
