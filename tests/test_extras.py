"""The program without any extra: it fits, checks and compares; what is missing is one line."""

import subprocess
import sys

from fixtures.paths import ROOT

EXTRAS = {
    "networks": ("torch", "safetensors", "array_api_compat"),
    "sindy": ("pysindy", "sklearn"),
    "camera": ("cv2",),
    "drive": ("serial",),
    "tuning": ("optuna",),
    "parquet": ("pyarrow",),
    "excel": ("openpyxl",),
    "public": ("pooch",),
    "page": ("plotly",),
    "dask": ("dask", "distributed"),
}
DISTRIBUTIONS = (
    *("torch", "safetensors", "array-api-compat", "pysindy", "scikit-learn", "optuna", "pyarrow"),
    *("opencv-python-headless", "pyserial", "openpyxl", "pooch", "plotly", "dask", "distributed"),
)
# an interpreter in which none of these packages can be found
BARE = f"""
import sys
from importlib.machinery import PathFinder
class Bare:
    @staticmethod
    def find_distributions(context):
        missing = context.name in {DISTRIBUTIONS!r}
        return () if missing else PathFinder.find_distributions(context)
    invalidate_caches = PathFinder.invalidate_caches
    @staticmethod
    def find_spec(name, path=None, target=None):
        missing = name.partition(".")[0] in {sum(EXTRAS.values(), ())!r}
        return None if missing else PathFinder.find_spec(name, path, target)
sys.meta_path[:] = [Bare if finder is PathFinder else finder for finder in sys.meta_path]
sys.path.append({str(ROOT / "tests")!r})
import frictionid as fid
from fixtures.arm_frames import arm
data = arm()
"""


ASKED = {
    "networks": "fid.fit(data, 'lstm')",
    "sindy": "fid.fit(data, 'sindy')",
    "camera": "import frictionid.rig.camera.track",
    "drive": "import frictionid.rig.log",
    "public": "fid.load_dataset('tx40')",
    "excel": "from frictionid.data.readers import table; table.numeric_table(b'x', 'a.xlsx')",
}
CODE = f"""
from fixtures.result_folders import leave_blank
from pytest import MonkeyPatch
import frictionid.__main__
fit = fid.fit(data, 'coulomb_viscous', method='shooting', free=['inertia'])
fit.save('m.json')
print(len(fid.load_model('m.json').frame), fid.check(data).level)
leave_blank(MonkeyPatch())
fid.compare(data, ['none', 'coulomb_viscous'], folds=2, horizons=[0.1], folder='out')
for asked in {[*ASKED.values()]}:
    try:
        exec(asked)
    except fid.InputError as error:
        print(error)
"""


def test_without_extras_laws_are_fitted_and_compared_and_what_is_missing_is_named(
    tmp_path, monkeypatch
):
    """With the command that adds it."""
    monkeypatch.delenv("FRICTIONID_DATA", raising=False)
    command = [sys.executable, "-c", BARE + CODE]
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    first, *lines = run.stdout.splitlines()
    assert run.stderr == "" and first.split()[1] in ("good", "doubtful")
    assert (tmp_path / "out/index.html").stat().st_size > 10_000
    for extra, line in zip(ASKED, lines, strict=True):
        assert line.endswith(f"is not installed: pip install 'frictionid[{extra}]'")


def test_every_extra_that_a_page_names_exists():
    text = (ROOT / "README.md").read_text()
    assert all(f"`{extra}`" in text for extra in EXTRAS)
