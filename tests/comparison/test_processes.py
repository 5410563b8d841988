"""Calls in processes: what they give is what the calls give, also of modules found later."""

import importlib
import operator
import os
import sys
import time

import pytest
from joblib.externals.loky import process_executor

from frictionid.comparison.processes import side_by_side


def test_workers_of_an_earlier_call_find_modules_of_a_later_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", sys.path[:])
    assert dict(side_by_side(operator.add, [(1, 1), (2, 2)], 2)) == {0: 2, 1: 4}
    (tmp_path / "found_later.py").write_text("def twice(x):\n    return 2 * x\n")
    sys.path.append(str(tmp_path))
    twice = importlib.import_module("found_later").twice
    assert dict(side_by_side(twice, [(1,), (2,)], 2)) == {0: 2, 1: 4}


KEPT = []


def kept(megabytes):
    """Process that keeps so much memory from now on, as one that loads PyTorch does."""
    process_executor._MEMORY_LEAK_CHECK_DELAY = 0.05  # [s], one second else
    KEPT.append(b"1" * int(1e6 * megabytes))
    time.sleep(0.2)
    return os.getpid()


@pytest.mark.filterwarnings("ignore:A worker stopped")  # an error would stop the test for ever
def test_workers_whose_tasks_load_much_are_not_replaced():
    """Joblib takes 300 MB more than after the first call for a leak, and warns."""
    pids = dict(side_by_side(kept, [(1,), (1,), (350,), (350,), (1,), (1,)], 2)).values()
    assert len(set(pids)) == 2
