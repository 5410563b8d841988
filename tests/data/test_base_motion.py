"""Motion of a floating base: IMUs anywhere, and poses, say the same; what is missing is said."""

import numpy as np
import pytest
from fixtures import floating_legs as legs
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from scipy.spatial.transform import Rotation

from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import within
from frictionid.data.readers.dataset_toml import check_dataset_toml
from frictionid.data.recording import base_motion
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal

TIME = np.linspace(0.0, 2.0, 1001)
INNER = slice(50, -50)  # a smoother knows less at the ends
GRAVITY = np.array([0.0, 0.0, -9.81])
STILL = np.tile([1.0, 0.0, 0.0, 0.0], (len(TIME), 1))  # orientation


def motion_of(turn=(0.0, 0.0, 0.0), place=(0.0, 0.0, 0.0)):
    """What a sensor at a place shows of a base that turns and swings, with its true motion.

    The base turns about one axis in space, so that its rates are known in closed form.
    """
    angle, speed, rate = (
        f(3.0 * TIME) * k for f, k in ((np.sin, 1.0), (np.cos, 3.0), (np.sin, -9.0))
    )
    axis = np.array([0.48, -0.6, 0.64])
    R = Rotation.from_rotvec(angle[:, None] * axis)
    turns = [np.outer(x, axis) for x in (speed, rate)]
    swing = np.array([0.3, 0.2, 0.1])
    at = np.sin(4.0 * TIME[:, None]) * swing + TIME[:, None] * 5.0
    force = R.inv().apply(-16.0 * np.sin(4.0 * TIME[:, None]) * swing - GRAVITY)
    truth = np.hstack([*turns, force])
    arm, onto = np.array(place), Rotation.from_euler("xyz", turn)
    shown = force + np.cross(turns[1], arm) + np.cross(turns[0], np.cross(turns[0], arm))
    signal = {
        "angular_velocity": onto.inv().apply(turns[0]),
        "specific_force": onto.inv().apply(shown),
        "orientation": np.roll((R * onto).as_quat(), 1, axis=1)
        * np.where(TIME > 1, -1, 1)[:, None],
        "position": at + R.apply(arm),
    }
    return {key: Signal(TIME, value) for key, value in signal.items()}, truth


@pytest.mark.parametrize(
    "by", [("angular_velocity", "specific_force"), ("orientation", "position")]
)
@pytest.mark.parametrize(
    "mounting",
    [{}, {"turn": (0.4, -1.2, 2.0), "place": (0.1, 0.2, -0.3)}],
    ids=["origin", "elsewhere"],
)
def test_sensors_anywhere_show_the_motion_of_the_base(by, mounting):
    signals, truth = motion_of(**mounting)
    out = base_motion(**{key: signals[key] for key in by}, **mounting).value
    assert np.abs(out - truth)[INNER].max() < 2e-3 * np.abs(truth).max()


def test_a_base_of_constant_velocity_is_at_rest():
    still = Signal(TIME, STILL)
    going = Signal(TIME, TIME[:, None] * [2.0, -1.0, 0.5])
    rest = base_motion(orientation=still).value
    np.testing.assert_array_equal(rest, np.tile(np.r_[np.zeros(6), -GRAVITY], (len(TIME), 1)))
    assert np.abs(base_motion(orientation=still, position=going).value - rest).max() < 1e-6


def test_quaternions_have_length_one():
    value = STILL.copy()
    value[500] = 0.0
    with assert_refused("at 1 s its length is 0; quaternions"):
        base_motion(orientation=Signal(TIME, value))


def document(**base):
    table = {"name": "legs", "mechanism": {"mjcf": "legs.xml", "floating": True}, "base": base}
    columns = {"time": "t", "angle": ["q"], "torque": ["u"]}
    return {**table, "columns": columns, "recordings": {"patterns": ["*.csv"]}}


MISTAKES = """
specific_force = ["a", "b", "c"] => nothing says how the base turns
angular_velocity = ["a", "b", "c"] => first moments of links
orientation = ["d", "e", "f", "g"] => nothing says how the base accelerates
orientation = ["a", "b", "c"]; position = "fixed" => base.orientation
angular_velocity = ["a", "b", "c"]; specific_force = ["a", "b", "c"]; unit = "g"
    => unknown key 'unit'
orientation = ["d", "e", "f", "g"]; position = "still" => base.position
"""


@mistakes(MISTAKES)
def test_what_the_base_lacks_is_said(wrong, words):
    with assert_refused(words):
        check_dataset_toml(document(**changes(wrong)), "dataset.toml")


THREE, FOUR = ["a", "b", "c"], ["d", "e", "f", "g"]


def test_units_clocks_and_a_fixed_place_are_read():
    base = {"angular_velocity": THREE, "specific_force": ["x", "y", "z"], "time": "clock"}
    toml = check_dataset_toml(document(**base, units={"specific_force": "g"}), "dataset.toml")
    assert toml.base.units.scale("specific_force") == 9.80665
    assert toml.asked.clock_of("x") == "clock" and toml.asked.clocks == ["t", "clock"]
    assert {"clock", *THREE, "x"} <= set(toml.asked.names())
    fixed = check_dataset_toml(document(orientation=FOUR, position="fixed"), "dataset.toml")
    assert fixed.base.columns == {"orientation": FOUR}


@shared
def swinging(shared_path):
    """Data set of one swinging run, and its mechanism held."""
    moving = legs.mechanism(shared_path, floating=True)
    data = Dataset.from_frames(legs.run(1.0, 0), moving, **legs.COLUMNS, base=legs.BASE)
    return data, legs.mechanism(shared_path, base="trunk")


def test_a_base_that_moves_needs_its_motion_and_a_held_one_none(swinging):
    data, held = swinging
    (run,) = data.recordings
    assert plant_of(data).mechanism.floating
    with assert_refused("say floating = true"):
        plant_of(Dataset("held", held, (run,)))
    blind = Recording("blind", run.angle, run.torque)
    with assert_refused(r"nothing says how: .* \[base\]"):
        plant_of(Dataset("blind", data.mechanism, (blind,)))


def test_a_part_of_a_recording_keeps_the_motion_of_its_base(swinging):
    (run,) = swinging[0].recordings
    part = within(run, 0.2, 0.5)
    assert part.base_motion.time[0] <= part.angle.time[0] <= part.base_motion.time[1]
    short = run.base_motion._replace(time=run.base_motion.time / 2)
    with assert_refused("motion of the base: it is known from 0 to 0.4995 s only"):
        Recording("late", run.angle, run.torque, base_motion=short)
