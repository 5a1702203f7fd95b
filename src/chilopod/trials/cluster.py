"""Trials on a dask cluster: worker processes on this machine, or on any number of others.

Trials and records travel as pickles, so the machines of a cluster must trust each other. Only the client writes files,
so workers need no disk in common with it.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import queue
import signal
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from itertools import islice
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING, Any, Self

from chilopod.cores import cores
from chilopod.errors import ClusterError, ParameterError, in_words
from chilopod.extras import needs
from chilopod.process import on_leave
from chilopod.trials.batch import Pace
from chilopod.trials.on_worker import PACKAGES, check_versions, packed, unpacked, versions, walked_there

if TYPE_CHECKING:
    import xarray as xr

    from chilopod.trials.trial import Trial

_Answers = queue.SimpleQueue[tuple[int, bytes | BaseException]]
_SHARES = 8  # batches that a worker gets of a study, at least, so that all are done at about the same time
_AHEAD = 2  # batches a worker has, with that which it walks
_LOOK = 1.0  # s between two looks at a cluster from which nothing comes
_ANSWER = 10.0  # s until a scheduler has to answer
_ALONE = 60.0  # s that a cluster may have no worker
_MOST_SEEDS = 8  # that an error names
_MOST = 1000  # worker processes of one machine
_CONNECT = 4.0  # s until a scheduler has to answer
_START = 60.0  # s until workers of our own have to be there
_STOP = 1.0  # s that workers of our own have to finish by themselves
_LOGGERS = ("distributed", "tornado", "asyncio")
_BLAS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_SETTINGS = {
    "distributed.comm.timeouts.connect": f"{_CONNECT:g}s",
    # What dask would put there it puts into this process's environment too.
    "distributed.nanny.pre-spawn-environ": {},
    # Own scheduler: deaths of a batch's worker before the batch is returned, to be tried alone.
    "distributed.scheduler.allowed-failures": 1,
    # On a busy machine a worker restarts slowly; dask would give it up.
    "distributed.deploy.lost-worker-timeout": "1h",
}


class Cluster:
    """Executor that walks batches on the workers of a dask cluster, each on all threads of one worker.

    A killed worker is replaced, if it has a nanny, and its batch runs again; a batch that kills its worker repeatedly
    is an error after all others are done.

    A cluster is the address of a scheduler, such as ``tcp://10.0.0.1:8786``; or the number of worker processes to start
    on this machine, and the threads of each, by default its share of the cores. Raises ExtraError, ParameterError or
    ClusterError if dask is not installed, the number of workers is out of range, or the cluster does not answer, has no
    workers, or has another version of Python, chilopod, numpy or numba.
    """

    def __init__(self, where: str | int, threads: int | None = None) -> None:
        self._where = where
        self._stack, self._pace = ExitStack(), Pace()
        try:
            self._client: Any = _connected(where, threads, self._stack)
            self._seen = time.monotonic()
            self._threads: list[int] = list(self._client.nthreads().values())
        except BaseException:
            self._stack.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the cluster; worker processes that were started for it end."""
        self._stack.close()

    @property
    def workers(self) -> int:
        """Number of workers at the last check."""
        return len(self._threads)

    @property
    def words(self) -> str:
        """Number of workers in words."""
        return f", {self.workers} worker{'s' * (self.workers != 1)}"

    def cut(self, batches: Sequence[list[Trial]]) -> Iterator[list[Trial]]:
        """Cut batches into even pieces: several for every worker, each with seconds of work for all its threads."""
        threads = max(self._threads, default=1)
        trials = sum(len(batch) for batch in batches)
        largest = -(-trials // (_SHARES * max(self.workers, 1)))
        for batch in batches:
            size = -(-len(batch) // -(-len(batch) // largest))
            size = -(-size // threads) * threads
            for i in range(0, len(batch), size):
                yield from self._pace.pieces(batch[i : i + size], threads)

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """Yield the number of a batch and its records as they arrive; a batch is taken when it is sent. Raises
        ClusterError if the cluster goes away or has no worker for a minute, if workers have other versions and, when
        all else is done, for batches that kill their workers; ParameterError if workers cannot import a controller."""
        suspects: list[tuple[int, Sequence[Trial]]] = []
        yield from self._walk(enumerate(batches), suspects)
        # Dask blames every batch of a killed worker. A batch that also fails alone is the cause.
        guilty: list[tuple[int, Sequence[Trial]]] = []
        for suspect in suspects:
            yield from self._walk([suspect], guilty)
        if guilty:
            which = "; ".join(_named(batch) for _, batch in guilty)
            raise self._error(f"these batches kill their worker repeatedly, all others are done: {which}")

    def _walk(
        self, batches: Iterable[tuple[int, Sequence[Trial]]], killed: list[tuple[int, Sequence[Trial]]]
    ) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """Yield batches with their numbers; abandoned ones go into ``killed``."""
        from distributed import KilledWorker

        arrived: _Answers = queue.SimpleQueue()
        under_way: dict[int, tuple[Sequence[Trial], Any]] = {}
        waiting = iter(batches)
        try:
            while True:
                for index, batch in islice(waiting, max(_AHEAD * max(self.workers, 1) - len(under_way), 0)):
                    under_way[index] = batch, self._sent(index, batch, arrived)
                if not under_way:
                    return
                index, answer = self._next(arrived)
                batch, _ = under_way.pop(index)
                if isinstance(answer, KilledWorker):
                    killed.append((index, batch))
                elif isinstance(answer, BaseException):
                    raise self._in_words(answer)
                else:
                    records, seconds = unpacked(answer)
                    self._pace.took(batch, max(self._threads, default=1), seconds)
                    yield index, records
        finally:
            # Cancel batches whose result is no longer needed. (Cancelling the fetch itself would leave tasks of dask's
            # alone with their exceptions, of which asyncio complains.)
            for _, future in under_way.values():
                future.release()

    def _sent(self, index: int, batch: Sequence[Trial], arrived: _Answers) -> Any:
        """Send a batch to the cluster and return its future, whose result is fetched as soon as it is ready."""
        client, job = self._client, packed(batch)
        try:
            future = client.submit(walked_there, job, str(self._where), pure=False)
        except Exception as error:  # a client that lost its scheduler
            raise self._in_words(error) from None

        async def fetch() -> None:
            answer: bytes | BaseException
            try:
                answer = await client.gather(future, asynchronous=True)
            except BaseException as error:  # CancelledError, where the scheduler is gone, is no Exception
                answer = error
            future.release()  # what is here need not stay there
            arrived.put((index, answer))

        asyncio.run_coroutine_threadsafe(fetch(), client.loop.asyncio_loop)
        return future

    def _next(self, arrived: _Answers) -> tuple[int, bytes | BaseException]:
        """Next answer of the cluster; ClusterError if it is lost."""
        self._seen = time.monotonic()
        while True:
            with suppress(queue.Empty):
                return arrived.get(timeout=_LOOK)
            self._look()

    def _look(self) -> None:
        """Check the scheduler and its workers."""
        try:
            threads = self._client.sync(self._client.scheduler.ncores, callback_timeout=_ANSWER)
        except Exception as error:
            raise self._in_words(error) from None
        now = time.monotonic()
        self._threads = list(threads.values())
        if self._threads:
            self._seen = now
        elif now - self._seen > _ALONE:
            raise self._error(f"has had no workers for {_ALONE:.0f} s; a kept study resumes from here")

    def _in_words(self, error: BaseException) -> ClusterError:
        """Message of an error of dask."""
        gone = isinstance(error, (OSError, TimeoutError, asyncio.CancelledError)) or "Cancelled" in type(error).__name__
        if gone or self._client.status != "running":
            return self._error("the scheduler was lost; a kept study resumes from here")
        return self._error(in_words(error))

    def _error(self, problem: str) -> ClusterError:
        return ClusterError(problem, field="cluster", value=self._where)


def _named(batch: Sequence[Trial]) -> str:
    """Description of a batch in a few words."""
    first = batch[0]
    seeds = [str(trial.seed) for trial in batch[:_MOST_SEEDS]] + ["..."] * (len(batch) > _MOST_SEEDS)
    return f"{first.engine}, {first.robot.name}, {first.duration:g} s, seeds {', '.join(seeds)}"


def _connected(where: str | int, threads: int | None, stack: ExitStack) -> Any:
    """Client (``distributed.Client``) of a cluster; the stack closes everything opened for it."""
    if isinstance(where, int) and not 1 <= where <= _MOST:
        raise ParameterError("must be a number of workers", field="cluster", value=where, allowed=f"1 to {_MOST}")
    needs("distributed", extra="cluster")
    import dask
    import distributed

    for name in _LOGGERS:  # chilopod reports their messages in one line
        logger = logging.getLogger(name)
        stack.callback(logger.setLevel, logger.level)
        logger.setLevel(logging.CRITICAL + 1)
    stack.enter_context(dask.config.set(_SETTINGS))
    if isinstance(where, int):
        needs("cryptography", extra="cluster")
        folder = tempfile.TemporaryDirectory(prefix="chilopod-cluster-", ignore_cleanup_errors=True)
        on_leave.append(folder.cleanup)
        stack.callback(on_leave.remove, folder.cleanup)
        # Of the scheduler, which has no argument for it.
        stack.enter_context(dask.config.set({"temporary-directory": stack.enter_context(folder)}))
        return _own(where, threads or max(1, cores() // where), distributed, stack)
    return _there(where, distributed, stack)


def _there(address: str, distributed: Any, stack: ExitStack) -> Any:
    """Client of a running cluster."""

    async def asked() -> None:
        secrets = distributed.Security().get_connection_args("client")
        async with distributed.rpc(address, connection_args=secrets, timeout=_CONNECT) as scheduler:
            if (await asyncio.wait_for(scheduler.identity(), _CONNECT))["type"] != "Scheduler":
                raise ValueError("is a worker, not a scheduler")

    try:
        # A client that fails leaves a loop, a thread and a traceback behind, so a probe connects first; in
        # a thread, because a notebook has a loop in this one.
        with ThreadPoolExecutor(1) as knocking:
            knocking.submit(asyncio.run, asked()).result()
    except Exception as error:  # OSError, ValueError of an address, any error from bytes that are not dask's
        other, allowed = f"must be a dask scheduler ({in_words(error)})", "the address of a dask scheduler"
        reason = "does not answer" if isinstance(error, OSError) else other
        raise ClusterError(reason, field="cluster", value=address, allowed=allowed) from None
    client = distributed.Client(address, timeout=_CONNECT, set_as_default=False)
    stack.callback(_closed, client)
    try:
        if not client.nthreads():
            raise ClusterError("must have at least one worker", field="cluster", value=address)
        for place, there in client.run(versions, PACKAGES).items():
            check_versions(versions(PACKAGES), there, f"{address}, {place}")
    except ClusterError:
        raise
    except Exception as error:  # the answer of something else, or a scheduler that is lost now
        raise ClusterError(f"cannot be used: {in_words(error)}", field="cluster", value=address) from error
    return client


def _own(workers: int, threads: int, distributed: Any, stack: ExitStack) -> Any:
    """Client of worker processes on this machine, which end with it."""
    # Ctrl-C goes to all processes of the terminal; workers inherit from the thread that starts them, which is made
    # here and blocks it. (Python's resource tracker unblocks it for the thread that starts the tracker.)
    if sys.platform != "win32":
        resource_tracker.ensure_running()
    others = multiprocessing.active_children()
    masks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masks else set()
    try:
        cluster = distributed.LocalCluster(
            n_workers=0,
            threads_per_worker=threads,
            host="127.0.0.1",
            # Access to a scheduler allows running code as its user: this one accepts only clients with its keys.
            security=distributed.Security.temporary(),
            # Its status server stays, without the dashboard, on a free port.
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
            silence_logs=logging.CRITICAL,
            memory_limit=None,
            env=dict.fromkeys(("NUMBA_NUM_THREADS", *_BLAS), str(threads)),
            preload=["chilopod.trials.on_worker"],
        )
    finally:
        if masks:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    stack.callback(_stopped, cluster, others)
    client = distributed.Client(cluster, timeout=_START, set_as_default=False, direct_to_workers=True)
    stack.callback(_closed, client)
    cluster.scale(workers)
    try:
        client.wait_for_workers(workers, timeout=_START)
    except TimeoutError:
        problem = "worker processes do not start; a script must create its cluster under `if __name__ == '__main__':`"
        raise ClusterError(problem, field="cluster", value=workers) from None
    return client


def _closed(client: Any) -> None:
    with suppress(Exception):  # the cluster may already be gone
        client.close(timeout=_STOP)


def _stopped(cluster: Any, others: Sequence[BaseProcess]) -> None:
    """Stop workers, even those that walk or have just started, for which dask would wait. Processes that ``others``
    started go on."""

    async def stop() -> None:
        nannies = list(cluster.workers.values())
        await asyncio.gather(*(nanny.close(timeout=_STOP) for nanny in nannies), return_exceptions=True)

    with suppress(Exception):
        cluster.sync(stop)
    for child in set(multiprocessing.active_children()) - set(others):
        child.kill()
    with suppress(Exception):
        cluster.close(timeout=_STOP)
    # At the end of Python dask would retry for ten seconds and report processes whose end it missed.
    cluster.shutdown_on_close = False
    logging.getLogger("distributed.process").setLevel(logging.CRITICAL + 1)
