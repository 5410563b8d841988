"""Mistakes in suites: what is changed in a right one, and the words of the complaint."""

OWN_RECIPE = {"name": "mine", "scheme": "integral", "states": {"kind": "rts"}}


def recipe(**changes):
    return [("recipes.0", {**OWN_RECIPE, **changes})]


def identifier(**entry):
    return [("identifiers.1", entry)]


MISTAKES = {
    # unknown keys at every level, with the nearest
    "unknown key": ([("horizon", [0.1])], "unknown key 'horizon'; did you mean 'horizons'"),
    "unknown folds key": ([("folds.cuont", 3)], "folds: unknown .*'cuont'; did you mean 'count'"),
    "unknown data key": (
        [("datasets.0.test", [])],
        r"datasets\[0\]: unknown key 'test'; did you mean 'tests'",
    ),
    "unknown recipe key": (
        recipe(state={"kind": "rts"}),
        r"recipes\[0\]: unknown key 'state'; did you mean 'states'",
    ),
    "unknown estimator key": (
        recipe(states={"kind": "savgol", "windo": 5}),
        "recipe 'mine', states: unknown setting 'windo'; did you mean 'window'",
    ),
    "setting of a part without": (
        recipe(states={"kind": "rts", "support": 5}),
        "recipe 'mine', states: unknown setting 'support'; it has none",
    ),
    "unknown setting": (
        identifier(kind="stribeck", symetric=True),
        "'stribeck': unknown setting 'symetric'; did you mean 'symmetric'",
    ),
    "setting of none": (identifier(kind="none", width=1.0), "'width'; it has none"),
    # wrong types, which are not converted
    "text for a number": ([("every", "0.25")], r"every: it should be a valid number, not '0\.25'"),
    "number for a text": ([("title", 3)], "title: it should be a valid string, not 3"),
    "number for a list": ([("horizons", 0.5)], r"horizons: it should be a valid list, not 0\.5"),
    "text in a list": ([("horizons", [0.1, "0.5"])], r"horizons\[1\]: .*number, not '0\.5'"),
    "truth value": ([("folds.count", True)], "folds: count: it should be a valid int.*, not True"),
    "part of a fold": ([("folds.count", 2.5)], r"folds: count: .*integer.*, not 2\.5"),
    "folds are no table": ([("folds", 3)], "folds: it should be one table of keys .*, not 3"),
    "data sets are no list": ([("datasets", {"path": "tiny"})], "datasets: .*list"),
    "path is a number": ([("datasets.0.path", 3)], r"datasets\[0\]\.path: .*string, not 3"),
    "tests is a text": ([("datasets.0.tests", "tiny")], r"datasets\[0\]\.tests: .*list"),
    "states are a text": (recipe(states="rts"), r"recipes\[0\]\.states: .*dict.*, not 'rts'"),
    "number for a truth value": (
        identifier(kind="stribeck", symmetric=1),
        "symmetric: it should be a valid boolean, not 1",
    ),
    "file is a number": (identifier(kind="published", file=3), "file: .*string, not 3"),
    "kind is a number": (identifier(kind=3), r"identifiers\[1\]\.kind: .*string, not 3"),
    "recipes are a text": (
        identifier(kind="none", recipes="study"),
        r"identifiers\[1\]\.recipes: .*list, not 'study'",
    ),
    "state kind is a number": (recipe(states={"kind": 3}), "'kind' is missing; known: 'backward'"),
    # missing keys
    "no name": ([("name", None)], "the key 'name' is missing"),
    "no data": ([("datasets", None)], "the key 'datasets' is missing"),
    "no path": ([("datasets.0", {})], r"the key 'datasets\[0\]\.path' is missing"),
    "no kind": (identifier(width=0.1), r"the key 'identifiers\[1\]\.kind' is missing"),
    "no scheme": ([("recipes.0", {"name": "mine"})], "'mine' is unknown; .*needs states"),
    "no file": (identifier(kind="published"), "'published': the key 'file' is missing"),
    "no state kind": (recipe(states={}), "recipe 'mine', states: the key 'kind' is missing"),
    # out of range
    "no horizons": ([("horizons", [])], "horizons: .*at least 1"),
    "negative horizon": ([("horizons", [-0.1])], r"horizons\[0\]: .*greater than 0, not -0\.1"),
    "endless horizon": ([("horizons", [float("inf")])], r"horizons\[0\]: .*finite"),
    "no number": ([("horizons", [float("nan")])], r"horizons\[0\]: .*finite.*, not nan"),
    "every zero": ([("every", 0.0)], r"every: .*greater than 0, not 0\.0"),
    "negative history": ([("history", -1)], "history: .*greater than or equal to 0, not -1"),
    "sample time zero": ([("sample_time", 0)], "sample_time: .*greater than 0, not 0"),
    "no seeds": ([("seeds", [])], "seeds: .*at least 1"),
    "negative seed": ([("seeds", [-1])], r"seeds\[0\]: .*, not -1"),
    "one fold": ([("folds.count", 1)], "folds: count = 1 must be at least 2"),
    "too many folds": ([("folds.count", 13)], "12 recordings cannot make 13 folds"),
    "negative gap": ([("folds.gap", -1.0)], r"folds: gap = -1\.0 s must be finite and not neg"),
    "unknown fold kind": ([("folds.kind", "block")], "folds: kind: .*'blocks'.*not 'block'"),
    "no identifiers": ([("identifiers", [])], "identifiers: .*at least 1"),
    "no recipes": ([("recipes", [])], "recipes: .*at least 1"),
    "no width": (identifier(kind="stribeck", width=0.0), r"width: .*greater than 0, not 0\.0"),
    "unknown shape": (identifier(kind="stribeck", shape="atan"), "shape: .*'arctan', not 'atan'"),
    "even window": (recipe(states={"kind": "savgol", "window": 4}), "window = 4 must be odd"),
    "negative order": (
        recipe(states={"kind": "savgol", "order": -1, "window": 1}),
        "order: .*greater than or equal to 1, not -1",
    ),
    "negative rest": (recipe(rest=-0.1), r"recipes\[0\]\.rest: .*, not -0\.1"),
    # names
    "nameless": ([("name", "")], "name: .*pattern"),
    "folder as a name": ([("name", "..")], "name: .*pattern"),
    "path as a name": ([("name", "a/b")], "name: .*pattern"),
    "identifier outside": (identifier(kind="none", name="../x"), r"\[1\]\.name: .*pattern"),
    "two of one name": (identifier(kind="none"), "two identifiers are called 'none'"),
    "named as the truth": (identifier(kind="none", name="truth"), "identifiers are called 'truth'"),
    "two of one file": (
        identifier(kind="none", name="None"),
        "two results are called 'tiny--none--study--seed0.json'",
    ),
    "two recipes": ([("recipes.1.name", "study")], "two recipes are called 'study'"),
    "two seeds": ([("seeds", [1, 1])], "two seeds are called '1'"),
    "two data sets": ([("datasets", [{"path": "tiny"}] * 2)], "two data sets are called 'tiny'"),
    "fitted and tested": (
        [("datasets", [{"path": "tiny"}, {"path": "other", "tests": ["tiny"]}])],
        "two data sets are called 'tiny'",
    ),
    "unknown kind": (identifier(kind="stribek"), "kind = 'stribek' is unknown; did you mean 'stri"),
    "unknown estimator": (recipe(states={"kind": "kalman"}), "'kalman' is unknown; known: 'backw"),
    "unknown scheme": (recipe(scheme="rk4"), r"recipes\[0\]\.scheme: .*'euler' or 'integral', not"),
    "unknown recipe": ([("recipes.0.name", "studi")], "'studi' is unknown; did you mean 'study'"),
    "recipe of an identifier": (
        identifier(kind="none", name="x", recipes=["studi"]),
        "'x': the suite has no recipe 'studi'; did you mean 'study'",
    ),
    "for no recipe": (identifier(kind="none", name="x", recipes=[]), r"\[1\]\.recipes: .*at least"),
    "another study": (recipe(name="study"), "recipe 'study' has its own states: give yours anoth"),
    "lagging states": (
        recipe(states={"kind": "backward"}),
        '\'mine\': backward differences lag half a sample.*choose the states "rts" or "savgol"',
    ),
    # files
    "no such data": ([("datasets.0.path", "nowhere")], "nowhere does not exist; name a folder"),
    "impossible path": ([("datasets.0.path", "a\0b")], "does not exist"),
    "no such model": (identifier(kind="published", file="x.json"), r"x\.json: no such file"),
    "impossible model": (identifier(kind="published", file="a\0b"), "a\0b: "),
    "model is a folder": (identifier(kind="published", file="tiny"), "tiny: cannot be read"),
    "model is a table": (identifier(kind="published", file="tiny/00.csv"), "00.csv: is no JSON"),
    "joints of a model": (
        identifier(kind="published", file="two.json"),
        r"'published': its theta has shape \(2, 2\), data set 'tiny' has 1 joints",
    ),
    "parameters of a model": (
        identifier(kind="published", file="strange.json"),
        "'published' on 'tiny': .*pendulum has no parameter 'm4'",
    ),
    # code
    "no such module": (identifier(kind="nowhere:Mine"), "'nowhere:Mine' cannot be imported"),
    "no such class": (identifier(kind="own_parts:Min"), "cannot be imported.*no attribute 'Min'"),
    "no class": (identifier(kind="own_parts:number"), "'number': 'int' object is not callable"),
    "nameless class": (identifier(kind="own_parts:"), "'own_parts:' cannot be imported"),
    "nameless module": (identifier(kind=":Mine"), "':Mine' cannot be imported"),
    "relative module": (identifier(kind=".own_parts:Mine"), "cannot be imported.*relative"),
    "broken module": (identifier(kind="own_broken:Mine"), "cannot be imported.*division by zero"),
    "no identifier": (identifier(kind="own_parts:Idle"), "has no method fit"),
    "own unknown setting": (identifier(kind="own_parts:Mine", levl=1.0), "'Mine': .*'levl'"),
    "own refusal": (identifier(kind="own_parts:Mine", level=-1.0), "level = -1.0 must not be neg"),
}
