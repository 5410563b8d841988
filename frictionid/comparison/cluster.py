"""Calls of a function on the workers of a Dask cluster, each on one thread.

What calls share, such as a prepared data set, goes to the cluster once, under the SHA-256 of its
content; workers pass it on to each other. A worker that dies costs time only: others make its
calls, and what it held is sent again. Nothing stays on the cluster when the calls end.
"""

import pickle
import re
import sys
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import cache, lru_cache
from typing import Any, TypeVar

import cloudpickle
import dask.config
from distributed import Client, Future, KilledWorker, Worker, as_completed, get_worker
from distributed.comm import CommClosedError
from threadpoolctl import threadpool_limits

from frictionid.config import is_installed
from frictionid.errors import InputError
from frictionid.files import sha256

from .processes import one_torch_thread, package_digest, versions

Returned = TypeVar("Returned")

ANSWER = 10.0  # [s] for the scheduler to answer
FIRST_WORKER = 10.0  # [s] for a worker to be there
_ADDRESS = re.compile(r"((tcp|tls)://)?(\[[^\s\[\]/]+\]|[^\s\[\]/:]+):\d{1,5}")
_SETTINGS = {
    "distributed.comm.timeouts.connect": ANSWER,
    "distributed.admin.large-graph-warning-threshold": "1 TB",  # data sets are sent on purpose
}


def on_cluster(
    work: Callable[..., Returned], calls: Sequence[tuple[Any, ...]], address: str
) -> Iterator[tuple[int, Returned]]:
    """Number of each call of a function and what it gives, as they are finished.

    calls : arguments of each; calls of the same first argument share it
    address : of the scheduler, such as "tcp://10.0.0.1:8786"

    Raises
    ------
    InputError
        Where there is no cluster, or its workers would not find the same numbers.
    """
    with dask.config.set(_SETTINGS), _client(address) as client:
        _check_workers(client, address)
        with _own_modules_by_value():
            futures = _submitted(client, work, calls)
        finished = as_completed(futures, loop=client.loop)
        del futures  # each result leaves the cluster once it is here
        try:
            for future in finished:
                yield future.key[1], cloudpickle.loads(future.result())
        except KilledWorker as error:
            raise InputError(
                f"{address}: {error.allowed_failures + 1} workers died of one task, perhaps for "
                "want of memory: give them more, and finish with --resume"
            ) from None
        except (CancelledError, CommClosedError):
            raise InputError(
                f"{address}: the scheduler is gone: start it, and finish with --resume"
            ) from None


@contextmanager
def _client(address: str) -> Iterator[Client]:
    """A connection to the scheduler at an address."""
    if not _ADDRESS.fullmatch(address):
        raise InputError(
            f"{address!r} is no address of a scheduler: it is like tcp://10.0.0.1:8786"
        )
    try:
        client = Client(address, timeout=ANSWER, set_as_default=False)
    except OSError as error:
        raise InputError(
            f"{address}: no Dask scheduler answers there ({error}): start one with "
            "`dask scheduler`, and give the address that it prints"
        ) from None
    with client:
        yield client


# --- What makes equal numbers ---------------------------------------------------------------------


def _check_workers(client: Client, address: str) -> None:
    """Check that there are workers, and that they and the scheduler have our software."""
    try:
        client.wait_for_workers(1, timeout=FIRST_WORKER)
    except TimeoutError:
        raise InputError(
            f"{address}: the scheduler has no workers: start some with `dask worker {address} "
            "--nthreads 1`"
        ) from None
    try:
        scheduler, environments = client.run_on_scheduler(_wanted), client.run(_environment)
    except ModuleNotFoundError as error:
        raise InputError(
            f"{address}: scheduler or workers lack {error.name}: install the same frictionid there "
            "as here"
        ) from None
    check_equal({**scheduler, "threads": "1"}, _wanted(), f"scheduler {address}")
    for worker, environment in environments.items():
        check_equal(environment, _wanted(), f"worker {worker}")


@cache
def _wanted() -> dict[str, str]:
    return {**versions(), "code of frictionid": package_digest()[:12]}


def _environment(dask_worker: Worker) -> dict[str, str]:
    """All of a worker that numbers may depend on; Dask knows the argument by its name."""
    return {**_wanted(), "threads": str(dask_worker.state.nthreads)}


def check_equal(environment: Mapping[str, str], wanted: Mapping[str, str], process: str) -> None:
    """Check that a process has the versions that are wanted, and one thread."""
    for name, version in wanted.items():
        there = environment.get(name, "missing")
        if there != version:
            raise InputError(
                f"{process}: {name} is {there} there and {version} here: install the same there"
            )
    if environment["threads"] != "1":
        raise InputError(
            f"{process}: has {environment['threads']} threads, which share their settings: start "
            "it with --nthreads 1, and --nworkers as many as it has cores"
        )


# --- What travels ---------------------------------------------------------------------------------


def _submitted(
    client: Client, work: Callable[..., Any], calls: Sequence[tuple[Any, ...]]
) -> list[Future]:
    """The calls, handed to the cluster under (a name of their own, their number)."""
    contents: dict[int, Future] = {}
    for first in {id(call[0]): call[0] for call in calls}.values():
        content = cloudpickle.dumps(first)
        key = f"frictionid-data-{sha256(content)}"
        contents[id(first)] = client.submit(_held, content, key=key)
    name, wanted = f"frictionid-calls-{uuid.uuid4().hex}", _wanted()
    return [
        client.submit(
            _called,
            wanted,
            contents[id(call[0])],
            cloudpickle.dumps((work, call[1:])),
            key=(name, i),
        )
        for i, call in enumerate(calls)
    ]


def _held(content: bytes) -> bytes:
    """A content, which the cluster holds from now on, and makes anew from here where it is lost."""
    return content


def _called(wanted: Mapping[str, str], content: bytes, call: bytes) -> bytes:
    """What a call gives, on a worker."""
    worker = get_worker()
    check_equal(_environment(worker), wanted, f"worker {worker.address}")
    work, others = pickle.loads(call)
    with threadpool_limits(1):
        one_torch_thread()
        return cloudpickle.dumps(work(_loaded(content), *others))


@lru_cache(maxsize=2)
def _loaded(content: bytes) -> Any:
    """What a content holds; a worker reads it once for many calls."""
    return pickle.loads(content)


@contextmanager
def _own_modules_by_value() -> Iterator[None]:
    """Let classes of modules that are no part of a package travel with their code."""
    modules = [module for name, module in list(sys.modules.items()) if _is_own(name, module)]
    for module in modules:
        cloudpickle.register_pickle_by_value(module)
    try:
        yield
    finally:
        for module in modules:
            cloudpickle.unregister_pickle_by_value(module)


def _is_own(name: str, module: Any) -> bool:
    """Whether a module is a user's file, which workers do not have."""
    top = name.partition(".")[0]
    is_file = bool(getattr(module, "__file__", None)) and top != "__main__"
    return is_file and top not in sys.stdlib_module_names and not is_installed(top)
