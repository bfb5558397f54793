"""A spawned process that runs one function after another, and is killed and replaced when it hangs or crashes.

The worker stops calls that the solvers' own deadlines cannot stop: a library that spins without
calling back, a call that holds the interpreter's lock. Prints of libraries from C, on either
stream, go nowhere. It ends with its parent, and a call is tried again whose process something else killed,
such as a system without memory.
"""

import multiprocessing
import os
import pickle
import signal
import traceback
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from enum import StrEnum
from multiprocessing.connection import wait
from threading import Thread
from time import perf_counter
from typing import Any

# A call is killed after twice its limit and GRACE seconds more: a slow machine alone does not kill it.
# Both are estimates: less kills calls that would have ended, more lets a call that hangs take longer.
_LIMITS = 2  # In units of the call's limit.
GRACE = 0.5
# Seconds that a process may take to start; an estimate: imports from a slow disk take seconds.
_STARTUP = 120.0
# Longest wait for a reply, in seconds, some 23 days: the system call `poll` takes at most 2^31 ms, or 25 days.
_LONGEST = 2e6
# A call whose process is killed from outside this many times is given up. An estimate: more only make a
# machine without memory try longer.
ATTEMPTS = 3
# Signals that no library sends to itself.
_OUTSIDE = (signal.SIGKILL, signal.SIGTERM)


class Failure(StrEnum):
    """How a call came to nothing."""

    KILLED = "killed"  # by this module, after `_LIMITS` times its limit and GRACE
    CRASHED = "crashed"  # the process ended by itself, by an exit or a signal
    RAISED = "raised"  # an exception
    LOST = "lost"  # killed from outside, every time: says nothing about the function


class KilledFromOutsideError(RuntimeError):
    """Calls were lost, and are nothing to be written down."""


@dataclass(frozen=True)
class Reply:
    """The outcome of a call: its value, or how it failed and the limit, signal or traceback."""

    value: Any
    failure: Failure | None
    message: str
    seconds: float  # sending and receiving included


class Worker(AbstractContextManager["Worker"]):
    """One process, started on first use and again after every kill or crash; functions and arguments are pickled."""

    def __init__(self) -> None:
        self._process: Any = None
        self._connection: Any = None
        self._stopped = False

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def pid(self) -> int | None:
        """Process id; None while there is no process."""
        return None if self._process is None else self._process.pid

    def run(self, function: Callable[..., Any], *arguments: Any, limit: float) -> Reply:
        """Call a function in the process; it should stop by itself within `limit` seconds.

        Any failure of the call is a reply too. Raises KeyboardInterrupt on Ctrl-C, and TimeoutError or OSError if no
        process can be started.
        """
        reply = Reply(None, Failure.LOST, "stopped", 0.0)
        for _ in range(ATTEMPTS):
            if reply.failure is not Failure.LOST or self._stopped:
                break
            reply = self._once(function, arguments, limit)
        return reply

    def stop(self) -> None:
        """Kill the process from another thread, for good: a call under way is not tried again."""
        self._stopped = True
        # Meanwhile the other thread may run `close`: the process may be closed (ValueError), no longer be
        # there (AttributeError), or have ended.
        with suppress(ValueError, AttributeError, ProcessLookupError):
            if self.pid is not None:
                os.kill(self.pid, signal.SIGKILL)

    def _once(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], limit: float
    ) -> Reply:
        """One attempt at a call; a process that is started for it does not count to its time."""
        value = None
        failure = None
        began = perf_counter()
        try:
            connection = self._connection or self._start()
            if self._stopped:
                # `stop` came before there was a process to kill.
                self.close()
                return Reply(None, Failure.LOST, "stopped", 0.0)
            began = perf_counter()
            connection.send((function, arguments))
            if connection.poll(min(_LIMITS * limit + GRACE, _LONGEST)):
                value, message = _read(connection.recv_bytes())
                failure = Failure.RAISED if message else None
            else:
                self.close()
                failure = Failure.KILLED
                message = f"killed after {perf_counter() - began:.1f} s, limit {limit:g} s"
        except (EOFError, ConnectionError):
            failure, message = self._cause()
        except BaseException:
            self.close()
            raise
        return Reply(value, failure, message, perf_counter() - began)

    def close(self) -> None:
        """End the process."""
        if self._connection is not None:
            self._connection.close()
        if self._process is not None:
            # A process that could not be started has nothing to kill.
            if self._process.pid is not None:
                self._process.kill()
                self._process.join()
            self._process.close()
        self._process = self._connection = None

    def _start(self) -> Any:
        """Start a process, and return the connection to it once it has said that it is ready."""
        # Forked processes inherit the locks of threads that they do not inherit.
        context = multiprocessing.get_context("spawn")
        self._connection, remote = context.Pipe()
        self._process = context.Process(target=_serve, args=(remote,), daemon=True)
        with remote:
            self._process.start()
        if not self._connection.poll(_STARTUP):
            raise TimeoutError(f"worker: no sign of life after {_STARTUP:g} s")
        self._connection.recv()
        return self._connection

    def _cause(self) -> tuple[Failure, str]:
        """How the process ended by itself, or was ended."""
        self._process.join()
        # Minus the signal's number if a signal ended it.
        code = self._process.exitcode
        self.close()
        if code >= 0:
            return Failure.CRASHED, f"ended with exit code {code}"
        return (
            Failure.LOST if -code in _OUTSIDE else Failure.CRASHED,
            f"crashed with {signal.Signals(-code).name}",
        )


def _read(reply: bytes) -> tuple[Any, str]:
    """The value that a process sent, and a traceback: its own, or of a value that cannot be read on this side."""
    try:
        return pickle.loads(reply)
    except Exception:
        return None, traceback.format_exc()


def _end_with_parent() -> None:
    """Not even a task of hours outlives the parent, whatever ended it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _serve(connection: Any) -> None:
    """Receive calls and send back ``(value, "")`` or ``(None, traceback)``, for ever."""
    # Ctrl-C reaches every process of a terminal; the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    silence = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(silence, stream)
    Thread(target=_end_with_parent, daemon=True).start()
    connection.send("ready")
    while True:
        try:
            call = connection.recv_bytes()
        except EOFError:
            return
        try:
            function, arguments = pickle.loads(call)
            connection.send((function(*arguments), ""))
        except Exception:
            connection.send((None, traceback.format_exc()))
