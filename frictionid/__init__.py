"""Friction in robot joints, identified from recorded motion and compared on equal terms.

The names below are imported when they are first asked for, so that `import frictionid` and
`frictionid --help` load none of NumPy, SymPy, pandas, PyTorch. `docs/python.md` shows their use.

>>> import frictionid
>>> frictionid.Signal.__module__
'frictionid.data.signals'
"""

import ast
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from frictionid import mechanics as mechanisms
    from frictionid.api.check import check as check
    from frictionid.api.check import quick as quick
    from frictionid.api.compare import compare as compare
    from frictionid.api.comparison import load_comparison as load_comparison
    from frictionid.api.evaluate import evaluate as evaluate
    from frictionid.api.evaluate import predict as predict
    from frictionid.api.fit import fit as fit
    from frictionid.api.fit import load_model as load_model
    from frictionid.api.fitted import Fit as Fit
    from frictionid.api.machines import machine as machine
    from frictionid.api.machines import machines as machines
    from frictionid.api.models import identifiers as identifiers
    from frictionid.api.models import laws as laws
    from frictionid.api.sensitivity import sensitivity as sensitivity
    from frictionid.api.simulate import simulate as simulate
    from frictionid.api.suggest import suggest as suggest
    from frictionid.api.suggest import suggest_trajectories as suggest_trajectories
    from frictionid.api.suites import run_suite as run_suite
    from frictionid.api.suites import tune as tune
    from frictionid.data.readers.dataset import load_dataset as load_dataset
    from frictionid.data.recordings import Dataset as Dataset
    from frictionid.data.recordings import Recording as Recording
    from frictionid.data.recordings import TrueMotion as TrueMotion
    from frictionid.data.signals import Signal as Signal
    from frictionid.deploy.compensation import Compensation as Compensation
    from frictionid.deploy.compensation import compensating as compensating
    from frictionid.deploy.compensation import compensation_table as compensation_table
    from frictionid.deploy.compensation import feed_forward as feed_forward
    from frictionid.deploy.export.export import export as export
    from frictionid.deploy.external_torque import external_torque as external_torque
    from frictionid.deploy.gym_env import Episode as Episode
    from frictionid.deploy.gym_env import FrictionEnv as FrictionEnv
    from frictionid.deploy.gym_env import FrictionVectorEnv as FrictionVectorEnv
    from frictionid.deploy.monitor.monitor import baseline as baseline
    from frictionid.deploy.monitor.monitor import monitor as monitor
    from frictionid.deploy.pool import Pooled as Pooled
    from frictionid.deploy.pool import over_covariate as over_covariate
    from frictionid.deploy.pool import pool as pool
    from frictionid.deploy.simulator import Simulator as Simulator
    from frictionid.errors import InputError as InputError
    from frictionid.evaluation.folds import Split as Split
    from frictionid.fitting.identifier import Identifier as Identifier
    from frictionid.fitting.identifiers import LeastSquares as LeastSquares
    from frictionid.fitting.identifiers import SINDy as SINDy
    from frictionid.friction import Friction as Friction
    from frictionid.friction import Inputs as Inputs
    from frictionid.friction import Law as Law
    from frictionid.friction.laws import LSTM as LSTM
    from frictionid.friction.laws import MLP as MLP
    from frictionid.friction.laws import CoulombViscous as CoulombViscous
    from frictionid.friction.laws import Dahl as Dahl
    from frictionid.friction.laws import FilmLag as FilmLag
    from frictionid.friction.laws import GearLoad as GearLoad
    from frictionid.friction.laws import LoadDependent as LoadDependent
    from frictionid.friction.laws import LuGre as LuGre
    from frictionid.friction.laws import MotorLoad as MotorLoad
    from frictionid.friction.laws import NoFriction as NoFriction
    from frictionid.friction.laws import Play as Play
    from frictionid.friction.laws import Quadratic as Quadratic
    from frictionid.friction.laws import Ripple as Ripple
    from frictionid.friction.laws import Spline as Spline
    from frictionid.friction.laws import Stribeck as Stribeck
    from frictionid.friction.laws import Sum as Sum
    from frictionid.friction.laws import Thermal as Thermal
    from frictionid.friction.laws import TorchModule as TorchModule
    from frictionid.friction.laws import WindowMLP as WindowMLP
    from frictionid.rig.align.recording_folder import align as align
    from frictionid.rig.camera.track import track as track

_ROOMS = {"mechanisms": "frictionid.mechanics"}


def _modules() -> dict[str, str]:
    """The module of each public name, as the imports above have it."""
    tree = ast.parse(Path(__file__).read_text(encoding="utf-8"))
    imports = next(node.body for node in tree.body if isinstance(node, ast.If))
    lines = [node for node in imports if isinstance(node, ast.ImportFrom) and node.module]
    homes = {str(a.asname): str(n.module) for n in lines for a in n.names}
    return {name: module for name, module in homes.items() if name not in _ROOMS}


_HOME = _modules()
__all__ = ["__version__", *_HOME, *_ROOMS]


def __getattr__(name: str) -> Any:
    """A public name from the module that defines it, or the installed version."""
    if name == "__version__":
        return import_module("importlib.metadata").version("frictionid")
    if name in _ROOMS:
        return import_module(_ROOMS[name])
    if name not in _HOME:
        raise AttributeError(f"module 'frictionid' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)


class _Package(ModuleType):
    """The package: its names stay functions where a room of the same name is imported.

    `import frictionid.check` would put the room in the place of the function `frictionid.check`.
    The room is found by its path all the same: `from frictionid.check import Finding`.
    """

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
