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
# an interpreter in which none of these packages can be found
BARE = f"""
import sys
from importlib.machinery import PathFinder
class Bare:
    find_distributions = PathFinder.find_distributions
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


def bare(code, folder):
    """What code prints, and what it complains about, without the packages of extras."""
    command = [sys.executable, "-c", BARE + code]
    run = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    return run.stdout, run.stderr


def test_laws_are_fitted_checked_and_compared_without_extras(tmp_path):
    out, err = bare(
        "fit = fid.fit(data, 'stribeck', method='shooting', free=['inertia'])\n"
        "fit.save('m.json')\n"
        "print(len(fid.load_model('m.json').frame), fid.check(data).level)\n"
        "from frictionid.__main__ import main\n"
        "sys.argv = ['frictionid', 'report', '--help']\n"
        "fid.compare(data, ['none', 'coulomb_viscous'], folds=3, folder='out')\n",
        tmp_path,
    )
    assert err == "" and out.split()[1] in ("good", "doubtful")
    assert (tmp_path / "out" / "index.html").stat().st_size > 10_000


ASKED = {
    "networks": "fid.fit(data, 'lstm')",
    "sindy": "fid.fit(data, 'sindy')",
    "camera": "import frictionid.rig.camera.track",
    "drive": "import frictionid.rig.log",
    "public": "fid.load_dataset('tx40')",
    "excel": "from frictionid.data.readers import table; table.numeric_table(b'x', 'a.xlsx')",
}
ASK_ALL = f"""
for asked in {[*ASKED.values()]}:
    try:
        exec(asked)
    except fid.InputError as error:
        print(error)
"""


def test_what_is_missing_is_named_with_the_command_that_adds_it(tmp_path, monkeypatch):
    monkeypatch.delenv("FRICTIONID_DATA", raising=False)
    lines, err = bare(ASK_ALL, tmp_path)
    assert err == ""
    for extra, line in zip(ASKED, lines.splitlines(), strict=True):
        assert line.endswith(f"is not installed: pip install 'frictionid[{extra}]'")


def test_every_extra_that_a_page_names_exists():
    text = (ROOT / "README.md").read_text()
    assert all(f"`{extra}`" in text for extra in EXTRAS)
