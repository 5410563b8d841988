"""Suites: what they make, and every mistake in one line that names file, key and way out."""

import tomli_w
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from fixtures.shared import shared
from fixtures.tiny_pendulums import (
    FEW,
    SUITE,
    TRUTH,
    suite,
    tasks_in,
    write_dataset,
    write_suite,
    write_toml,
)
from hypothesis import given
from hypothesis import strategies as st

from frictionid.comparison.suite import load_suite
from frictionid.data.state_estimators import SavitzkyGolay
from frictionid.errors import InputError
from frictionid.evaluation import Protocol, Split
from frictionid.fitting.identifiers import Frictionless, LeastSquares, Published
from frictionid.fitting.one_step.recipe import INTEGRAL, STUDY, Recipe
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.friction.model_files import save_model


@shared
def place(shared_path):
    """A folder with the data set `tiny`, a model file and a module with identifiers."""
    write_dataset(shared_path / "tiny", changes=FEW)
    write_dataset(shared_path / "other", name="other")
    model = Friction(CoulombViscous(), [[0.02, 0.001]], {"mass": 0.3})
    save_model(model, shared_path / "model.json")
    two = Friction(CoulombViscous(), [[0.02, 0.001], [0.0, 0.0]])
    save_model(two, shared_path / "two.json")
    strange = Friction(CoulombViscous(), [[0.02, 0.001]], {"m4": 0.3})
    save_model(strange, shared_path / "strange.json")
    (shared_path / "own_parts.py").write_text(OWN)
    (shared_path / "own_broken.py").write_text("1 / 0\n")
    return shared_path


OWN = """
from dataclasses import dataclass
from frictionid import Identifier
from frictionid.fitting.identifiers import Frictionless

@dataclass(frozen=True)
class Mine(Identifier):
    level: float = 1.0
    def __post_init__(self):
        if self.level < 0:
            raise ValueError(f"level = {self.level} must not be negative")
    def fit(self, problem, weights, seed):
        return Frictionless().fit(problem, weights, seed)

class Idle:
    pass

number = 3
"""


def tasks(place, changes=(), data=None):
    return tasks_in(write_suite(place, changes), data)


# --- What a suite makes --------------------------------------------------------------------------


def test_a_suite_is_the_constructor_calls_of_its_parts(place):
    document = suite(
        """
        horizons = [0.2, 0.1]; every = 0.5; history = 0.2; sample_time = 0.02; seeds = [3, 1]
        folds = {count = 4, kind = "blocks", gap = 0.1, seed = 2}
        """
    )
    document["identifiers"] = [
        {"kind": "none", "recipes": ["study"]},
        {"kind": "stribeck", "symmetric": False, "width": 0.05, "name": "mine"},
        {"kind": "coulomb_viscous", "shape": "arctan"},
    ]
    document["recipes"] = [
        {"name": "study"},
        {
            "name": "local",
            "states": {"kind": "savgol", "window": 5, "order": 2},
            "scheme": "integral",
            "velocity_threshold": 0.1,
        },
    ]
    made = tasks_in(write_toml(place / "suite.toml", document))
    local = Recipe("local", SavitzkyGolay(5, 2), "integral", 0.1)
    none, mine = Frictionless(), LeastSquares(Stribeck(0.05, symmetric=False))
    rubs = LeastSquares(CoulombViscous(shape="arctan"))
    expected = [("none", none, STUDY)]
    for recipe in (STUDY, local):
        expected += [("mine", mine, recipe), ("coulomb_viscous", rubs, recipe)]
    found = [(t.name, t.identifier, t.recipe, t.seed) for t in made if t.name != "truth"]
    assert sorted(map(repr, found)) == sorted(repr((*e, s)) for e in expected for s in (3, 1))
    assert len(made) == len(expected) * 2 + 4
    benchmark = made[0].benchmark
    assert benchmark.protocol == Protocol((0.2, 0.1), 0.5, 0.2, 0.02)
    assert benchmark.folds.count == 4 and benchmark.folds.gap == 0.1
    assert {t.benchmark for t in made} == {benchmark}


def test_defaults_are_those_of_the_parts(place):
    document = {key: SUITE[key] for key in ("name", "datasets", "identifiers")}
    found = load_suite(write_toml(place / "suite.toml", document))
    assert found.folds == Split()
    assert found.protocol == Protocol()
    assert [recipe.name for recipe in found.recipes] == ["integral"] and found.seeds == [0]


def test_the_truth_stands_beside_the_identifiers_where_it_is_one_of_our_laws(place):
    truths = [task for task in tasks(place) if task.name == "truth"]
    assert [task.recipe for task in truths] == [STUDY, INTEGRAL]
    theta = truths[0].identifier.friction.theta[0]
    assert theta.tolist() == [TRUTH[name][0] for name in Stribeck(symmetric=False).names]
    write_dataset(place / "hidden", name="hidden", changes='truth.kind = "maxwell_slip"')
    write_dataset(place / "measured", name="measured", changes="truth =")
    for name in ("hidden", "measured"):
        assert not [t for t in tasks(place, [("datasets.0.path", name)]) if t.name == "truth"]
    late = [("truth.kind", "film_lag"), ("truth.lag", [0.02])]
    write_dataset(place / "late", name="late", changes=late)
    (truth, _) = [t for t in tasks(place, 'datasets.0.path = "late"') if t.name == "truth"]
    assert truth.identifier.friction.theta[0].tolist() == [*theta, 0.02]


