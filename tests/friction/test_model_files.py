"""Files of models: what is written comes back, and every mistake in one is one line."""

import json
import os
import pickle
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from fixtures import driven_wrist
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from numpy.testing import assert_array_equal

import frictionid as fid
from frictionid.errors import InputError
from frictionid.files import read_json, write_json, write_text
from frictionid.friction import Friction
from frictionid.friction.laws import (
    MLP,
    CoulombViscous,
    NoFriction,
    Ripple,
    Spline,
    Stribeck,
    Thermal,
)
from frictionid.friction.model_files import load_model, model_document, read_model, save_model

FRICTION = Friction(
    Stribeck(0.01, "arctan"),
    [[0.1, 0.05, 1.5, 0.02], [0.2, 0.0, 0.3, 1e-17]],
    {"m1": 0.5, "I1": 1e-4},
    {"by": "someone", "sizes": [1, 2], "rate": np.float64(60.0)},
)


SIDED = Stribeck(symmetric=False)


@dataclass(frozen=True)
class Foreign(CoulombViscous):
    """A law that the package does not name."""


def written(**changes):
    """The document of a model file with changes; None deletes."""
    document = json.loads(json.dumps(_plain(model_document(FRICTION))))
    for key, value in changes.items():
        if value is None:
            del document[key]
        else:
            document[key] = value
    return document


def _plain(document):
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in document.items()} | {
        "provenance": {}
    }


def by_hand(**entry):
    """A document as people write one: no theta, one joint."""
    good = {name: {"value": 0.5, "unit": unit} for name, unit in _units()}
    return written(theta=None, shape=None, joints=[{**good, **entry}])


def _units():
    return zip(FRICTION.law.names, FRICTION.law.units, strict=True)


@pytest.mark.parametrize(
    "law",
    [
        *(NoFriction(), CoulombViscous(0.1), Thermal("stribeck", 30.0), Spline((1.0, 2.5), 1)),
        *(Spline((1.0, 2.5, 7.0), width=0.01, symmetric=False), SIDED),
        Ripple(SIDED, (2, 5), 50.0, 0.01, "arctan"),
    ],
    ids=str,
)
@pytest.mark.parametrize("batch", [(), (2, 3)])
def test_friction_comes_back_from_its_file_bit_by_bit(law, batch, tmp_path):
    shape = (*batch, 2, len(law.names))
    theta = np.random.default_rng(0).uniform(0.3, 1.0, shape) / 3
    friction = Friction(law, theta, {"m1": 1 / 3}, {"by": "a test"})
    save_model(friction, tmp_path / "deep/model.json")
    again = load_model(tmp_path / "deep/model.json")
    assert again.law == law and hash(again.law) == hash(law)
    assert again.theta.shape == shape
    assert_array_equal(again.theta, theta)
    assert (again.parameters, again.provenance.notes) == ({"m1": 1 / 3}, {"by": "a test"})


def test_the_file_says_in_words_and_units_what_it_holds(tmp_path):
    save_model(FRICTION, tmp_path / "model.json")
    document = read_json(tmp_path / "model.json")
    assert document["law"] == {
        "kind": "stribeck",
        "width": 0.01,
        "shape": "arctan",
        "symmetric": True,
    }
    assert document["joints"][0]["stribeck_velocity"] == {"value": 1.5, "unit": "rad/s"}
    assert document["provenance"] == {"by": "someone", "sizes": [1, 2], "rate": 60.0}
    assert "import" not in json.dumps(document)


def test_a_batch_is_described_by_its_means(tmp_path):
    theta = np.stack([FRICTION.theta, 3 * FRICTION.theta])
    save_model(Friction(FRICTION.law, theta), tmp_path / "model.json")
    words = read_json(tmp_path / "model.json")["joints"][1]
    assert words["coulomb"] == {"value": pytest.approx(0.4), "unit": "N m"}


def test_a_file_written_by_hand_needs_no_theta_and_no_units():
    document = by_hand(coulomb={"value": 1})
    del document["parameters"], document["provenance"]
    friction = read_model(document, "hand.json")
    assert_array_equal(friction.theta, [[1.0, 0.5, 0.5, 0.5]])


