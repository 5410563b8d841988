"""frictionid quick: the law that made the data, by a stated rule, in one verdict."""

import json
from dataclasses import replace

import numpy as np
import pytest
from fixtures.command_line import run_command
from fixtures.lab_tables import CURVE, MACHINE, recordings, write_lab_tables
from fixtures.tiny_pendulums import dataset as tiny

from frictionid.data.recordings import Dataset
from frictionid.quickstart.quick import (
    LAWS,
    STEPS,
    Candidate,
    Ratio,
    quick,
    shortened,
    simplest,
)
from frictionid.quickstart.quick_picture import quick_picture
from frictionid.quickstart.quick_text import quick_json, verdict


def lab(count=None, **changes):
    return Dataset("lab", MACHINE, recordings(300)[:count], **changes)


@pytest.fixture(scope="module")
def found():
    """The verdict on the tables of a lab, and the steps that were reported."""
    steps = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("frictionid.quickstart.quick._HORIZONS", (0.5,))  # saves half the time
        return quick(lab(), steps.append), steps


def test_the_true_law_is_found_with_its_numbers(found):
    result, steps = found
    assert steps == list(STEPS)
    assert result.check.level == "good" and result.chosen.name == "stribeck"
    w = result.velocity[:, 0]
    use = np.abs(w) > 0.05
    true = CURVE.torque(w[:, None], np.sign(w)[:, None])[use, 0]
    off = result.chosen.curves[-1][use, 0] - true
    assert np.sqrt(np.mean(off**2)) < 0.05 * np.sqrt(np.mean(true**2))
    names = [entry["name"] for entry in result.refined["parameters"]]
    assert names == [f"{n} of joint 1" for n in ("coulomb", "peak", "stribeck_velocity", "viscous")]


def test_the_verdict_follows_its_rule(found):
    result, _ = found
    assert [c.name for c in result.candidates] == list(LAWS)
    best = min(result.candidates, key=lambda c: c.error)
    for c in result.candidates:
        logs = np.log(c.by_fold / best.by_fold)
        assert c.to_best.mean == pytest.approx(np.exp(logs.mean()))
        if c.parameters < result.chosen.parameters:
            assert c.to_best.low > 1.0  # clearly worse
    assert not result.chosen.to_best.is_clear


def test_the_words_and_the_numbers_agree(found):
    result, _ = found
    words = " ".join(verdict(result))
    assert words.startswith("Verdict: stribeck, Tf = (coulomb + peak")
    assert "Clearly worse than" in words and "none, coulomb_viscous" in words
    document = json.loads(quick_json(result))
    assert document["chosen"] == "stribeck" and document["verdict"] == verdict(result)
    errors = {c["name"]: c["error"] for c in document["candidates"]}
    assert errors == {c.name: c.error for c in result.candidates}
    assert errors["stribeck"] < 0.2 * errors["none"]


def test_the_picture_is_one_and_always_the_same(found):
    result, _ = found
    picture = quick_picture(result)
    assert picture.startswith(b"\x89PNG") and picture == quick_picture(result)


def candidate(name, parameters, error, low, high):
    return Candidate(name, parameters, error, np.ones(5), Ratio(1.0, low, high), np.zeros(1))


def test_the_simplest_law_counts_that_is_not_clearly_worse():
    best = candidate("spline", 6, 0.01, 1.0, 1.0)
    tied, worse = candidate("stribeck", 4, 0.011, 0.9, 1.2), candidate("none", 0, 0.5, 9.0, 99.0)
    assert simplest([worse, tied, best]) is tied
    assert simplest([worse, best]) is best
    assert simplest([candidate("none", 0, 0.011, 0.99, 1.2), tied, best]).name == "none"
    diverged = candidate("coulomb_viscous", 2, np.inf, np.nan, np.nan)
    assert simplest([diverged, best]) is best


def test_unusable_data_get_no_verdict(tmp_path, monkeypatch, capsys):
    turned = [replace(r, torque=r.torque._replace(value=-r.torque.value)) for r in recordings(300)]
    result = quick(Dataset("turned", MACHINE, tuple(turned)))
    assert result.check.level == "unusable" and result.chosen is None and verdict(result) == []
    write_lab_tables(tmp_path / "arm", sign=-1.0)
    own = tmp_path / "arm" / "dataset.toml"
    own.write_text(
        'name = "arm"\n[mechanism]\nkind = "pendulum"\nparameters = { mass = 0.4, length = 0.25 }\n'
        '[columns]\ntime = "t_ms"\nangle = "pos_deg"\ntorque = "I_motor"\n'
        '[units]\ntime = "ms"\nangle = "deg"\ntorque = "A"\n[motor]\nkt = 0.035\ngear = 9.0\n'
        '[recordings]\npatterns = "*.csv"\n'
    )
    code, out, err = run_command(monkeypatch, capsys, tmp_path, "quick", "arm")
    assert (code, err) == (2, "") and "has the wrong sign" in out
    assert "No law was fitted" in out and not (tmp_path / "quick.png").exists()


# --- As much as takes a minute --------------------------------------------------------------------


def test_short_data_are_used_as_they_are():
    data = tiny()
    assert shortened(data) == (data, None)


@pytest.mark.parametrize("copies", [5, 40])
def test_long_data_are_shortened_to_the_same_work(copies):
    many = [replace(r, name=f"{r.name}-{k}") for k in range(copies) for r in recordings(300)]
    part, sample_time = shortened(Dataset("long", MACHINE, tuple(many)))
    apart = sample_time or 0.01
    samples = sum(np.ptp(r.angle.time) / apart for r in part.recordings)
    assert samples <= 6_000 * 1.02
    assert len(part.recordings) >= 3
    assert all(r.name in {m.name for m in many} for r in part.recordings)
