"""Trials on a dask cluster: worker processes on this machine, or on any number of others.

What goes over the wire are pickles of trials and of their records: the machines of a cluster have to trust each other.
Files are written by the client alone, so workers need no disk in common with it.
"""

from __future__ import annotations

import asyncio
import queue
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from itertools import islice
from typing import TYPE_CHECKING, Any, Self

from chilopod.errors import ClusterError, one_line
from chilopod.trials.dask_client import connected
from chilopod.trials.executors import Pace
from chilopod.trials.on_worker import packed, unpacked, walked_there

if TYPE_CHECKING:
    import xarray as xr

    from chilopod.trials.trial import Trial

_SHARES = 8  # batches that a worker gets of a study, at least, so that all are done at about the same time
_AHEAD = 2  # batches a worker has, with that which it walks
_LOOK = 1.0  # s between two looks at a cluster from which nothing comes
_ANSWER = 10.0  # s until a scheduler has to answer
_ALONE = 60.0  # s that a cluster may have no worker
_MOST_SEEDS = 8  # that an error names


class Cluster:
    """An executor: batches walk on the workers of a dask cluster, each on all threads of one.

    A worker that is killed is replaced, if it has a nanny, and its batch walked again; a batch that kills its worker
    again and again is an error once all others are done.

    Parameters
    ----------
    where
        The address of a scheduler, such as ``tcp://10.0.0.1:8786``; or how many worker processes to start on this
        machine.
    threads
        Threads of each worker process that is started here; by default its share of the cores.

    Raises
    ------
    ExtraError
        If dask is not installed.
    ClusterError
        If it is not there, has no workers, or has another Python, chilopod, numpy or numba.
    ParameterError
        If there cannot be so many workers.
    """

    def __init__(self, where: str | int, threads: int | None = None) -> None:
        self._where = where
        self._stack, self._pace = ExitStack(), Pace()
        try:
            self._client: Any = connected(where, threads, self._stack)
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
        """How many there were when it was last looked at."""
        return len(self._threads)

    @property
    def words(self) -> str:
        """How many workers."""
        return f", {self.workers} worker{'s' * (self.workers != 1)}"

    def cut(self, batches: Sequence[list[Trial]]) -> Iterator[list[Trial]]:
        """In even pieces, so small that every worker gets several and is done with one in seconds, and not smaller than
        a worker has threads."""
        threads = max(self._threads, default=1)
        trials = sum(len(batch) for batch in batches)
        largest = -(-trials // (_SHARES * max(self.workers, 1)))
        for batch in batches:
            size = -(-len(batch) // -(-len(batch) // largest))
            size = -(-size // threads) * threads
            for i in range(0, len(batch), size):
                yield from self._pace.pieces(batch[i : i + size], threads)

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """The number of a batch and its records, as they come; a batch is taken when it is sent.

        Raises
        ------
        ClusterError
            If the cluster goes away or has no worker for a minute, or workers have other versions; or, when all else
            is done, for batches that kill their workers.
        ParameterError
            If a controller's class cannot be imported on a worker.
        """
        suspects: list[tuple[int, Sequence[Trial]]] = []
        yield from self._walk(enumerate(batches), suspects)
        # Dask blames all that a killed worker was given. What is killed alone, too, kills.
        guilty: list[tuple[int, Sequence[Trial]]] = []
        for suspect in suspects:
            yield from self._walk([suspect], guilty)
        if guilty:
            which = "; ".join(_named(batch) for _, batch in guilty)
            raise self._error(f"these kill their worker again and again, all others are done: {which}")

    def _walk(
        self, batches: Iterable[tuple[int, Sequence[Trial]]], killed: list[tuple[int, Sequence[Trial]]]
    ) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """Batches with their numbers; those that were given up go into ``killed``."""
        from distributed import KilledWorker

        arrived: queue.SimpleQueue[tuple[int, bytes | BaseException]] = queue.SimpleQueue()
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
            # What nobody waits for any more does not walk. (Cancelling what fetches it would leave tasks of dask's
            # alone with their exceptions, of which asyncio complains.)
            for _, future in under_way.values():
                future.release()

    def _sent(
        self, index: int, batch: Sequence[Trial], arrived: queue.SimpleQueue[tuple[int, bytes | BaseException]]
    ) -> Any:
        """Give a batch to the cluster, and see to it that its answer is fetched as soon as it is there; its future."""
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

    def _next(self, arrived: queue.SimpleQueue[tuple[int, bytes | BaseException]]) -> tuple[int, bytes | BaseException]:
        """The next answer, from a cluster that is there."""
        self._seen = time.monotonic()
        while True:
            with suppress(queue.Empty):
                return arrived.get(timeout=_LOOK)
            self._look()

    def _look(self) -> None:
        """See whether the scheduler is there, and its workers."""
        try:
            threads = self._client.sync(self._client.scheduler.ncores, callback_timeout=_ANSWER)
        except Exception as error:
            raise self._in_words(error) from None
        now = time.monotonic()
        self._threads = list(threads.values())
        if self._threads:
            self._seen = now
        elif now - self._seen > _ALONE:
            raise self._error(f"has had no workers for {_ALONE:.0f} s; what is kept in a folder goes on from here")

    def _in_words(self, error: BaseException) -> ClusterError:
        """An error of dask's own."""
        kinds = (OSError, TimeoutError, asyncio.CancelledError)
        gone = self._client.status != "running" or isinstance(error, kinds) or "Cancelled" in type(error).__name__
        if gone:
            return self._error("the scheduler went away; what is kept in a folder goes on from here")
        return self._error(one_line(f"{type(error).__name__}: {error}"))

    def _error(self, problem: str) -> ClusterError:
        return ClusterError(problem, field="cluster", value=self._where)


def _named(batch: Sequence[Trial]) -> str:
    """A batch in a few words."""
    first = batch[0]
    seeds = [str(trial.seed) for trial in batch[:_MOST_SEEDS]] + ["..."] * (len(batch) > _MOST_SEEDS)
    return f"{first.engine}, {first.robot.name}, {first.duration:g} s, seeds {', '.join(seeds)}"
