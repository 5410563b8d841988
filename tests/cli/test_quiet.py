"""Short options: -h shows the help of every command, -q prints nothing but errors."""

import pytest
from fixtures.refusals import assert_one_line
from fixtures.tiny_pendulums import write_dataset


@pytest.mark.parametrize("command", ["", "fit", "data get"])
def test_h_is_help(tmp_path, command, run):
    short = run(tmp_path, command, "-h")
    assert short == run(tmp_path, command, "--help")
    assert short[0] == 0 and "Usage" in short[1]


def test_quiet_may_stand_anywhere_and_does_the_work(tmp_path, run):
    write_dataset(tmp_path / "tiny")
    for model, line in (
        ("a.json", "-q fit tiny --identifier coulomb_viscous --out"),
        ("b.json", "fit tiny --quiet --identifier coulomb_viscous --out"),
    ):
        assert run(tmp_path, line, model) == (0, "", "")
        assert (tmp_path / model).exists()
    assert_one_line(run(tmp_path, "check nowhere -q"), "nowhere does not exist")