def test_a_model_file_is_found_beside_the_suite(place, monkeypatch):
    monkeypatch.chdir(place.parent)
    made = tasks(place, 'identifiers.1 = {kind = "published", file = "model.json"}')
    given = next(task.identifier for task in made if task.name == "published")
    assert isinstance(given, Published) and given.friction.parameters == {"mass": 0.3}


def test_an_identifier_of_ones_own_is_found_beside_the_suite(place):
    entry = {"kind": "own_parts:Mine", "level": 2.0}
    made = tasks(place, [("identifiers.1", entry)])
    mine = next(task.identifier for task in made if task.name == "Mine")
    assert mine.level == 2.0


def test_one_data_set_may_have_its_tables_elsewhere_and_several_may_not(place, tmp_path):
    tables = write_dataset(tmp_path / "tables")
    (tmp_path / "tables/dataset.toml").unlink()
    apart = place / "apart"
    write_dataset(apart, name="apart", changes='collection = "pendulums"')
    for table in apart.glob("*.csv"):
        table.unlink()
    made = tasks(place, 'datasets.0.path = "apart"', tables)
    assert len(made[0].benchmark.dataset.recordings) == 12
    # data sets that only test what was fitted to it share its collection
    entry = {"path": "apart", "tests": ["apart_test"]}
    write_dataset(place / "apart_test", name="apart_test", changes='collection = "pendulums"')
    assert tasks(place, [("datasets.0", entry)], tables)[0].benchmark.tests[0].name == "apart_test"
    with assert_refused(r"--data .*several \(tiny, apart\).*FRICTIONID_DATA"):
        tasks(place, 'datasets = [{path = "tiny"}, {path = "apart"}]', tables)


# --- Mistakes ------------------------------------------------------------------------------------


OWN_RECIPE = {"name": "mine", "scheme": "integral", "states": {"kind": "rts"}}
MISTAKES = r"""
horizon = [0.1] => unknown key 'horizon'; did you mean 'horizons'
recipe = {state = {kind = "rts"}} => recipes\[0\]: unknown key 'state'; did you mean 'states'
recipe = {states = {kind = "savgol", windo = 5}}
    => recipe 'mine', states: unknown setting 'windo'; did you mean 'window'
recipe = {states = {kind = "rts", support = 5}}
    => recipe 'mine', states: unknown setting 'support'; it has none
identifier = {kind = "stribeck", symetric = true}
    => 'stribeck': unknown setting 'symetric'; did you mean 'symmetric'
identifier = {kind = "none", width = 1.0} => 'width'; it has none
every = "0.25" => every: it should be a valid number, not '0\.25'
folds = 3 => folds: it should be one table of keys .*, not 3
recipe = {states = "rts"} => recipes\[0\]\.states: .*dict.*, not 'rts'
identifier = {kind = "stribeck", symmetric = 1} => symmetric: it should be a valid boolean, not 1
name = => the key 'name' is missing
identifier = {width = 0.1} => the key 'identifiers\[1\]\.kind' is missing
recipes.0 = {name = "mine"} => 'mine' is unknown; .*needs states
identifier = {kind = "published"} => 'published': the key 'file' is missing
recipe = {states = {}} => recipe 'mine', states: the key 'kind' is missing
horizons = [] => horizons: it should have at least 1 item, not \[\]
horizons = [nan] => horizons\[0\]: .*finite.*, not nan
every = 0.0 => every: it should be greater than 0, not 0\.0
history = -1 => history: it should be greater than or equal to 0, not -1
folds.count = 1 => folds: count: it should be greater than or equal to 2, not 1
identifier = {kind = "stribeck_asymmetric"}
    => kind = 'stribeck_asymmetric' is unknown; known: .*'stribeck'
recipe = {states = {kind = "savgol", order = -1, window = 1}}
    => order = -1, which must be at least 1
recipe = {velocity_threshold = -0.1}
    => 'mine': velocity_threshold: it should be greater than or equal to 0, not -0\.1
name = ".." => name: .*pattern
identifier = {kind = "none", name = "../x"} => \[1\]\.name: .*pattern
identifier = {kind = "none"} => two identifiers are called 'none'
identifier = {kind = "none", name = "truth"} => identifiers are called 'truth'
identifier = {kind = "none", name = "None"}
    => two results are called 'tiny--none--study--seed0.json'
seeds = [1, 1] => two seeds are called '1'
datasets = [{path = "tiny"}, {path = "tiny"}] => two data sets are called 'tiny'
datasets = [{path = "tiny"}, {path = "other", tests = ["tiny"]}] => two data sets are called 'tiny'
identifier = {kind = "stribek"} => kind = 'stribek' is unknown; did you mean 'stri
recipe = {states = {kind = "kalman"}} => 'kalman' is unknown; known: 'backw
recipe = {scheme = "rk4"} => 'mine': scheme: it should be 'euler' or 'integral'
recipes.0.name = "studi" => 'studi' is unknown; did you mean 'study'
identifier = {kind = "none", name = "x", recipes = ["studi"]}
    => 'x': the suite has no recipe 'studi'; did you mean 'study'
identifier = {kind = "none", name = "x", recipes = []} => \[1\]\.recipes: .*at least
recipe = {name = "study"} => recipe 'study' has its own states: give yours anoth
recipe = {states = {kind = "backward"}}
    => 'mine': backward differences lag half a sample.*choose the states "rts" or "savgol"
datasets.0.path = "nowhere" => nowhere does not exist; name a folder
datasets.0.path = "a\u0000b" => does not exist
identifier = {kind = "published", file = "x.json"} => x\.json: no such file
identifier = {kind = "published", file = "tiny"} => tiny: cannot be read
identifier = {kind = "published", file = "two.json"}
    => 'published': its theta has shape \(2, 2\), data set 'tiny' has 1 joints
identifier = {kind = "published", file = "strange.json"}
    => 'published' on 'tiny': .*pendulum has no parameter 'm4'
identifier = {kind = "nowhere:Mine"} => 'nowhere:Mine' is neither in a module beside
identifier = {kind = "own_parts:Min"} => cannot be imported.*no attribute 'Min'
identifier = {kind = "own_parts:number"} => 'number': 'int' object is not callable
identifier = {kind = "own_parts:"} => 'own_parts:' cannot be imported
identifier = {kind = ".own_parts:Mine"} => is neither in a module beside the
identifier = {kind = "own_broken:Mine"} => cannot be imported.*division by zero
identifier = {kind = "own_parts:Idle"} => is no identifier: derive it from
identifier = {kind = "own_parts:Mine", levl = 1.0} => 'Mine': .*'levl'
identifier = {kind = "own_parts:Mine", level = -1.0} => level = -1.0 must not be neg
"""


