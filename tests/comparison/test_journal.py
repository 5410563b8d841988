"""The journal of a search: what a killed one left is gone on from, other damage is refused."""

import optuna
import pytest
from fixtures.refusals import assert_refused

from frictionid.comparison.search_space import JOURNAL, open_journal


def _trials(storage):
    study = optuna.create_study(study_name="s", storage=storage, load_if_exists=True)
    study.enqueue_trial({"x": 0.5})
    trial = study.ask({"x": optuna.distributions.FloatDistribution(0.0, 1.0)})
    study.tell(trial, trial.params["x"])
    return len(study.trials)


@pytest.mark.parametrize("left", [1, 7, 0.5, -1])
def test_a_line_that_was_cut_off_is_dropped(tmp_path, left):
    journal = tmp_path / JOURNAL
    assert _trials(open_journal(tmp_path)) == 1
    before = journal.read_bytes()
    assert _trials(open_journal(tmp_path, resume=True)) == 2
    whole = journal.read_bytes()
    last = whole.splitlines(keepends=True)[-1]
    kept = int(len(last) * left) if isinstance(left, float) else left % len(last)
    journal.write_bytes(whole[: len(whole) - len(last) + kept])
    for _ in range(2):
        assert _trials(open_journal(tmp_path, resume=True)) >= 2
    assert journal.read_bytes().startswith(before)


@pytest.mark.parametrize("place", [0, -1])
def test_other_damage_is_one_line(tmp_path, place):
    journal = tmp_path / JOURNAL
    _trials(open_journal(tmp_path))
    lines = journal.read_bytes().splitlines(keepends=True)
    lines[place] = lines[place][:9] + lines[place]
    journal.write_bytes(b"".join(lines))
    with assert_refused("is no journal: tune anew with --replace"):
        open_journal(tmp_path, resume=True)
    assert journal.read_bytes() == b"".join(lines)