def test_a_law_outside_the_package_needs_its_class_at_hand(tmp_path):
    friction = Friction(Foreign(0.1), [[1.0, 2.0]])
    save_model(friction, tmp_path / "model.json")
    with assert_refused("law 'Foreign' is unknown"):
        load_model(tmp_path / "model.json")
    assert load_model(tmp_path / "model.json", [Foreign]).law == Foreign(0.1)


MISTAKES = r"""
format = "frictionid model 9"
    => is of another version of frictionid, .* is 'frictionid model 9'
format = "robot 1.0" => is no model file, "format" must be "frictionid model 1"
format = => is no model file, "format" must be
law = => "law" must be an object with a "kind"
law = {width = 0.1} => "law" must be an object with a "kind"
law = {kind = "stribek"} => law 'stribek' is unknown; did you mean 'stribeck'
law = {kind = "stribeck", with = 1}
    => law 'stribeck': unknown setting 'with'; did you mean 'width'
law = {kind = "none", width = 1} => law 'none': unknown setting 'width'; it has none
law = {kind = "stribeck", width = -1.0} => width = -1.0 rad/s must be positive
law = {kind = "stribeck", shape = 3} => shape: it should be a valid string, not 3
theta = ; joints = => needs "theta", or "joints"
joints = [] => "joints" must list the parameters of each joint
theta = [[1.0, 2.0]]; shape = [1, 2]; joints = => theta must have shape
theta = [[1.0, nan, 1.0, 0.0]]; shape = [1, 4]; joints = => theta must be finite
theta = [[1.0, 1.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]]
    => "joints" and "theta" disagree: remove one of them
theta = [[0.1, 0.2, 1.0]]; joints = => .theta. must have a row of 4 numbers for each
theta = [[0.1, 0.2, 1.0, 0.01], [0.1]]; joints = => .theta. must have a row of 4 numbers for each
theta = [0.1, 0.2]; joints = => .theta. must have a row of 4 numbers for each
theta = "many"; joints = => .theta. must have a row of 4 numbers for each
shape = 3; joints = => .theta. must have a row of 4 numbers for each
shape = [2, "four"]; joints = => .theta. must have a row of 4 numbers for each
parameters = {m1 = "heavy"} => could not convert string to float: 'heavy'
parameters = {m1 = "inf"} => parameter 'm1' must be finite, not inf
parameters = [1.0] => 'list' object has no attribute 'items'
provenance = 3 => it should be one table of keys
"""


@mistakes(MISTAKES)
def test_mistakes_are_one_line_with_the_file_and_the_rule(wrong, words, tmp_path):
    write_json(tmp_path / "model.json", written(**changes(wrong)))
    with assert_refused(words) as raised:
        load_model(tmp_path / "model.json")
    assert f"{tmp_path / 'model.json'}: " in str(raised.value)


def test_the_unchanged_document_is_none_of_these_and_stays_as_it_was():
    document = written()
    friction = read_model(document, "model.json")
    assert_array_equal(friction.theta, FRICTION.theta)
    assert document == written()


ENTRIES = """
coulomb = 0.1 => joint 1: coulomb must be written as .*N m.*, not 0.1
coulomb = {unit = "N m"} => joint 1: coulomb must be written as
coulomb = {value = true} => joint 1: coulomb must be written as
viscous = {value = 1.0, unit = "N m s/deg"} => viscous must be in 'N m s/rad', not
mass = {value = 1.0} => joint 1 must have the parameters coulomb, peak, .* mass
"""


@mistakes(ENTRIES)
def test_joints_written_by_hand_are_checked_value_by_value(wrong, words):
    with assert_refused(words) as raised:
        read_model(by_hand(**changes(wrong)), "hand.json")
    assert str(raised.value).startswith("hand.json: joint 1")


def test_a_joint_that_is_no_object_is_named():
    document = by_hand()
    document["joints"].append(3.0)
    with assert_refused("joint 2 must have the parameters .*; it has none"):
        read_model(document, "hand.json")


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"{", "is no JSON"),
        (b"", "model.json: is empty"),
        (b"\xff\xfe", "is no JSON"),
        (b"[1, 2]", "must hold a JSON object, it holds a list"),
    ],
)
def test_files_that_are_no_json_objects_are_refused(content, complaint, tmp_path):
    (tmp_path / "model.json").write_bytes(content)
    with assert_refused(complaint):
        read_json(tmp_path / "model.json")


