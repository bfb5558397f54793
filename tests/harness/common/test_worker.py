"""The worker process, against hangs and crashes that are real."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from oracle.hang import die_once, of_two_arguments, sleep_holding_the_lock
from polhode.harness.common.worker import GRACE, Failure, Worker


@pytest.fixture(scope="module")
def worker():
    with Worker() as shared:
        yield shared


def _pid_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_worker_stopped_before_it_starts_runs_nothing():
    worker = Worker()
    worker.stop()
    assert (worker.run(os.getpid, limit=10.0).failure, worker.pid) == (Failure.LOST, None)


def test_a_worker_stopped_while_it_starts_runs_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    """Ctrl-C may come between the request of a process and the process."""
    start = Worker._start

    def stopped_first(self: Worker):
        self.stop()
        return start(self)

    monkeypatch.setattr(Worker, "_start", stopped_first)
    with Worker() as worker:
        reply = worker.run(os.mkdir, tmp_path / "made", limit=10.0)
        assert (reply.failure, worker.pid) == (Failure.LOST, None)
    assert not list(tmp_path.iterdir())


def test_a_value_that_cannot_be_read_is_a_reply(worker: Worker):
    reply = worker.run(of_two_arguments, limit=10.0)
    assert reply.failure is Failure.RAISED
    assert "TypeError" in reply.message
    assert worker.run(os.getpid, limit=10.0).failure is None


@pytest.mark.parametrize("limit", [10.0, 1e7])
def test_returns_values_and_stays(worker: Worker, limit: float):
    first = worker.run(os.getpid, limit=limit)
    assert first.failure is None
    assert first.value == worker.pid != os.getpid()
    assert worker.run(os.getpid, limit=10.0).value == first.value
    large = worker.run(np.arange, 1_000_000, limit=10.0)
    assert large.value.sum() == 499_999_500_000


def test_an_exception_is_data(worker: Worker):
    pid = worker.run(os.getpid, limit=10.0).value
    reply = worker.run(int, "many", limit=10.0)
    assert reply.failure is Failure.RAISED
    assert reply.value is None
    assert "ValueError: invalid literal for int()" in reply.message
    assert worker.run(os.getpid, limit=10.0).value == pid


@pytest.mark.parametrize("hang", [sleep_holding_the_lock, time.sleep])
def test_a_hang_is_killed_at_twice_the_limit(worker: Worker, hang):
    pid = worker.run(os.getpid, limit=10.0).value
    began = time.perf_counter()
    reply = worker.run(hang, 60, limit=0.1)
    assert reply.failure is Failure.KILLED
    assert 0.2 + GRACE <= time.perf_counter() - began < 5.0
    assert not _pid_alive(pid)
    assert worker.run(os.getpid, limit=10.0).value != pid


def test_a_slow_run_within_the_grace_is_not_killed(worker: Worker):
    assert worker.run(time.sleep, 0.3, limit=0.1).failure is None


@pytest.mark.parametrize(
    ("crash", "arguments", "cause"),
    [
        (os.abort, (), "SIGABRT"),
        (ctypes.string_at, (1,), "SIGSEGV"),
        (os._exit, (3,), "exit code 3"),
    ],
)
def test_a_crash_is_data(worker: Worker, crash, arguments, cause):
    reply = worker.run(crash, *arguments, limit=10.0)
    assert reply.failure is Failure.CRASHED
    assert cause in reply.message
    assert worker.run(abs, -1, limit=10.0).value == 1


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_call_killed_from_outside_is_tried_again(worker: Worker, tmp_path: Path, number: int):
    assert worker.run(die_once, tmp_path / "mark", number, limit=10.0).value == "alive"


def test_a_call_killed_every_time_is_lost(worker: Worker):
    reply = worker.run(signal.raise_signal, signal.SIGKILL, limit=10.0)
    assert (reply.failure, reply.value) == (Failure.LOST, None)
    assert worker.run(abs, -1, limit=10.0).value == 1


def test_what_cannot_be_sent_is_data_or_refused_at_once(worker: Worker):
    reply = worker.run(open, os.devnull, limit=10.0)
    assert reply.failure is Failure.RAISED
    assert "cannot pickle" in reply.message
    with pytest.raises(Exception, match=r"lambda|local object"):
        worker.run(lambda: 1, limit=10.0)
    assert worker.run(abs, -1, limit=10.0).value == 1


def test_nothing_is_printed_from_c(tmp_path):
    program = """
import os
from polhode.harness.common.worker import Worker
if __name__ == "__main__":
    with Worker() as worker:
        for stream in (1, 2):
            worker.run(os.write, stream, b"noise", limit=10.0)
        print("end")
"""
    script = tmp_path / "script.py"
    script.write_text(program)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("end\n", "")


def test_a_process_that_could_not_be_started_is_closed(monkeypatch: pytest.MonkeyPatch):
    worker = Worker()
    with monkeypatch.context() as patch:
        patch.setattr("multiprocessing.context.SpawnProcess.start", _no_room)
        with pytest.raises(OSError, match="no room for a process"):
            worker.run(abs, -1, limit=10.0)
    assert worker.pid is None
    with worker:
        assert worker.run(abs, -1, limit=10.0).value == 1


def _no_room(process: object) -> None:
    raise OSError("no room for a process")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_the_worker_ends_with_its_parent(tmp_path, number: int):
    program = """
import sys, time
from polhode.harness.common.worker import Worker
if __name__ == "__main__":
    with Worker() as worker:
        worker.run(abs, -1, limit=10.0)
        print(worker.pid, flush=True)
        worker.run(time.sleep, 60, limit=60.0)
"""
    script = tmp_path / "script.py"
    script.write_text(program)
    process = subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    pid = int(process.stdout.readline())
    time.sleep(0.2)
    process.send_signal(number)
    _, errors = process.communicate(timeout=20)
    assert process.returncode != 0
    assert number == signal.SIGKILL or "KeyboardInterrupt" in errors
    until = time.monotonic() + 5
    while _pid_alive(pid) and time.monotonic() < until:
        time.sleep(0.01)
    assert not _pid_alive(pid)
