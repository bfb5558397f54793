"""Engines: who runs the tasks of a sweep. One code path; only the place differs."""

import logging
import multiprocessing
import os
import queue
import re
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from multiprocessing.connection import wait
from typing import Any, Protocol, TypeVar

from polhode.harness.common.worker import Failure, Reply, Worker
from polhode.solvers.contract import installed

# A task that takes its process with it this many times is given up.
ATTEMPTS = 3
# Tasks that wait for each worker: enough that none is ever idle, few enough to stop soon.
AHEAD = 2
CONNECT_SECONDS = 30
# Host and port as Dask reads them.
ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?(\[[0-9a-fA-F:.]+\]|[^\s:/\[\]]+):\d{1,5}")

T = TypeVar("T")
_NO_MORE = object()


@dataclass(frozen=True)
class Outcome:
    """What became of a task: its value, or else a message."""

    task: Any
    value: Any
    message: str = ""


class Engine(Protocol):
    """Runs a function on tasks and yields the outcomes in whatever order they come.

    1. The function belongs to a module and is pure; a task may be run more than once.
    2. Tasks are taken from their iterable one by one, as there is room for them.
    3. A worker that is killed costs its task a new attempt, not its place; after `ATTEMPTS` the outcome is a message.
    4. An exception of the function is a message, never the end of the run.
    5. Closing the iterator (Ctrl-C does) stops everything under way at once.
    """

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Outcome]:
        """Run the function on each task."""
        ...


class Serial:
    """One task after another in this very process."""

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Outcome]:
        """Run the function on each task."""
        for task in tasks:
            try:
                yield Outcome(task, function(task))
            except Exception as error:
                yield Outcome(task, None, f"{type(error).__name__}: {error}")


@dataclass(frozen=True)
class Processes:
    """Spawned processes on this machine, each with a thread here that feeds it; they end when this process does.

    Parameters
    ----------
    workers : int
        One per core; more gain nothing.
    max_seconds : float
        Limit of a task; a process that takes twice as long is killed.
    """

    workers: int
    max_seconds: float = 24 * 3600.0

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ValueError(f"workers: got {self.workers}, expected a whole number from 1 on")

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Outcome]:
        """Run the function on each task."""
        todo: queue.SimpleQueue[Any] = queue.SimpleQueue()
        results: queue.SimpleQueue[Outcome | Exception] = queue.SimpleQueue()
        stop = threading.Event()
        workers = [Worker() for _ in range(self.workers)]

        def feed(worker: Worker) -> None:
            with worker:
                while (task := todo.get()) is not _NO_MORE and not stop.is_set():
                    try:
                        results.put(self._attempt(worker, function, task, stop))
                    except Exception as error:
                        results.put(error)

        threads = [threading.Thread(target=feed, args=(worker,), daemon=True) for worker in workers]
        for thread in threads:
            thread.start()
        try:
            remaining, under_way = iter(tasks), 0
            while True:
                for task in _take(remaining, (1 + AHEAD) * self.workers - under_way):
                    todo.put(task)
                    under_way += 1
                if not under_way:
                    return
                result = results.get()
                under_way -= 1
                if isinstance(result, Exception):
                    raise result
                yield result
        finally:
            stop.set()
            for _ in workers:
                todo.put(_NO_MORE)
            for thread in threads:
                while thread.is_alive():
                    _kill(workers)
                    thread.join(timeout=0.1)

    def _attempt(self, worker: Worker, function: Callable[[Any], Any], task: Any, stop: threading.Event) -> Outcome:
        reply = Reply(None, Failure.CRASHED, "", 0.0)
        for _ in range(ATTEMPTS):
            try:
                reply = worker.run(_call, function, task, limit=self.max_seconds)
            except (EOFError, ConnectionError, TimeoutError) as error:
                worker.close()
                reply = Reply(None, Failure.CRASHED, f"no worker: {error}", 0.0)
            if stop.is_set() or reply.failure is not Failure.CRASHED:
                break
        return Outcome(task, reply.value, reply.message.strip().rpartition("\n")[2] if reply.failure else "")


def _call(function: Callable[[Any], Any], task: Any) -> Any:
    """Run a task in a worker, which does not outlive its parent: not even a task of hours, after a SIGKILL."""
    _end_with_parent()
    return function(task)


@cache
def _end_with_parent() -> None:
    def watch(parent: int) -> None:
        wait([parent])
        os._exit(1)

    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=watch, args=(parent.sentinel,), daemon=True).start()


def _kill(workers: list[Worker]) -> None:
    """Kill the processes; the threads that wait for them close what is left."""
    for worker in workers:
        with suppress(ValueError, AttributeError, ProcessLookupError):
            if worker.pid is not None:
                os.kill(worker.pid, signal.SIGKILL)


@dataclass(frozen=True)
class Dask:
    """Workers of a Dask scheduler, wherever they are; polhode is installed there in the same version.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://host:8786``.

    Raises
    ------
    ValueError
        If the address is none, or Dask is not installed.
    """

    address: str

    def __post_init__(self) -> None:
        if not ADDRESS.fullmatch(self.address):
            raise ValueError(f"dask: got {self.address!r}, expected an address such as tcp://host:8786")
        if not installed("distributed"):
            raise ValueError("dask: distributed is not installed: pip install 'polhode[dask]'")

    def check(self) -> None:
        """Connect and leave again.

        Raises
        ------
        ValueError
            If no scheduler answers.
        """
        try:
            with self._client():
                pass
        except (OSError, ValueError) as error:
            raise ValueError(f"dask: got {self.address}, expected a scheduler that runs: {error}") from None

    @contextmanager
    def _client(self) -> Iterator[Any]:
        """A connection; what goes wrong with it is raised, and not logged besides."""
        distributed = import_module("distributed")
        levels = {name: logging.getLogger(name).level for name in ("distributed", "distributed.client")}
        for name in levels:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            with distributed.Client(self.address, timeout=CONNECT_SECONDS, set_as_default=False) as client:
                yield client
        finally:
            for name, level in levels.items():
                logging.getLogger(name).setLevel(level)

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Outcome]:
        """Run the function on each task; `task.key` is Dask's key, so that two clients share what is under way."""
        distributed = import_module("distributed")
        with self._client() as client:
            remaining, tasks_of = iter(tasks), {}
            pending = distributed.as_completed(loop=client.loop)
            try:
                while True:
                    room = _room(client) - pending.count()
                    for task in _take(remaining, room):
                        future = client.submit(function, task, key=f"polhode-{task.key}", pure=True)
                        tasks_of[future.key] = task, future
                        pending.add(future)
                    if not tasks_of:
                        return
                    future = next(pending)
                    task, _ = tasks_of.pop(future.key)
                    if future.status == "finished":
                        yield Outcome(task, future.result())
                    else:
                        error = future.exception() if future.status == "error" else None
                        yield Outcome(task, None, f"{type(error).__name__}: {error}" if error else future.status)
            finally:
                client.cancel([future for _, future in tasks_of.values()])


def _room(client: Any) -> int:
    """Number of tasks to keep with the scheduler; workers come and go."""
    threads = sum(client.nthreads().values())
    return (1 + AHEAD) * max(1, threads)


def _take(remaining: Iterator[T], most: int) -> Iterator[T]:
    for _ in range(most):
        task = next(remaining, None)
        if task is None:
            return
        yield task
