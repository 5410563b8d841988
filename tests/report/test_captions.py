"""Captions say by what a law was fitted."""

import pytest
from fixtures import result_folders as made

from frictionid.report import write


@pytest.mark.parametrize("scheme", ["shooting", "inverse dynamics"])
def test_captions_of_a_fit_name_its_method(scheme, tmp_path, monkeypatch):
    monkeypatch.setattr(write, "rendered", lambda *_: {"svg": b"<svg/>"})
    refined = made.shot([made.parameter("friction", "coulomb", 0.1, 0.001, joint=0)])
    own = made.task("law", {"made": made.rows(0.3, 0.2, curve=0.1)}, refined=refined)
    own["method"] = {"scheme": scheme, "corrects": []}
    folder = made.built(made.write(tmp_path, [own], {"made": made.about()}))
    table = (folder / "tables" / "shooting--made--law.md").read_text()
    assert f"parameters of law by {scheme} (recipe" in table
    assert f"Friction by {scheme} on made with its 95 % bands" in made.words(folder)