def test_missing_files_and_folders_in_their_place_are_named(tmp_path):
    with assert_refused("gone.json: no such file"):
        read_json(tmp_path / "gone.json")
    with assert_refused("cannot be read"):
        read_json(tmp_path)


def test_numbers_that_json_lacks_are_written_in_words(tmp_path):
    values = {"nan": float("nan"), "more": np.inf, "less": -np.inf, "at": Path("a/b"), 3: (1, 2)}
    write_json(tmp_path / "a.json", {**values, "array": np.array([[1.5]]), "n": np.int64(2)})
    found = json.loads((tmp_path / "a.json").read_text())
    assert found == {
        **{"nan": None, "more": "inf", "less": "-inf", "at": "a/b", "3": [1, 2]},
        **{"array": [[1.5]], "n": 2},
    }


def test_what_json_cannot_hold_leaves_the_old_file(tmp_path):
    path = tmp_path / "model.json"
    write_text(path, "old")
    with pytest.raises(TypeError):
        write_json(path, {"a": object()})
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["model.json"]


class Killed(BaseException):
    """The end of the process, at some instant."""


@pytest.mark.parametrize("moment", range(1, 5))
def test_a_replaced_network_is_the_old_or_the_new_one_at_any_instant(moment, tmp_path, monkeypatch):
    law, path = MLP((3,)), tmp_path / "m.json"
    size, rng = (2, len(law.names)), np.random.default_rng(0)
    models = [Friction(law, rng.normal(size=size)) for _ in range(4)]
    save_model(models[0], path)
    last = models[0]
    for model in models[1:]:  # killed again and again
        moves = []

        def replaced(source, target, moves=moves):
            moves.append(target)
            if len(moves) == moment:
                raise Killed
            os.rename(source, target)

        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", replaced)
            with suppress(Killed):
                save_model(model, path)
        found = load_model(path).theta
        assert any(np.array_equal(found, m.theta) for m in (last, model))
        last = load_model(path)
    save_model(models[1], path)
    assert_array_equal(load_model(path).theta, models[1].theta)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m.json", "m.safetensors"]


class Planted:
    """What pickle runs code of when it is read."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return (Path.touch, (self.mark,))


@pytest.mark.parametrize("place", ["m.json", "m.safetensors"])
def test_loading_a_model_never_executes_code(place, tmp_path):
    mark, law = tmp_path / "executed", MLP((3,))
    save_model(Friction(law, np.zeros((2, len(law.names)))), tmp_path / "m.json")
    content = pickle.dumps(Planted(mark))
    (tmp_path / place).write_bytes(content)
    if place == "m.safetensors":  # under the hash that the model file names
        document = read_json(tmp_path / "m.json")
        document["theta"]["sha256"] = sha256(content).hexdigest()
        write_json(tmp_path / "m.json", document)
    with pytest.raises(InputError):
        load_model(tmp_path / "m.json")
    assert not mark.exists()
    pickle.loads(content)
    assert mark.exists()  # the trap is armed


def test_the_joints_of_a_fit_keep_their_names(tmp_path):
    arm = driven_wrist.mechanism(tmp_path)
    data = driven_wrist.dataset(arm, driven_wrist.frame(arm, seconds=2.0))
    fit = fid.fit(data, "coulomb_viscous", method="one_step")
    fit.save(tmp_path / "model.json")
    loaded = fid.load_model(tmp_path / "model.json")
    assert loaded.joints == fit.joints == ("one", "two", "three", "turner")
    assert loaded.frame.joint.tolist() == fit.frame.joint.tolist()
    document = read_json(tmp_path / "model.json")
    document["provenance"]["joints"] = ["one"]
    write_json(tmp_path / "model.json", document)
    with assert_refused("provenance.joints: it should have 4 names: fit it again"):
        fid.load_model(tmp_path / "model.json")
