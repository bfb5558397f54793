"""A spawned process that runs one function after another, and is killed and replaced when it hangs or crashes.

What the solvers' own deadlines cannot stop (a library that spins without calling back, a call that holds the
interpreter's lock) is stopped here. What libraries print from C, on either stream, goes nowhere.
"""

import multiprocessing
import os
import signal
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pickle import PicklingError
from time import perf_counter
from types import TracebackType
from typing import Any, Self

# Beyond twice the limit, in seconds: a run that stops by itself is not killed for a slow machine.
GRACE = 0.5
STARTUP = 120.0


class Failure(StrEnum):
    """How a call came to nothing."""

    KILLED = "killed"
    CRASHED = "crashed"
    RAISED = "raised"


@dataclass(frozen=True)
class Reply:
    """What became of a call.

    Parameters
    ----------
    value : object
        What the function returned; None if it did not.
    failure : Failure, optional
        None if it returned.
    message : str
        What happened instead: the limit, the signal, or the traceback.
    seconds : float
        Wall time of the call, sending and receiving included.
    """

    value: Any
    failure: Failure | None
    message: str
    seconds: float


class Worker:
    """One spawned process, started on first use and again after every kill or crash.

    It is spawned, not forked, since forked processes inherit the locks of threads that they do not inherit. Functions,
    arguments and results are pickled: functions belong to modules. A context manager; `close` ends the process.
    """

    def __init__(self) -> None:
        self._process: Any = None
        self._connection: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def pid(self) -> int | None:
        """Process id; None while there is no process."""
        return None if self._process is None else self._process.pid

    def run(self, function: Callable[..., Any], *arguments: Any, limit: float) -> Reply:
        """Call a function in the process.

        Parameters
        ----------
        function : callable
        *arguments : object
        limit : float
            Seconds within which the function means to stop by itself; it is killed at twice that and a little grace.

        Returns
        -------
        Reply
            Whatever happens, but for Ctrl-C, which kills the process, too.
        """
        connection = self._connection or self._start()
        began = perf_counter()
        try:
            connection.send((function, arguments))
            if not connection.poll(2 * limit + GRACE):
                self.close()
                seconds = perf_counter() - began
                return Reply(None, Failure.KILLED, f"killed after {seconds:.1f} s, limit {limit:g} s", seconds)
            value, message = connection.recv()
        except (EOFError, ConnectionError):
            return Reply(None, Failure.CRASHED, self._cause(), perf_counter() - began)
        except BaseException:
            self.close()
            raise
        return Reply(value, Failure.RAISED if message else None, message, perf_counter() - began)

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
        context = multiprocessing.get_context("spawn")
        connection, remote = context.Pipe()
        process = context.Process(target=_serve, args=(remote,), daemon=True)
        self._connection, self._process = connection, process
        try:
            process.start()
            remote.close()
            if not connection.poll(STARTUP):
                raise TimeoutError(f"worker: no sign of life after {STARTUP:g} s")
            connection.recv()
        except BaseException:
            remote.close()
            self.close()
            raise
        return connection

    def _cause(self) -> str:
        """How the process ended by itself."""
        self._process.join()
        code = self._process.exitcode
        self.close()
        return f"crashed with {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


def _serve(connection: Any) -> None:
    """Receive calls and send back ``(value, "")`` or ``(None, traceback)``, for ever."""
    # Ctrl-C reaches every process of a terminal; the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    silence = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(silence, stream)
    connection.send("ready")
    while True:
        try:
            function, arguments = connection.recv()
        except EOFError:
            return
        except Exception:
            connection.send((None, traceback.format_exc()))
            continue
        try:
            reply = (function(*arguments), "")
        except Exception:
            reply = (None, traceback.format_exc())
        try:
            connection.send(reply)
        except (TypeError, AttributeError, ValueError, PicklingError):
            connection.send((None, traceback.format_exc()))
