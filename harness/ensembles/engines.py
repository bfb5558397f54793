"""Engines: who runs the tasks of a sweep. One code path; only the place differs."""

import logging
import re
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent import futures
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from itertools import islice
from queue import SimpleQueue
from time import sleep
from typing import Any, NamedTuple

from polhode.harness.common.worker import Failure, Reply, Worker
from polhode.models.libraries import how_to_install, installed

# Tasks that wait for each worker. An estimate: one is enough that no worker is idle if tasks last alike; more
# are taken from other runs that share the store.
AHEAD = 2
# Seconds that a Dask scheduler has to answer. An estimate: in a network it takes far less than one.
CONNECT_SECONDS = 30
# Seconds between two attempts to kill processes that are starting. An estimate: a run may end later by this.
_STOP_EVERY = 0.1
# Seconds that a task should take at most: a process that takes twice as long is killed. An estimate: tasks last
# seconds to minutes.
_TASK_SECONDS = 24 * 3600.0
# Dask's words for a task that runs, or is to run again.
_UNDER_WAY = ("pending", "lost")
# Host and port as Dask reads them; a port has at most five digits.
_ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?(\[[0-9a-fA-F:.]+\]|[^\s:/\[\]]+):\d{1,5}")


class Finished(NamedTuple):
    """Outcome of a task: its value, or else a message."""

    task: Any
    value: Any
    message: str = ""


Engine = Callable[[Callable[[Any], Any], Iterable[Any]], Generator[Finished, None, None]]
"""Runs a function on tasks and yields the outcomes in whatever order they come.

1. The function belongs to a module and is pure; a task may be run more than once.
2. Tasks are taken from their iterable one by one, as there is room for them.
3. A worker that something kills costs its task a new attempt, not its place. After `worker.ATTEMPTS` of them, by
   Dask after as many as its `allowed-failures` lets, the outcome is a message. So it is at once if the task hung.
4. An exception of the function is a message, never the end of the run.
5. Closing the generator (Ctrl-C does) stops processes at once; of Dask, tasks that no worker has begun.
"""


def serial(function: Callable[[Any], Any], tasks: Iterable[Any]) -> Generator[Finished, None, None]:
    """One task after another in this very process."""
    for task in tasks:
        try:
            yield Finished(task, function(task))
        except Exception as error:
            yield Finished(task, None, f"{type(error).__name__}: {error}")


def processes(
    count: int,
    function: Callable[[Any], Any],
    tasks: Iterable[Any],
    max_seconds: float = _TASK_SECONDS,
    ahead: int = AHEAD,
) -> Generator[Finished, None, None]:
    """`count` spawned processes on this machine, each fed by a thread here; they end when this process does.

    More processes than cores gain nothing. A process that takes twice `max_seconds` for a task is killed.
    `ahead` tasks wait for each process. With 0 a task is taken when a process is free for it.
    """
    workers = [Worker() for _ in range(count)]
    idle: SimpleQueue[Worker] = SimpleQueue()
    for worker in workers:
        idle.put(worker)

    def attempt(task: Any) -> Finished:
        # There is a thread for each worker: when a thread begins a task, a worker is idle.
        worker = idle.get()
        try:
            reply = worker.run(function, task, limit=max_seconds)
        except TimeoutError as error:
            reply = Reply(None, Failure.LOST, f"no worker: {error}", 0.0)
        finally:
            idle.put(worker)
        if not reply.failure:
            return Finished(task, reply.value)
        # The last line of a traceback says what was raised.
        return Finished(task, reply.value, reply.message.strip().rpartition("\n")[2])

    threads = ThreadPoolExecutor(count)
    remaining = iter(tasks)
    pending = set()
    try:
        while True:
            room = (1 + ahead) * count - len(pending)
            pending |= {threads.submit(attempt, task) for task in islice(remaining, room)}
            if not pending:
                return
            done, pending = futures.wait(pending, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        _stop(workers)
        # A process that was just starting is killed once it is there.
        while idle.qsize() < count:
            sleep(_STOP_EVERY)
            _stop(workers)
        for worker in workers:
            worker.close()


def _stop(workers: Iterable[Worker]) -> None:
    """Kill their processes; they begin no further call."""
    for worker in workers:
        worker.stop()


def check_dask(address: str) -> None:
    """Raise ValueError unless a Dask scheduler answers at an address such as ``tcp://host:8786``."""
    if not _ADDRESS.fullmatch(address):
        raise ValueError(f"dask: got {address!r}, expected an address such as tcp://host:8786")
    if not installed("distributed"):
        raise ValueError(f"dask: {how_to_install('distributed')}")
    try:
        with _client(address):
            pass
    except (OSError, ValueError) as error:
        raise ValueError(f"dask: got {address}, expected a scheduler that runs: {error}") from None


@contextmanager
def _client(address: str) -> Iterator[Any]:
    """A connection to a scheduler; an error is raised, and not logged besides."""
    distributed = import_module("distributed")
    logging.disable(logging.CRITICAL)
    try:
        with distributed.Client(address, timeout=CONNECT_SECONDS, set_as_default=False) as client:
            yield client
    finally:
        logging.disable(logging.NOTSET)


def dask(
    address: str, function: Callable[[Any], Any], tasks: Iterable[Any]
) -> Generator[Finished, None, None]:
    """Workers of a Dask scheduler at an address, with polhode in the same version.

    Tasks have a `key`, which is Dask's too, so that two clients share what is under way.
    """
    with _client(address) as client:
        remaining = iter(tasks)
        tasks_of = {}
        pending = import_module("distributed").as_completed(loop=client.loop)
        try:
            while True:
                # Workers come and go: the room is counted anew each time. While there is none, as for one.
                room = (1 + AHEAD) * max(1, sum(client.nthreads().values())) - pending.count()
                for task in islice(remaining, max(0, room)):
                    future = client.submit(function, task, key=f"polhode-{task.key}", pure=True)
                    tasks_of[future.key] = task, future
                    pending.add(future)
                if not tasks_of:
                    return
                future = next(pending)
                if future.status in _UNDER_WAY:
                    # The worker with its result was lost after it had finished: Dask runs it again.
                    pending.add(future)
                    continue
                task, _ = tasks_of.pop(future.key)
                if future.status == "finished":
                    yield Finished(task, future.result())
                else:
                    error = future.exception() if future.status == "error" else None
                    yield Finished(
                        task, None, f"{type(error).__name__}: {error}" if error else future.status
                    )
        finally:
            client.cancel([future for _, future in tasks_of.values()])
