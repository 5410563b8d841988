"""Covariance between recordings: intervals as sure as they say, and what means nothing."""

import numpy as np
import pytest
from fixtures.driven_pendulum import driven_pendulum
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import stdtrit

from frictionid.data.plants import Calibration
from frictionid.fitting import sandwich as module
from frictionid.fitting.covariance import grouped_covariance, meaningless
from frictionid.fitting.parameter_block import Estimate
from frictionid.fitting.parameters import FrictionBlock
from frictionid.fitting.sandwich import (
    Groups,
    clusters_of,
    expected,
    sandwich,
    scatter,
    shown_once,
)
from frictionid.fitting.shooting import Settings, refine
from frictionid.friction import Friction
from frictionid.friction.laws import LuGre, Stribeck
from frictionid.mechanics import pendulum

SETS, RECORDINGS, WINDOWS, ROWS = 400, 8, 6, 12
TRUE = np.array([1.0, -0.5, 0.2])


def solved(rng, disturbed, shown=slice(None)):
    """Least squares on rows of recordings, each with a disturbance of its own.

    shown : recordings that the last parameter shows in
    """
    D, W = len(TRUE), RECORDINGS * WINDOWS
    labels = np.repeat(np.arange(RECORDINGS), WINDOWS)
    A = rng.standard_normal((W, ROWS, D)) * rng.uniform(0.5, 2.0, (RECORDINGS, 1, 1))[labels]
    A[~np.isin(labels, np.arange(RECORDINGS)[shown]), :, -1] = 0.0
    common = disturbed * rng.standard_normal((RECORDINGS, D))
    y = A @ TRUE + np.einsum("wrd,wd->wr", A, common[labels]) + rng.standard_normal((W, ROWS))
    return of_rows(A, y, labels)


def of_rows(A, y, labels):
    """Least squares on rows A (W, R, D) of windows of recordings, with right sides y (W, R)."""
    H, g = np.einsum("wri,wrj->wij", A, A), np.einsum("wri,wr->wi", A, y)
    move = np.linalg.solve(H.sum(axis=0), g.sum(axis=0))
    return Groups(H, g, move, np.ones(A.shape[-1], dtype=bool), labels, labels)


def unequal(rng, recordings, sizes):
    """Least squares on rows of recordings that tell parameters as much as one of these sizes."""
    labels = np.repeat(np.arange(recordings), 4)
    size = rng.choice(sizes, (recordings, 1, len(TRUE)))
    A = rng.standard_normal((len(labels), ROWS, len(TRUE))) * size[labels]
    return of_rows(A, A @ TRUE + rng.standard_normal(A.shape[:2]), labels)


def test_stretches_scatter_where_one_recording_shows_nearly_all_of_a_parameter():
    """Or where recordings are few: of one, 24, of three and more, eight of each."""
    recording = np.repeat(np.arange(5), 16)
    H = np.broadcast_to(np.eye(2), (80, 2, 2)).copy()
    assert_array_equal(clusters_of(H, recording, np.arange(80)), recording)
    H[recording > 0, 1, 1] = 1e-4  # a hundredth of what the first recording shows
    stretches = clusters_of(H, recording, np.arange(80))
    assert_array_equal(stretches, np.repeat(np.arange(40), 2))
    assert len(np.unique(clusters_of(H, np.zeros(80), np.arange(80)))) == 24


@pytest.mark.parametrize("disturbed", [0.0, 0.3])
def test_intervals_hold_the_truth_as_often_as_they_say(disturbed):
    rng = default_rng(7)
    held = []
    for _ in range(SETS):
        groups = solved(rng, disturbed)
        H = groups.H.sum(axis=0)
        error = np.sqrt(np.diag(scatter(H, groups, groups.cluster)))
        half = stdtrit(RECORDINGS - 1, 0.975) * error
        held.append(np.abs(groups.move - TRUE) <= half)
    assert 0.92 < np.mean(held) < 0.98  # of 1200 cases


@pytest.mark.parametrize("recordings", [5, 20])
def test_intervals_hold_where_few_recordings_tell_most(recordings):
    """A quarter of the recordings tells some parameter a hundred times as much as the others."""
    rng, held = default_rng(1), []
    for _ in range(SETS):
        groups = unequal(rng, recordings, [0.3, 3.0])
        inner = sandwich(groups.H.sum(axis=0), groups)
        half = stdtrit(recordings - 1, 0.975) * np.sqrt(np.diag(inner))
        held.append(np.abs(groups.move - TRUE) <= half)
    assert 0.92 < np.mean(held) < 0.98


@pytest.mark.parametrize("largest", [1.0, 2.0])
def test_the_variance_is_that_of_the_noise_on_average(largest):
    """However unequal the recordings: what tells much is not counted twice."""
    rng, ratio, freedom = default_rng(3), [], []
    for _ in range(200):
        groups = unequal(rng, RECORDINGS, [1.0, largest])
        H = groups.H.sum(axis=0)
        excess, own = expected(H, groups)
        noise = np.diag(np.linalg.inv(H))
        ratio.append(np.diag(scatter(H, groups, groups.cluster)) / excess / noise)
        freedom.append(own)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.06)  # 600 cases
    assert np.all(np.array(freedom) <= RECORDINGS - 1)


