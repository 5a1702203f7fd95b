"""Getting at a dask cluster, one that is there or one of this machine's own, with its noise turned off."""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from typing import Any

from chilopod.errors import ClusterError, ParameterError, one_line
from chilopod.extras import needs
from chilopod.process import on_leave
from chilopod.trials.on_worker import PACKAGES, check_versions, versions

MOST = 1000  # worker processes of one machine
_CONNECT = 4.0  # s until a scheduler has to answer
_START = 60.0  # s until workers of our own have to be there
_STOP = 1.0  # s that workers of our own have to finish by themselves
_LOGGERS = ("distributed", "tornado", "asyncio")
_BLAS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_SETTINGS = {
    "distributed.comm.timeouts.connect": f"{_CONNECT:g}s",
    # What dask would put there it puts into this process's environment too.
    "distributed.nanny.pre-spawn-environ": {},
    # Of our own scheduler: deaths of its worker until a batch is given back, to be tried alone.
    "distributed.scheduler.allowed-failures": 1,
    # On a busy machine a worker takes its time to be there again; dask would give its place up.
    "distributed.deploy.lost-worker-timeout": "1h",
}


def connected(where: str | int, threads: int | None, stack: ExitStack) -> Any:
    """A ``distributed.Client`` of a cluster; leaving the stack closes all that was opened for it.

    Raises
    ------
    ExtraError
        If dask is not installed.
    ClusterError
        If there is no such cluster, or it is of other versions.
    ParameterError
        If ``where`` is neither an address nor a number of workers.
    """
    if isinstance(where, int) and not 1 <= where <= MOST:
        raise ParameterError("is no number of workers", field="cluster", value=where, allowed=f"1 to {MOST}")
    needs("distributed", extra="cluster")
    import dask
    import distributed

    stack.enter_context(_quiet())
    stack.enter_context(dask.config.set(_SETTINGS))
    if isinstance(where, int):
        needs("cryptography", extra="cluster")
        folder = tempfile.TemporaryDirectory(prefix="chilopod-cluster-", ignore_cleanup_errors=True)
        on_leave.append(folder.cleanup)
        stack.callback(on_leave.remove, folder.cleanup)
        # Of the scheduler, which has no argument for it.
        stack.enter_context(dask.config.set({"temporary-directory": stack.enter_context(folder)}))
        return _own(where, threads or max(1, usable_cores() // where), distributed, stack)
    return _there(where, distributed, stack)


def usable_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _there(address: str, distributed: Any, stack: ExitStack) -> Any:
    """A client of a cluster that somebody started."""

    async def asked() -> None:
        secrets = distributed.Security().get_connection_args("client")
        async with distributed.rpc(address, connection_args=secrets, timeout=_CONNECT) as scheduler:
            if (await asyncio.wait_for(scheduler.identity(), _CONNECT))["type"] != "Scheduler":
                raise ValueError("is a worker, no scheduler")

    try:
        # A client that cannot be made leaves a loop, a thread and a traceback behind, so somebody else knocks first; in
        # a thread, because a notebook has a loop in this one.
        with ThreadPoolExecutor(1) as knocking:
            knocking.submit(asyncio.run, asked()).result()
    except Exception as error:  # OSError, ValueError of an address, whatever comes of bytes that are not dask's
        reason = "does not answer" if isinstance(error, OSError) else f"is none ({type(error).__name__}: {error})"
        raise ClusterError(
            one_line(reason), field="cluster", value=address, allowed="the address of a dask scheduler"
        ) from None
    client = distributed.Client(address, timeout=_CONNECT, set_as_default=False)
    stack.callback(_closed, client)
    try:
        if not client.nthreads():
            raise ClusterError("has no workers", field="cluster", value=address)
        _check(client, address)
    except ClusterError:
        raise
    except Exception as error:  # what a scheduler answers that is no scheduler, or goes away now
        problem = f"cannot be used: {type(error).__name__}: {error}"
        raise ClusterError(one_line(problem), field="cluster", value=address) from error
    return client


def _check(client: Any, address: str) -> None:
    """Make sure that all workers have the versions that are here."""
    python = "{}.{}".format(*sys.version_info)
    # First what dask tells of itself, for which the worker needs nothing of ours.
    for place, told in client.get_versions(packages=PACKAGES)["workers"].items():
        # Older versions of dask read __version__, which names the checkout too; the digest below says more.
        there = {name: (found or "none").partition("+")[0] for name, found in told["packages"].items()}
        there["python"] = ".".join(there["python"].split(".")[:2])
        here = {"python": python, **versions(PACKAGES)}
        check_versions({name: here[name] for name in ("python", *PACKAGES)}, there, f"{address}, {place}")
    for place, there in client.run(versions, PACKAGES).items():
        check_versions(versions(PACKAGES), there, f"{address}, {place}")


def _own(workers: int, threads: int, distributed: Any, stack: ExitStack) -> Any:
    """A client of worker processes on this machine, which die with it."""
    # Ctrl-C goes to all processes of the terminal; workers inherit from the thread that starts them, which is made
    # here, that it is not for them. (Whoever starts Python's resource tracker is told to listen again.)
    if sys.platform != "win32":
        resource_tracker.ensure_running()
    others = multiprocessing.active_children()
    with _without_interrupts():
        cluster = distributed.LocalCluster(
            n_workers=0,
            threads_per_worker=threads,
            host="127.0.0.1",
            # Whoever reaches a scheduler runs code as its user: this one talks to those alone that have its keys.
            security=distributed.Security.temporary(),
            # Its server of figures on itself stays, without the dashboard, but on no port that others want.
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
            silence_logs=logging.CRITICAL,
            memory_limit=None,
            env=dict.fromkeys(("NUMBA_NUM_THREADS", *_BLAS), str(threads)),
            preload=["chilopod.trials.on_worker"],
        )
    stack.callback(_stopped, cluster, others)
    client = distributed.Client(cluster, timeout=_START, set_as_default=False, direct_to_workers=True)
    stack.callback(_closed, client)
    cluster.scale(workers)
    try:
        client.wait_for_workers(workers, timeout=_START)
    except TimeoutError:
        raise ClusterError(
            "worker processes do not start; a script has to make its cluster under `if __name__ == '__main__':`",
            field="cluster",
            value=workers,
        ) from None
    return client


def _closed(client: Any) -> None:
    with suppress(Exception):  # there may be nothing left to say goodbye to
        client.close(timeout=_STOP)


def _stopped(cluster: Any, others: Sequence[BaseProcess]) -> None:
    """Stop workers, those too that walk or have just been started; left to itself dask waits for them. What ``others``
    started goes on."""

    async def stop() -> None:
        nannies = list(cluster.workers.values())
        await asyncio.gather(*(nanny.close(timeout=_STOP) for nanny in nannies), return_exceptions=True)

    with suppress(Exception):
        cluster.sync(stop)
    for child in set(multiprocessing.active_children()) - set(others):
        child.kill()
    with suppress(Exception):
        cluster.close(timeout=_STOP)
    # When Python ends dask would try again for ten seconds, and tell of processes whose end it has not noticed.
    cluster.shutdown_on_close = False
    logging.getLogger("distributed.process").setLevel(logging.CRITICAL + 1)


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence of dask and what it stands on: what they would log is said in one line, by us."""
    loggers = [logging.getLogger(name) for name in _LOGGERS]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextmanager
def _without_interrupts() -> Iterator[None]:
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
