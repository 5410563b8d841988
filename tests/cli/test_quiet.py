"""Short options: -h shows the help of every command, -q prints nothing but errors."""

import pytest
from fixtures.tiny_pendulums import write_dataset

FIT = ("fit", "tiny", "--identifier", "coulomb_viscous", "--out")


@pytest.mark.parametrize("arguments", [(), ("fit",), ("data", "get")])
def test_h_is_help(tmp_path, arguments, run):
    short = run(tmp_path, *arguments, "-h")
    assert short == run(tmp_path, *arguments, "--help")
    assert short[0] == 0 and "Usage" in short[1]


def test_quiet_may_stand_anywhere_and_does_the_work(tmp_path, run):
    write_dataset(tmp_path / "tiny")
    for place, words in enumerate([("-q", *FIT), (*FIT[:2], "--quiet", *FIT[2:])]):
        model = f"model_{place}.json"
        assert run(tmp_path, *words, model) == (0, "", "")
        assert (tmp_path / model).exists()
    code, out, err = run(tmp_path, "check", "nowhere", "-q")
    assert (code, out) == (2, "") and "nowhere does not exist" in err


def test_completion_can_be_installed(tmp_path, run):
    _, out, _ = run(tmp_path, "--help")
    assert "--install-completion" in out
