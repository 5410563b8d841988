"""fit --figure: one picture of the fitted friction, with the band where shooting knows one."""

import numpy as np
import pytest
from fixtures.refusals import assert_one_line
from fixtures.tiny_pendulums import dataset, write_dataset

from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous
from frictionid.report.figures import fits
from frictionid.report.figures.style import png

FIT = "fit tiny --identifier coulomb_viscous --out model.json --figure friction.png"


def test_the_picture_is_written_beside_the_model(tmp_path, run):
    write_dataset(tmp_path / "tiny")
    code, out, err = run(tmp_path, FIT)
    assert (code, err) == (0, "") and out.endswith("written to friction.png\n")
    assert (tmp_path / "friction.png").read_bytes().startswith(b"\x89PNG")
    (tmp_path / "model.json").unlink()
    assert_one_line(run(tmp_path, FIT), "friction.png exists")
    assert not (tmp_path / "model.json").exists()


def test_a_model_without_friction_is_refused_before_the_fit(tmp_path, run):
    write_dataset(tmp_path / "tiny")
    outcome = run(tmp_path, "fit tiny --identifier sindy_dynamics --out m.json --figure f.png")
    assert_one_line(outcome, "no friction torque to draw")
    assert not list(tmp_path.glob("m.*"))


@pytest.mark.parametrize("width", [0.004, None])
def test_the_band_is_that_of_the_document(monkeypatch, width):
    bands = {"velocity": np.linspace(-20, 20, 5)[:, None], "simultaneous": np.full((5, 1), width)}
    source = {} if width is None else {"refined": {"bands": bands}}
    friction = Friction(CoulombViscous(), [[0.03, 0.004]], provenance=source)
    drawn = []
    monkeypatch.setattr(fits, "_panel", lambda *given: drawn.append(given[1:]))
    assert png(lambda: fits.fit_figure(friction, dataset())).startswith(b"\x89PNG")
    ((w, curve, half),) = drawn
    np.testing.assert_allclose(curve, 0.03 * np.sign(w) + 0.004 * w, atol=1e-12)
    assert half is None if width is None else np.allclose(half, width)
