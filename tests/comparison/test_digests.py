"""Digests of tasks: a result is kept exactly as long as nothing that it depends on has changed."""

import sys
from dataclasses import dataclass, replace

from fixtures.tiny_pendulums import dataset, disturbed, recordings

from frictionid.comparison.cross_validate import Benchmark
from frictionid.comparison.tasks import Task
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.fitting.identifiers import Frictionless, LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY
from frictionid.friction.laws import CoulombViscous, Stribeck


@dataclass(frozen=True)
class Own:
    level: float = 1.0


class Bare:
    """An identifier without a representation of its own."""

    def __init__(self, level):
        self.level = level


def task(identifier=None, recipe=INTEGRAL, seed=0, data=None, tests=(), split=None, **protocol):
    data = data or dataset()
    folds = make_folds(data.recordings, split or Split(count=3))
    benchmark = Benchmark(data, folds, Protocol(**protocol), tests)
    return Task(benchmark, "x", identifier or Frictionless(), recipe, seed)


def test_equal_tasks_have_equal_digests():
    assert task().digest == task().digest
    assert task(Bare(1.0)).digest == task(Bare(1.0)).digest
    # files that say the same: where they lie and how they are called is no matter
    assert task(data=dataset(hashes={"a.csv": "0"})).digest == task().digest


def test_a_changed_setting_or_file_changes_the_digest():
    parts = recordings()
    quiet = replace(parts[5], torque=parts[5].torque._replace(hold="linear"))
    driven = disturbed(parts[5], 1.49, 1e-9)
    heavy = replace(parts[5], parameters={"mass": 0.3})
    changed = [(*parts[:5], other, *parts[6:]) for other in (quiet, driven, heavy)]
    table = {"kind": "pendulum", "parameters": {"mass": 0.2, "length": 0.2 + 1e-12}}
    others = [
        task(LeastSquares(CoulombViscous())),
        task(LeastSquares(CoulombViscous(width=0.03))),
        task(LeastSquares(Stribeck())),
        task(LeastSquares(Stribeck(), iterations=61)),
        task(Own()),
        task(Own(2.0)),
        task(Bare(1.0)),
        task(Bare(2.0)),
        task(recipe=STUDY),
        task(recipe=replace(INTEGRAL, velocity_threshold=0.1)),
        task(seed=1),
        task(tests=(dataset(name="test"),)),
        task(split=Split(count=4)),
        task(split=Split(count=3, seed=1)),
        task(horizons=(0.1,)),
        task(every=0.3),
        task(history=0.2),
        task(sample_time=0.02),
        task(data=dataset(mechanism=table)),
        task(data=dataset(truth=None)),
        task(data=dataset(name="other")),
        *(task(data=dataset(recordings=own)) for own in changed),
    ]
    digests = [task().digest, *(other.digest for other in others)]
    assert len(set(digests)) == len(digests)


def test_changed_code_of_ones_own_changes_the_digest(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    digests = []
    for power in (1, 2):
        text = f"class Part:\n    def fit(self, problem, weights, seed):\n        return {power}\n"
        (tmp_path / "changing_part.py").write_text(text)
        sys.modules.pop("changing_part", None)
        module = __import__("changing_part")
        digests.append(task(module.Part()).digest)
    assert digests[0] != digests[1]
