"""Experiment design refuses what is impossible, each mistake in one clear line."""

import re

import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.pendulum_experiment import on_pendulum
from fixtures.refusals import assert_one_line, assert_refused

from frictionid.excitation import Search, limits_of, load_mechanism, prior_friction_of
from frictionid.mechanics import acrobot, mechanism_of, pendulum

LIMITS = """
torque=0.1                      => lacks velocity
velocity=3                      => lacks torque
torque=0.1,velocity=x           => cannot be read
torque=0.1,velocity=-1          => must be positive
torque=nan,velocity=1           => must be positive
torque="a",velocity=1           => must be positive
torque=0.1,velocity=[1,2,3]     => 3 numbers for 2 joints
torque=[0.1,0.2],velocity=1     => 2 numbers for 1 motors
torque=0.1,velocty=1            => did you mean 'velocity'
"""


@mistakes(LIMITS)
def test_wrong_limits_are_one_clear_line(wrong, words):
    with assert_refused(words):
        limits_of(wrong, acrobot())


def test_a_machine_without_a_motor_gets_no_signal():
    with assert_refused("has no motor"):
        limits_of("torque=1,velocity=1", pendulum(driven=False))


EXPERIMENTS = """
length = 0.1       => at least 20
recordings = 0     => recordings: .* not 0
band = [2.0, 1.0]  => increasing
band = [1.0, 20.0] => quarter of the drive rate
start = [0.0, 0.0] => 2 angles for 1 joints
start = [3.5]      => not within its limit
angle_noise = 0.0  => angle_noise.*: .* not 0.0
"""


@mistakes(EXPERIMENTS)
def test_wrong_experiments_are_one_clear_line(wrong, words):
    with assert_refused(words):
        on_pendulum(**changes(wrong))


def test_wrong_priors_and_searches_are_refused():
    with assert_refused("did you mean 'coulomb'"):
        prior_friction_of("coulumb=1", on_pendulum().limits)
    with assert_refused("pool: .* not 0"):
        Search(pool=0)


def test_mechanism_files_say_what_is_wrong(tmp_path):
    file = tmp_path / "machine.toml"
    with assert_refused("cannot be read"):
        load_mechanism(file)
    file.write_bytes(b"\xff\x00")
    with assert_refused("no TOML"):
        load_mechanism(file)
    file.write_text("name = 1")
    with assert_refused(r"no \[mechanism\] table"):
        load_mechanism(file)
    file.write_text('[mechanism]\nkind = "pendulum"')
    assert mechanism_of(load_mechanism(file)).n == 1


@pytest.fixture
def suggest(tmp_path, run):
    """What a design for a pendulum of some length comes to."""

    def called(options, length=0.3):
        (tmp_path / "machine.toml").write_text(
            f'[mechanism]\nkind = "pendulum"\nparameters = {{ mass = 0.2, length = {length} }}'
        )
        limits = "--limits torque=0.3,velocity=20 --length 1.5 --effort 12"
        return run(tmp_path, f"suggest --mechanism machine.toml {limits} --out {options}")

    return called


def test_the_command_writes_one_table_for_each_recording(tmp_path, suggest):
    code, text, _ = suggest("new/torque.csv --figure new/torque.png --recordings 2")
    assert code == 0
    names = sorted(path.name for path in (tmp_path / "new").iterdir())
    assert names == ["torque.png", "torque_1.csv", "torque_2.csv"]
    assert (tmp_path / "new/torque_1.csv").read_text().startswith("time,u1\n0,")
    assert re.search(r"torque .* 0\.3  N m", text) and re.search(r"velocity .* 20  rad/s", text)
    assert "joint 1 viscous" in text and "N m / (rad/s)" in text


OPTIONS = """
--frequencies 1 => must be two numbers
--start a,b     => must be numbers
--length nan    => length: it should be a finite number, not nan
--seed -1       => greater than or equal to 0
"""


@mistakes(OPTIONS)
def test_the_command_says_in_one_line_what_is_wrong(wrong, words, tmp_path, suggest):
    assert_one_line(suggest(f"t.csv {wrong}"), words)
    assert not list(tmp_path.glob("*.csv"))


def test_what_cannot_be_written_is_said_before_the_search(suggest):
    assert_one_line(suggest("machine.toml/torque.csv"), "cannot be written")


def test_a_machine_that_no_torque_moves_is_one_clear_line(suggest):
    words = "no signal within the limits shows all of friction"
    assert_one_line(suggest("torque.csv", length=1e9), words)
