"""Compensation: what it is over velocity, that it halves tracking errors, and no limit cycle."""

from dataclasses import replace

import compensation as study
import numpy as np
import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

import frictionid as fid
from frictionid.deploy.compensation import (
    Compensation,
    compensating,
    compensation_table,
    feed_forward,
    table_error,
)
from frictionid.deploy.export.exported import exported
from frictionid.friction import Friction, Nodes, along
from frictionid.friction.law import at_rest
from frictionid.friction.laws import (
    CoulombViscous,
    Dahl,
    FilmLag,
    LuGre,
    MotorLoad,
    Play,
    Spline,
    Stribeck,
)

W = np.concatenate([-np.linspace(8.0, 0.3, 40), np.linspace(0.3, 8.0, 40)])
STRIBECK = Friction(Stribeck(), [[0.10, 0.04, 0.3, 0.02], [0.08, 0.03, 0.2, 0.01]])


def some(law):
    rng = np.random.default_rng(0)
    start = np.array(law.initial[0])
    start = np.where(start == 0.0, 0.05, start)  # some of each
    return Friction(law, np.stack([start, start]) * rng.uniform(0.8, 1.2, (2, len(start))))


@pytest.mark.parametrize(
    "law", [CoulombViscous(), Stribeck(symmetric=False), Spline(), FilmLag()], ids=str
)
def test_beyond_the_change_of_sides_it_is_the_gain_times_friction(law):
    friction = some(law)
    own = compensating(friction, Compensation(gain=0.8, smooth=0.02))
    assert_allclose(own.curve(W), 0.8 * friction.curve(W), atol=1e-5)


def test_around_rest_it_is_continuous_and_zero_where_friction_is_symmetric():
    smooth, w = 0.05, np.linspace(-0.2, 0.2, 4001)
    u = compensating(STRIBECK, Compensation(smooth=smooth)).curve(w)
    level = STRIBECK.curve(np.array([1e-3]))[0]
    assert (np.abs(np.diff(u, axis=0)) <= 1.1 * level * (w[1] - w[0]) / smooth).all()
    assert_allclose(u, -u[::-1], atol=1e-12)
    assert (np.abs(u[2000]) < 1e-12).all()


def test_it_stays_within_the_torque_limits_of_each_joint():
    u = compensating(STRIBECK, Compensation(torque_limit=(0.05, 0.02))).curve(W)
    assert_array_equal(np.abs(u).max(axis=0), [0.05, 0.02])


def test_at_rest_it_follows_the_direction_to_come():
    w = np.zeros((3, 2))
    a = np.array([[0.0, 0.0], [40.0, -40.0], [400.0, -400.0]])
    u = feed_forward(STRIBECK, Compensation(gain=1.0, ahead=0.01), 0.01, w, a)
    near, far = STRIBECK.curve(np.array([0.4, 4.0]))  # ahead at these speeds
    assert (u[0] == 0.0).all()
    assert_allclose(u[1:] * [1, -1], [near, far], rtol=1e-5)


def test_memory_follows_the_reference():
    """A bristle of the reference takes the presliding of a reversal; steadily it is the curve."""
    friction, dt = some(LuGre()), 0.002
    w = np.repeat(np.sign(np.sin(np.arange(1000) * dt * 2 * np.pi))[:, None], 2, axis=1)
    u = feed_forward(friction, Compensation(gain=1.0, smooth=1e-3), dt, w)
    assert_allclose(u[240], friction.curve(np.array([1.0]))[0], rtol=1e-3)


def test_parameters_that_are_whole_numbers_round_no_velocities():
    w = [[0.25], [-0.75]]
    whole, same = (
        Friction(CoulombViscous(), np.array([[2, 1]], dtype=kind)) for kind in (int, float)
    )
    given = (feed_forward(f, Compensation(gain=1.0), 0.01, w) for f in (whole, same))
    assert_array_equal(next(given), next(given))


@pytest.mark.parametrize("law", [LuGre(), Dahl(), FilmLag(), Play()], ids=str)
def test_along_a_recording_exported_code_is_the_feed_forward(law):
    """Memory advances by one rule, with reversals and rests, and beyond the speeds of the data."""
    friction = replace(some(law), provenance={"speeds": [3.0, 2.0]})
    settings, t = Compensation(gain=0.8, smooth=0.05), np.arange(0.0, 2.0, 0.005)[:, None]
    w = 3.0 * np.sin(9.0 * t + [0.0, 1.0]) * (t > 0.3)
    programs, found, memory = exported(compensating(friction, settings)).programs, [], {}
    for k, row in enumerate(w):
        x = {f"w_{j + 1}": row[j] for j in range(2)}
        program = programs.advance if k else programs.start
        made = program.run(x | memory | ({"dt_1": 0.005} if k else {}))
        memory = {f"{name}_{j + 1}": v[j] for name, v in made.items() for j in range(2)}
        found.append(programs.torque.run(x | memory)["Tf"])
    assert_allclose(found, feed_forward(friction, settings, 0.005, w), atol=1e-9)


def test_held_until_the_next_sample_it_is_nearer_to_fine_steps_than_by_mean_velocities():
    friction, settings, dt, fine = some(LuGre()), Compensation(smooth=0.05), 0.004, 80

    def reference(step):
        t = np.arange(0.0, 1.6, step)[:, None]
        return np.sin(4.0 * t + [0.0, 1.0]) + 0.5 * np.sin(12.0 * t), t[:, 0]

    def by_mean(step):
        w, t = reference(step)
        return along(compensating(friction, settings), Nodes(at_rest(w), t, np.array([0, len(t)])))

    exact = by_mean(dt / fine)
    mean, own = by_mean(dt), feed_forward(friction, settings, dt, reference(dt)[0])
    off = [np.square(np.repeat(u, fine, axis=0) - exact).mean() ** 0.5 for u in (own, mean)]
    assert off[0] < 0.6 * off[1]


