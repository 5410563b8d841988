"""Loops: a delay is found as it was put in, static friction has none, and the report says so."""

import numpy as np
import pytest
from fixtures import result_folders as made
from fixtures import tiny_pendulums as tiny
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from numpy.testing import assert_allclose

from frictionid.comparison.suite import PROTOCOL, load_suite
from frictionid.data.plants import plant_of
from frictionid.evaluation import Protocol
from frictionid.evaluation.hysteresis import (
    HysteresisSettings,
    hysteresis_loops,
    loop_lag,
    loop_width,
)
from frictionid.friction import Friction, Law, at_rest
from frictionid.friction.laws import FilmLag, Stribeck
from frictionid.report.figures.studies import learning_curves, losses_of
from frictionid.report.figures.style import drawing, rendered, styles
from frictionid.report.memory import loop_pictures, loop_table, with_memory
from frictionid.report.memory import loops_of as shown_loops

PLANT = plant_of(tiny.dataset())[0]
GRID = np.linspace(-10.0, 10.0, 401)[:, None]
DIP = np.array([[[0.05, 0.03, 2.0, 0.0]]])  # falls with speed, nothing rises
PHASE = 2 * np.pi * np.arange(240) / 240
SINE = HysteresisSettings(amplitude=[5.0], frequency=[1.0], factors=[1.0])


def loops(friction, settings=SINE, interval=1 / 60):
    return hysteresis_loops(friction, PLANT, settings, GRID, interval)


def offset(friction, settings=SINE, interval=1 / 60):
    """Loops of motion that never reverses."""
    return [loop for loop in loops(friction, settings, interval) if loop.kind == "offset"]


def film(lag, theta=DIP):
    return Friction(FilmLag(), np.concatenate([theta, np.full((*theta.shape[:-1], 1), lag)], -1))


class Echo(Law):
    """Stribeck friction of the velocity so many samples ago."""

    samples = 3
    sample_time = 1 / 60
    inner = Stribeck()
    names, units, bounds = inner.names, inner.units, inner.bounds

    def start(self, theta, x):
        return tuple(x.w + 0.0 * theta[..., 0] for _ in range(self.samples + 1))

    def torque(self, theta, x, memory):
        return self.inner.torque(theta, at_rest(memory[-1]), ())

    def advance(self, theta, x, memory, dt):
        return (x.w + 0.0 * theta[..., 0], *memory[:-1])

    def limit(self, theta, x, memory):
        return self.inner.limit(theta, x, ())


class Spring(Law):
    """A torque of the angle."""

    names, units, bounds = ("stiffness",), ("N m/rad",), ((0.0, 10.0),)

    def torque(self, theta, x, memory):
        return theta[..., 0] * x.q

    def limit(self, theta, x, memory):
        return 0.0 * theta[..., 0] * x.w


# --- What is measured -----------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [np.tanh, np.sin, lambda x: -np.exp(-((x - 0.5) ** 2))])
@pytest.mark.parametrize("delay", [-0.04, 0.0, 0.013])
def test_a_pure_delay_is_its_own_lag(shape, delay):
    period = 0.8
    late = shape(0.3 + np.sin(PHASE - 2 * np.pi * delay / period))
    assert loop_lag(late, period) == pytest.approx(delay, abs=2e-5)
    both = loop_lag(np.stack([late, 3.0 * late + 1.0]), period)
    assert both == pytest.approx([delay, delay], abs=2e-5)


def test_the_velocity_of_a_loop_is_the_rate_of_its_angle():
    spring = Friction(Spring(), np.ones((1, 1, 1)))
    settings = HysteresisSettings(amplitude=[3.0], frequency=[0.7])
    both = loops(spring, settings, 0.01)
    assert {loop.kind for loop in both} == {"reversing", "offset"}
    for loop in both:
        angle, w = loop.torque[0], loop.velocity
        dt = 1 / (loop.frequency * len(w))
        moved = 0.5 * dt * (w[1:] + w[:-1])
        assert_allclose(np.diff(angle), moved, atol=1e-3 * np.abs(moved).max())


def test_a_torque_that_does_not_vary_is_not_late():
    assert np.isnan(loop_lag(np.full(100, 0.3), 1.0))


