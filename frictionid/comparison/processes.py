"""Calls of a function side by side, one thread each, and what their numbers depend on."""

import os
import platform
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any, TypeVar

import cloudpickle
from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import process_executor
from threadpoolctl import threadpool_limits

from frictionid.files import sha256

Returned = TypeVar("Returned")

_PACKAGES = (
    "frictionid numpy scipy sympy pandas scikit-learn pysindy torch array-api-compat joblib "
    "pyarrow pydantic"
).split()


def side_by_side(
    work: Callable[..., Returned], calls: Sequence[tuple[Any, ...]], jobs: int
) -> Iterator[tuple[int, Returned]]:
    """Number of each call of a function and what it gives, as they are finished.

    Each computes on one thread, in one of at most `jobs` processes.
    """
    workers = min(jobs, len(calls))
    if workers < 2:
        with threadpool_limits(1):
            one_torch_thread()
            yield from ((i, work(*call)) for i, call in enumerate(calls))
        return
    # who interrupts a comparison knows that tasks were cancelled
    warnings.filterwarnings("ignore", r"\d+ tasks .*(not used|cancelled)", UserWarning)
    with parallel_config(backend="loky", inner_max_num_threads=1):
        # max_nbytes: arrays travel with their task, no files are left behind in shared memory
        parallel = Parallel(workers, return_as="generator_unordered", batch_size=1, max_nbytes=None)
        with _blocked(signal.SIGINT):
            results = parallel(
                delayed(_in_worker)(os.getpid(), i, sys.path, cloudpickle.dumps((work, call)))
                for i, call in enumerate(calls)
            )
        yield from results


@contextmanager
def _blocked(number: signal.Signals) -> Iterator[None]:
    """Put a signal off. Processes started meanwhile never see it: Ctrl-C is the parent's affair."""
    if sys.platform == "win32":  # which has neither masks nor a tracker
        yield
        return
    resource_tracker.ensure_running()  # Python's own start of it would let the signal in
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [number])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _in_worker(parent: int, index: int, places: Sequence[str], content: bytes) -> tuple[int, Any]:
    # one that was killed cannot end its workers
    if all(thread.name != "end-with-parent" for thread in threading.enumerate()):
        threading.Thread(target=_watch, args=(parent,), name="end-with-parent", daemon=True).start()
    # PyTorch that a later task loads is no memory leak, for which the worker would be replaced
    process_executor._MAX_MEMORY_LEAK_SIZE = sys.maxsize
    one_torch_thread()
    # a worker of an earlier call does not know where modules have been found since
    sys.path += [place for place in places if place not in sys.path]
    work, call = cloudpickle.loads(content)
    return index, work(*call)


def _watch(parent: int) -> None:
    """End this worker when the comparison ends."""
    while os.getppid() == parent:
        time.sleep(0.3)
    os._exit(1)


def one_torch_thread() -> None:
    """Let torch, where it is loaded, compute on one thread."""
    torch = sys.modules.get("torch")
    if torch is not None:
        torch.set_num_threads(1)


def versions() -> dict[str, str]:
    """Versions of Python, this package, and the installed ones that its numbers come from."""
    out = {"python": platform.python_version()}
    for name in _PACKAGES:
        with suppress(PackageNotFoundError):  # of an extra
            out[name] = version(name)
    return out


@cache
def package_digest() -> str:
    """SHA-256 of this package's sources: another version may find other numbers."""
    files = sorted(Path(__file__).parents[1].rglob("*.py"))
    return sha256(b"".join(path.read_bytes() for path in files))