def test_code_that_takes_the_motor_torque_says_what_that_is():
    geared = Friction(MotorLoad(), [[0.1, 0.02, 0.3]])
    for friction, said in ((geared, True), (STRIBECK, False)):
        facts = exported(compensating(friction)).facts
        assert any(line.startswith("u is the motor torque") for line in facts) == said


def test_lists_are_arrays():
    theta, w, a = [[0.1, 0.02]], [[0], [1], [2]], [[0], [5], [5]]
    lists, arrays = (
        feed_forward(Friction(CoulombViscous(), f(theta)), Compensation(ahead=0.1), 0.1, f(w), f(a))
        for f in (list, np.array)
    )
    assert_array_equal(lists, arrays)


def assert_holds(table, compensation, most):
    """For who interpolates it, as near as it says."""
    said = table_error(compensation, table)
    assert said < most * table.torque.abs().max()
    for j, (_, own) in enumerate(table.groupby("joint")):
        w = np.linspace(*own.velocity.iloc[[0, -1]], 20001)
        off = np.abs(np.interp(w, own.velocity, own.torque) - compensation.curve(w)[:, j])
        assert off.max() < 1.2 * said


@pytest.mark.parametrize("velocity", [0.05, 3.0])
def test_the_table_is_the_compensation_for_who_interpolates_it(velocity):
    """Also of a fast joint whose friction falls at slow speeds."""
    friction = Friction(Stribeck(), [[0.12, 0.05, velocity, 0.01], [0.1, 0.0, 0.5, 0.02]])
    settings = Compensation(gain=0.9, smooth=0.05)
    table = compensation_table(friction, settings, (21.6, 8.0), ("a", "b"))
    for name, last in (("a", 21.6), ("b", 8.0)):
        assert table[table.joint == name].velocity.iloc[[0, -1]].tolist() == [-last, last]
    assert_holds(table, compensating(friction, settings), 0.005)
    limited = Compensation(torque_limit=0.06)
    table = compensation_table(friction, limited, (21.6, 8.0))
    assert_holds(table, compensating(friction, limited), 0.05)


def test_the_table_of_a_law_with_memory_is_that_of_its_steady_sliding():
    """Of LuGre's bristles Stribeck friction, which changes sides over `smooth`, not in a step."""
    numbers = np.array([[0.12, 0.05, 0.3, 0.01]])
    bristles = Friction(LuGre(), np.hstack([numbers, [[0.002, 0.0, 0.1]]]))
    tables = [
        compensation_table(friction, Compensation(), (20.0,))
        for friction in (bristles, Friction(Stribeck(), numbers))
    ]
    assert_allclose(tables[0].torque, tables[1].torque, atol=5e-4)


@pytest.mark.parametrize("to", ["c", "st", "python"])
def test_heads_of_files_say_what_follows_what(to, tmp_path):
    known = STRIBECK.noted({"speeds": (3.0, 2.0), "joints": ("shoulder", "elbow")})
    own = compensating(known, Compensation(gain=0.9, smooth=0.05, torque_limit=0.15))
    text = fid.export(own, to, tmp_path / "own").paths[-1].read_text()
    for words in (
        "Compensation: 0.9 of the friction Stribeck(",
        "w is the velocity of the reference, not the measured one; add Tf to the motor torque.",
        "Tf changes sides over |w| = 0.05, and is at most 0.15.",
        "Measured up to |w| = 3, 2; beyond, friction is a straight line.",
        "shoulder",
    ):
        assert words in text
    assert "LinearOutside(" not in text and "joint 1" not in text


def test_tracking_errors_are_halved_without_a_limit_cycle(monkeypatch):
    """Also with friction that is 20 % wrong, with noise and delay; a rest follows the moves."""
    monkeypatch.setattr(study, "POINTS", study.POINTS[:2])
    monkeypatch.setattr(study, "LAST", 1.4)
    monkeypatch.setattr(study, "STILL", 0.6)
    found = study.trial((0,), 0.0)
    for name in ("fitted", "20 % too small", "20 % too large"):
        assert (found[name].error < 0.5 * found["none"].error).all(), name
        assert (found[name].swing < study.SWING).all(), name


SETTINGS = """
gain = 1.1 => gain: .* less than or equal to 1
gain = 0.0 => gain: .* greater than 0
smooth = 0.0 => smooth
torque_limit = -1.0 => torque_limit
ahead = -0.1 => ahead
smooth = [0.1, 0.1, 0.1] => smooth has 3 numbers, the friction 2 joints
"""


@mistakes(SETTINGS)
def test_settings_that_would_drive_a_joint_are_refused(wrong, words):
    with assert_refused(words):
        compensating(STRIBECK, Compensation(**changes(wrong)))


def test_what_has_no_friction_torque_is_refused():
    with assert_refused("without physics"):
        compensating(replace(STRIBECK, mechanism="unit"))
    with assert_refused("3 speeds for 2 joints"):
        compensating(replace(STRIBECK, provenance={"speeds": [1.0, 1.0, 1.0]}))
    with assert_refused("must be a Friction or a Fit"):
        compensating("model.json")
    with assert_refused("one above 0 for each of 2 joints"):
        compensation_table(STRIBECK, Compensation(), (1.0,))
