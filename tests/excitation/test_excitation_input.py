"""Experiment design refuses what is impossible, each mistake in one clear line."""

import re

import pytest
from fixtures.mistakes import changes, mistakes
from fixtures.pendulum_experiment import on_pendulum
from fixtures.refusals import assert_refused

from frictionid.__main__ import main
from frictionid.excitation import Search, SignalSpace, limits_of, load_mechanism, prior_friction_of
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


def test_wrong_families_priors_and_searches_are_refused():
    with assert_refused("family 'sweep' is unknown"):
        SignalSpace(on_pendulum(), ("sweep",))
    with assert_refused("no family"):
        SignalSpace(on_pendulum(), ())
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


def _run(monkeypatch, folder, *options, length=0.3):
    file = folder / "machine.toml"
    file.write_text(
        f'[mechanism]\nkind = "pendulum"\nparameters = {{ mass = 0.2, length = {length} }}'
    )
    fixed = ["--mechanism", str(file), "--limits", "torque=0.3,velocity=20", "--length", "1.5"]
    monkeypatch.setattr("sys.argv", ["frictionid", "suggest", *fixed, "--effort", "12", *options])
    return main()


def test_the_command_writes_one_table_for_each_recording(tmp_path, monkeypatch, capsys):
    out, figure = tmp_path / "new" / "torque.csv", tmp_path / "new" / "torque.png"
    given = ["--out", str(out), "--figure", str(figure), "--recordings", "2"]
    assert _run(monkeypatch, tmp_path, *given) == 0
    names = sorted(path.name for path in out.parent.iterdir())
    assert names == ["torque.png", "torque_1.csv", "torque_2.csv"]
    assert (out.parent / "torque_1.csv").read_text().startswith("time,u1\n0,")
    text = capsys.readouterr().out
    assert re.search(r"torque .* 0\.3  N m", text) and re.search(r"velocity .* 20  rad/s", text)
    assert "joint 1 viscous" in text and "N m / (rad/s)" in text


@pytest.mark.parametrize(
    ("options", "rule"),
    [
        (("--frequencies", "1"), "must be two numbers"),
        (("--start", "a,b"), "must be numbers"),
        (("--length", "nan"), "length: it should be a finite number, not nan"),
        (("--seed", "-1"), "greater than or equal to 0"),
    ],
)
def test_the_command_says_in_one_line_what_is_wrong(options, rule, tmp_path, monkeypatch, capsys):
    assert _run(monkeypatch, tmp_path, "--out", str(tmp_path / "t.csv"), *options) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and rule in lines[0]
    assert not list(tmp_path.glob("*.csv"))


def test_what_cannot_be_written_is_said_before_the_search(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    place = tmp_path / "file" / "torque.csv"
    assert _run(monkeypatch, tmp_path, "--out", str(place)) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_a_machine_that_no_torque_moves_is_one_clear_line(tmp_path, monkeypatch, capsys):
    place = tmp_path / "torque.csv"
    assert _run(monkeypatch, tmp_path, "--out", str(place), length=1e9) == 2
    assert "no signal within the limits shows all of friction" in capsys.readouterr().err