def test_the_width_is_the_area_over_the_range_and_turns_with_the_loop():
    w, torque = 4 + 3 * np.cos(PHASE), 2 * np.sin(PHASE)
    area = np.pi * 3 * 2 * np.sinc(1 / 240 * 2)  # of the polygon
    assert loop_width(w, torque) == pytest.approx(-area / 6, rel=1e-3)
    assert loop_width(w[::-1], torque[::-1]) == pytest.approx(area / 6, rel=1e-3)


def test_friction_of_the_velocity_alone_has_no_loop_and_is_its_curve():
    friction = Friction(Stribeck(), [[0.05, 0.03, 2.0, 0.004]])
    for loop in loops(friction[None], HysteresisSettings()):
        assert np.abs(loop.width).max() < 1e-9
        slides = np.abs(loop.velocity) > 0.3  # beyond the smoothing, which curves leave out
        curve = friction.curve(loop.velocity[slides])[:, 0]
        assert_allclose(loop.torque[0, slides], curve, atol=1e-12)


@pytest.mark.parametrize("lag", [0.005, 0.02])
def test_a_film_that_lags_is_late_by_its_time_constant_where_motion_never_reverses(lag):
    settings = HysteresisSettings(amplitude=[5.0], frequency=[0.5], factors=[1.0])
    found = {loop.kind: loop for loop in loops(film(lag), settings)}
    assert found["offset"].lag[0] == pytest.approx(lag, rel=0.1)
    assert found["offset"].width[0] > 0  # friction is higher while speed rises
    assert found["offset"].velocity.min() > 0 > found["reversing"].velocity.min()
    # the change of sign does not lag, and hides what does
    assert abs(found["reversing"].lag[0]) < 0.2 * lag


def test_loops_grow_with_frequency_as_the_lag_does():
    settings = HysteresisSettings(amplitude=[5.0], frequency=[1.0])
    widths = [loop.width[0] for loop in offset(film(0.01), settings)]
    assert widths[1] / widths[0] == pytest.approx(2.0, rel=0.05)
    assert widths[2] / widths[1] == pytest.approx(2.0, rel=0.1)


def test_memories_of_samples_advance_with_the_samples_of_the_data():
    for interval in (1 / 60, 1 / 100):
        (loop,) = offset(Friction(Echo(), DIP), interval=interval)
        assert loop.lag[0] == pytest.approx(Echo.samples * interval, rel=0.02)


def test_each_joint_and_each_friction_of_a_batch_is_as_it_is_alone():
    theta = np.concatenate([DIP, 2 * DIP])
    for i in range(2):
        alone, both = loops(film(0.01, theta[i : i + 1])), loops(film(0.01, theta))
        for a, b in zip(alone, both, strict=True):
            assert_allclose(a.torque[0], b.torque[i], rtol=1e-12)


def test_settings_are_those_of_the_joints():
    with assert_refused("amplitude has 2 entries, the mechanism has 1 joints"):
        loops(film(0.01), HysteresisSettings(amplitude=[5.0, 10.0]))
    with assert_refused(r"loops\.factors\[0\]: it should be greater than 0, not 0\.0"):
        PROTOCOL.build({"loops": {"factors": [0.0]}}, "")


# --- Comparisons and pages ------------------------------------------------------------------------


@shared
def compared(shared_path):
    """A comparison of a law without and one with memory, reported."""
    file = tiny.write_suite(
        shared_path,
        """
        identifiers = [{kind = "none"}, {kind = "coulomb_viscous"}, {kind = "film_lag"}]
        recipes = [{name = "integral"}]; loops = {frequency = [2.0]}
        """,
    )
    tiny.compare_into(file, shared_path / "out")
    return file, made.blank(shared_path / "out")


def test_what_a_suite_asks_for_is_shown_and_told(compared):
    file, folder = compared
    assert load_suite(file).protocol.loops == HysteresisSettings(frequency=[2.0])
    section = made.section(folder)
    assert [model.identifier for model in with_memory(section)] == ["film_lag"]
    names = {path.name for path in (folder / "figures").glob("*.svg")}
    assert {"loops--tiny--integral.svg", "speeds--tiny.svg"} <= names
    table = loop_table(section)
    assert {line.cells[0].text for line in table.lines} == {"film_lag"}
    assert table.caption in made.words(folder)
    assert (folder / "tables/speeds--tiny.md").exists()