def test_clusters_in_pieces_are_those_at_once(monkeypatch):
    groups = unequal(default_rng(4), 20, [1.0, 30.0])
    H = groups.H.sum(axis=0)
    whole = expected(H, groups)
    monkeypatch.setattr(module, "_AT_ONCE", 60)
    assert_allclose(expected(H, groups), whole, rtol=1e-12)


def test_a_parameter_of_one_recording_has_no_interval_and_spoils_no_other():
    rng = default_rng(9)
    ratio = []
    for _ in range(100):
        groups = solved(rng, 0.0, shown=slice(0, 1))
        H = groups.H.sum(axis=0)
        once = shown_once(H, groups)
        assert once.tolist() == [False, False, True]
        rest = scatter(H, groups._replace(free=~once), groups.recording)
        ratio.append(np.diag(rest) / np.diag(np.linalg.inv(H))[:2])
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.25)


def test_what_a_single_of_three_recordings_shows_scatters_between_its_stretches():
    """Levels at six speeds, of which the last two are reached in the second recording alone."""
    rng, knots = default_rng(3), np.linspace(0.0, 1.0, 6)
    recording = np.repeat(np.arange(3), 8)
    w = rng.uniform(0.0, np.where(recording == 1, 1.0, 0.6)[:, None], (24, 40))
    A = 1e4 * np.maximum(0.0, 1.0 - np.abs(w[..., None] - knots) / 0.2) + rng.uniform(
        0, 1, (24, 40, 1)
    )
    A[recording != 1, :, -2:] *= 1e-9
    groups = of_rows(A, A.sum(axis=-1) + rng.standard_normal((24, 40)), recording)
    groups, H = groups._replace(cluster=np.arange(24)), groups.H.sum(axis=0)
    assert not shown_once(H, groups).any()
    variance = np.diag(sandwich(H, groups))
    stretches = np.diag(sandwich(H, groups._replace(recording=0 * recording)))
    assert_allclose(variance[-2:], stretches[-2:])
    assert (variance[:-2] >= stretches[:-2]).all() and variance.max() < 100 * stretches.max()


# --- What means nothing ---------------------------------------------------------------------------


def entries_of(friction):
    return FrictionBlock().parameters(Estimate(friction, Calibration.ideal(1), pendulum()))


FELL = Friction(Stribeck(), [[0.1, 0.03, 1.5, 0.01]])


def hanging(friction, *weak):
    entries = entries_of(friction)
    names = [e.name.split(" ")[0] for e in entries]
    found = meaningless(friction, entries, np.isin(names, weak))
    return {names[k]: tuple(names[i] for i in on) for k, on in found.items()}


def test_a_velocity_hangs_on_its_peak_and_nothing_hangs_on_it():
    assert list(Stribeck().names) == ["coulomb", "peak", "stribeck_velocity", "viscous"]
    assert hanging(FELL, "peak") == {"stribeck_velocity": ("peak",)}
    assert hanging(FELL, "peak", "coulomb") == {"stribeck_velocity": ("peak",)}
    assert hanging(FELL, "stribeck_velocity", "viscous", "coulomb") == {}
    assert hanging(FELL) == {}


def test_a_doubtful_peak_leaves_no_velocity():
    none, peak = np.zeros(4, dtype=bool), np.array([False, True, False, False])
    assert meaningless(FELL, entries_of(FELL), none, peak) == {2: (1,)}
    assert meaningless(FELL, entries_of(FELL), none, none) == {}


def test_stiffness_of_a_bristle_shows_before_it_slides():
    friction = Friction(LuGre(), [[0.1, 0.03, 1.5, 0.01, 0.01, 0.1, 0.5]])
    assert LuGre().names[4:] == ("presliding", "damping", "damping_velocity")
    assert hanging(friction, "viscous") == {}
    assert hanging(friction, "damping", "peak") == {
        "stribeck_velocity": ("peak",),
        "damping_velocity": ("damping",),
    }


def test_a_peak_that_is_not_there_leaves_no_velocity():
    first = Friction(Stribeck(), [[0.05, 0.01, 1.0, 0.01]])
    found = refine(first, driven_pendulum(150), settings=Settings(windows=(0.1, 0.33)))
    covariance = found.covariance
    names = [p.name.removesuffix(" of joint 1") for p in covariance.parameters]
    known = dict(zip(names, covariance.identified, strict=True))
    assert known["coulomb"] and known["viscous"]
    assert not known["peak"] and not known["stribeck_velocity"]


@pytest.mark.parametrize("peak", [0.0, 0.03])
def test_a_velocity_at_its_bound_costs_a_joint_its_intervals_unless_its_peak_is_zero(peak):
    """Also where the peak is held there, and no parameter."""
    friction = Friction(Stribeck(), [[0.1, peak, 1.5, 0.01]])
    entries = entries_of(friction)
    coulomb, velocity, viscous = (entries[k] for k in (0, 2, 3))
    parameters = (coulomb, velocity._replace(high=1.5), viscous)
    groups = solved(default_rng(0), 0.0)._replace(free=np.array([True, False, True]))
    values = np.array([0.1, 1.5, 0.01])
    found = grouped_covariance(parameters, values, friction, groups)
    assert np.isfinite(found.error[[0, 2]]).all() == (peak == 0.0)
    assert not found.identified[1]