@mistakes(MISTAKES)
def test_a_mistake_is_one_line_that_names_file_and_key(place, wrong, words):
    ((key, value),) = changes(wrong).items()
    if key == "recipe":
        key, value = "recipes.0", OWN_RECIPE | value
    before = written(place)
    with assert_refused(words) as caught:
        tasks(place, [("identifiers.1" if key == "identifier" else key, value)])
    assert str(caught.value).startswith(str(place / "suite.toml"))
    assert written(place) == before


def written(place):
    """All files but the suite, which the test itself writes, and what Python compiles."""
    found = place.rglob("*")
    return sorted(p for p in found if p.name != "suite.toml" and "__pycache__" not in str(p))


# --- Whatever chance brings ----------------------------------------------------------------------

TEXT = tomli_w.dumps(SUITE)
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 10**25),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(["study", "integral", "stribeck", "tiny", "a:b", "..", ""]),
    st.lists(st.integers(-2, 3), max_size=3),
    st.dictionaries(st.sampled_from(["kind", "name", "path", "x", "count"]), st.integers(0, 3)),
)
KEYS = (
    *("name", "title", "horizons", "horizons.0", "every", "history", "sample_time", "seeds"),
    *("folds", "folds.count", "folds.kind", "folds.gap", "folds.seed", "datasets", "datasets.0"),
    *("datasets.0.path", "datasets.0.tests", "recipes", "recipes.0", "recipes.0.name"),
    *(
        "recipes.0.states",
        "recipes.0.scheme",
        "recipes.0.velocity_threshold",
        "identifiers",
        "identifiers.0",
    ),
    *("identifiers.0.kind", "identifiers.0.name", "identifiers.0.recipes", "identifiers.0.width"),
    "identifiers.1.shape",
)


def outcome(place, content):
    """The file of a suite's bytes, its tasks, and what was said where it has none."""
    file = place / "damaged.toml"
    file.write_bytes(content)
    try:
        return file, tasks_in(file, trust=False), ""
    except InputError as error:
        return file, [], str(error)
    finally:
        file.unlink()


@given(changes=st.lists(st.tuples(st.sampled_from(KEYS), VALUES), min_size=1, max_size=2))
def test_any_value_anywhere_is_taken_or_refused(place, changes):
    try:
        document = suite(changes)
        content = tomli_w.dumps(document).encode()
    except (TypeError, AttributeError, KeyError, IndexError, UnicodeEncodeError):
        return  # the first change took away what the second one names
    file, made, said = outcome(place, content)
    assert made or said.startswith(str(file))


@given(
    where=st.integers(0, len(TEXT)),
    length=st.integers(0, 30),
    instead=st.one_of(st.binary(max_size=4), st.sampled_from([b"[", b"]]", b"=", b'"', b"\n"])),
)
def test_any_damage_to_the_text_is_taken_or_refused(place, where, length, instead):
    content = TEXT.encode()
    file, made, said = outcome(place, content[:where] + instead + content[where + length :])
    assert made or said.startswith(str(file))