def test_speeds_are_those_of_the_recordings(compared):
    data = made.section(compared[1]).description
    w = np.concatenate([r.truth.velocity.value for r in tiny.recordings()])
    levels, joint = data.speeds["levels"], data.speeds["joints"][0]
    assert_allclose(joint["speeds"], np.quantile(np.abs(w), levels))
    assert 0 < joint["reversals"] < 10 and 0 < joint["rest"] < 1
    assert np.abs(data.velocities).max() <= np.abs(w).max() + 1e-4


def test_without_memory_and_unasked_nothing_is_shown(tmp_path):
    suite = 'recipes = [{name = "integral"}]; identifiers = [{kind = "none"}]'
    file = tiny.write_suite(tmp_path, suite)
    assert load_suite(file).protocol.loops is None and Protocol().loops is None
    tiny.compare_into(file, tmp_path / "out")
    section = made.section(made.undrawn(tmp_path / "out"))
    assert not loop_pictures(section, {}) and loop_table(section) is None
    assert "Loops of friction" not in made.words(tmp_path / "out")


def loops_document(lag, scatter):
    """Loops of a delay in one joint, put into each fold with some scatter."""
    rng = np.random.default_rng(0)
    out = []
    for joint in range(2):
        for kind in ("reversing", "offset"):
            for frequency in (0.5, 1.0, 2.0):
                late = lag * (joint == 1) + scatter * rng.standard_normal(made.FOLDS + 1)
                turn = PHASE[None] - 2 * np.pi * frequency * late[:, None]
                w = 3.0 + 2.0 * np.sin(PHASE)
                torque = 0.1 + 0.05 * np.sin(turn)
                own = {"width": loop_width(w, torque), "lag": loop_lag(torque, 1 / frequency)}
                first = {"joint": joint, "kind": kind, "frequency": frequency}
                out.append({**first, "velocity": w, "torque": torque, **own})
    return out


@pytest.mark.parametrize(
    "lag, scatter, verdict",
    [
        (0.012, 0.0, "late"),
        (-0.012, 0.0005, "early"),
        (0.0, 0.01, "scatter"),
        (0.2, 0.0, "open"),
        (0.0, 0.0, "closed"),
    ],
)
def test_the_verdict_says_what_was_put_in(tmp_path, lag, scatter, verdict):
    task = made.task("late", 0.3, 0.1, curve=0.1)
    task["loops"] = loops_document(lag, scatter)
    section = made.section(tmp_path, [task])
    (model,) = section.models
    first, second = (shown_loops(model, joint, "offset")[1] for joint in (0, 1))
    assert verdict in (second.verdict, first.verdict if scatter else "")
    assert scatter or first.verdict == "closed"
    if lag:
        line = loop_table(section).lines[4]  # joint 2 at the middle frequency
        assert line.cells[-1].text == verdict
        assert (verdict == "open") or f"{1e3 * abs(lag):.0f}" in line.cells[-3].text


def test_learning_curves_are_drawn_where_a_model_has_them(tmp_path):
    task = made.task("network", 0.3, 0.1, curve=0.1)
    losses = np.exp(-np.arange(30) / 10)[None] + 0.1 * np.arange(1, made.FOLDS + 2)[:, None]
    task["model"]["provenance"] = {"learning": {"training": losses, "held_out": 1.1 * losses}}
    other = made.task("stribeck", 0.4, 0.2, curve=0.1)
    section = made.section(tmp_path, [task, other])
    network, plain = models = section.models
    with drawing():
        assert learning_curves(section._replace(models=(plain,)), styles(models)) is None
        picture = learning_curves(section, styles(models))
        lines = [line for axis in picture.axes for line in axis.get_lines()]
        assert len(rendered(picture, ["png"])["png"]) > 1000
    assert len(lines) == 3 * made.FOLDS  # training, held out, the best
    assert losses_of(plain) is None and losses_of(network)["training"].shape == (made.FOLDS, 30)
