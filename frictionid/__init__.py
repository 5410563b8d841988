"""Friction in robot joints, identified from recorded motion and compared on equal terms.

The names below are imported when they are first asked for, so that `import frictionid` and
`frictionid --help` load none of NumPy, SymPy, pandas, PyTorch.

>>> import frictionid
>>> frictionid.Signal.__module__
'frictionid.data.signals'
"""

from importlib import import_module
from typing import Any

_ROOMS = {"mechanisms": "frictionid.mechanics"}
_HOME = {
    "Dataset": "frictionid.data.recordings",
    "InputError": "frictionid.errors",
    "Motion": "frictionid.data.recordings",
    "Recording": "frictionid.data.recordings",
    "Signal": "frictionid.data.signals",
    "compare": "frictionid.comparison.cross_validate",
    "fit_model": "frictionid.comparison.fit_model",
    "load_dataset": "frictionid.data.readers.dataset",
    "predicted_motion": "frictionid.evaluation.predicted_motion",
    "quick": "frictionid.quickstart.quick",
}

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
