"""The order of tasks: what takes longest begins first, so that all processes end together."""

from fixtures.tiny_pendulums import tasks_in, write_suite

from frictionid.comparison.tasks import results_of


def test_what_takes_longest_begins_first(tmp_path, monkeypatch):
    by = [{"name": "integral"}, {"name": "shooting", "by": "shooting"}]
    kinds = [{"kind": "none"}, {"kind": "mlp", "recipes": ["integral"]}]
    kinds += [{"kind": "stribeck"}, {"kind": "lstm", "recipes": ["integral"]}]
    tasks = tasks_in(write_suite(tmp_path, [("recipes", by), ("identifiers", kinds)]))
    monkeypatch.setattr("frictionid.comparison.tasks.run", lambda *_: None)
    prepared = dict.fromkeys(task.benchmark.dataset.name for task in tasks)
    order = [(t.name, t.recipe.name) for t, _ in results_of(tasks, prepared, jobs=1)]
    longest = [("stribeck", "shooting"), ("lstm", "integral"), ("mlp", "integral")]
    assert order[:4] == [*longest, ("stribeck", "integral")]
    assert {name for name, _ in order[4:]} <= {"none", "truth"}
