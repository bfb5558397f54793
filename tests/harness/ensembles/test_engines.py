"""Engines against workers that die, hang and raise; Dask's against a real scheduler and two workers."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path

import pytest
from commandline import importing
from dasks import contact, dask_scheduler

from oracle.labour import Job, die_always, die_once, home, meet, refuse_odd, spin, square
from polhode import models
from polhode.harness.common.store import Store
from polhode.harness.ensembles.engines import AHEAD, Engine, check_dask, dask, processes, serial
from polhode.harness.ensembles.sweep import parse_sweep, run_sweep

two = partial(processes, 2)


@pytest.fixture(params=["serial", "processes", "dask"])
def engine(request: pytest.FixtureRequest) -> Engine:
    if request.param == "dask":
        return partial(dask, request.getfixturevalue("cluster")[0])
    return serial if request.param == "serial" else two


def values(engine: Engine, function, jobs) -> dict[int, object]:
    return {outcome.task.number: outcome.value for outcome in engine(function, jobs)}


def test_every_task_once(engine: Engine, tmp_path: Path):
    jobs = [Job(number, folder=tmp_path) for number in range(20)]
    assert values(engine, square, jobs) == {number: number**2 for number in range(20)}
    marks = [path.read_text().splitlines() for path in tmp_path.iterdir()]
    assert [len(mark) for mark in marks] == [1] * 20
    here = {str(os.getpid())}
    assert ({line for mark in marks for line in mark} == here) is (engine is serial)


def test_workers_run_the_very_code_that_is_tested(engine: Engine):
    assert values(engine, home, [Job(1)]) == {1: models.__file__}


def test_an_exception_is_a_message(engine: Engine):
    outcomes = list(engine(refuse_odd, [Job(100 + number) for number in range(6)]))
    assert sorted(outcome.message for outcome in outcomes if outcome.message) == [
        f"ValueError: job {number} is odd" for number in (101, 103, 105)
    ]
    assert sorted(outcome.value for outcome in outcomes if not outcome.message) == [
        10000,
        10404,
        10816,
    ]


def test_tasks_are_taken_as_there_is_room(engine: Engine):
    taken = []

    def jobs() -> Iterator[Job]:
        for number in range(200, 2000):
            taken.append(number)
            yield Job(number)

    run = engine(square, jobs())
    assert next(run).value is not None
    threads = 1 if engine is serial else 2 if engine is two else 8
    assert len(taken) <= (1 + AHEAD) * threads + 1
    run.close()


def test_two_processes_work_side_by_side(tmp_path: Path):
    """One alone would wait for the other task of each pair in vain."""
    jobs = [Job(number, folder=tmp_path) for number in range(8)]
    assert values(two, meet, jobs) == {number: number for number in range(8)}


def test_a_killed_process_costs_no_task(tmp_path: Path):
    jobs = [Job(number, folder=tmp_path) for number in range(10)]
    assert values(two, die_once, jobs) == {number: number**2 for number in range(10)}
    assert len(list(tmp_path.iterdir())) == 4


def test_a_task_that_always_kills_is_given_up():
    outcomes = {outcome.task.number: outcome for outcome in two(die_always, map(Job, range(4)))}
    assert outcomes[1].value is None
    assert outcomes[1].message == "crashed with SIGKILL"
    assert [outcomes[number].value for number in (0, 2, 3)] == [0, 4, 9]


def test_a_hanging_task_is_killed_at_twice_its_limit():
    (outcome,) = processes(1, square, [Job(1, seconds=60)], max_seconds=0.2)
    assert outcome.value is None
    assert outcome.message.startswith("killed after")


def test_closing_stops_at_once():
    run = two(square, [Job(0), Job(1, seconds=60), Job(2, seconds=60)])
    assert next(run).value == 0
    began = time.perf_counter()
    run.close()
    assert time.perf_counter() - began < 5


def test_processes_end_with_their_parent_even_in_a_long_task(tmp_path: Path):
    code = (
        "from pathlib import Path; from oracle.labour import Job, hold\n"
        "from polhode.harness.ensembles.engines import processes\n"
        "if __name__ == '__main__':\n"
        "    list(processes(1, hold, [Job(1, seconds=100, folder=Path('.'))]))\n"
    )
    (tmp_path / "parent.py").write_text(code)
    environment = importing(Path(__file__).parents[2])
    with subprocess.Popen([sys.executable, "parent.py"], cwd=tmp_path, env=environment) as parent:
        wait_until((tmp_path / "job-1").exists)
        worker = Path("/proc", (tmp_path / "job-1").read_text())
        assert worker.exists()
        parent.kill()
    wait_until(lambda: not worker.exists())


def wait_until(condition: Callable[[], bool], seconds: float = 30) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def test_dask_says_what_is_missing(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.harness.ensembles.engines.installed", lambda package: False)
    with pytest.raises(ValueError, match=r"pip install 'polhode\[dask\]'"):
        check_dask("tcp://127.0.0.1:8786")


@pytest.mark.parametrize(
    "address", ["", "foo", "tcp://", "tcp://:8786", "127.0.0.1", "http://127.0.0.1:80", "a b:1"]
)
def test_what_is_no_address_is_refused(address: str):
    with pytest.raises(ValueError, match="expected an address such as tcp://host:8786") as refusal:
        check_dask(address)
    assert repr(address) in str(refusal.value)


def test_a_scheduler_out_of_reach_is_named(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("polhode.harness.ensembles.engines.CONNECT_SECONDS", 1)
    with pytest.raises(OSError, match=r"tcp://127\.0\.0\.1:9"):
        list(dask("tcp://127.0.0.1:9", square, [Job(1)]))
    with pytest.raises(
        ValueError,
        match=r"^dask: got tcp://127\.0\.0\.1:9, expected a scheduler that runs: Timed out",
    ):
        check_dask("tcp://127.0.0.1:9")


def test_a_killed_scheduler_ends_the_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    pytest.importorskip("distributed")
    monkeypatch.setattr("polhode.harness.ensembles.engines.CONNECT_SECONDS", 3)
    with dask_scheduler(tmp_path) as scheduler:
        address = contact(tmp_path)

        def jobs() -> Iterator[Job]:
            yield Job(1)
            scheduler.kill()
            yield Job(2)

        # No worker, no result: the run waits for as long as it may.
        with pytest.raises(OSError, match=r"127\.0\.0\.1"):
            list(dask(address, square, jobs()))


@pytest.mark.parametrize("equations", ["full", "hybrid", "averaged"])
def test_a_sweep_by_workers_of_four_threads_gives_the_same_bits(
    cluster, tmp_path: Path, equations: str
):
    """The workers are cold: their threads compile the same code at once."""
    contents = {
        "name": "small",
        "title": "Small",
        "shapes": [[1.0, 1.0, 2.0], [1.0, 0.8, 0.5]],
        "stokes": 2000.0,
        "time": 30.0,
        "equations": equations,
        "start": {"motion": "momentum-isotropic", "angular_momentum": [0.0, 0.0, 0.7]},
    }
    sweep = parse_sweep(
        {**contents, "particles": 16, "block": 4, "samples": 11, "snapshots": 3, "bins": 8}
    )
    found = []
    for name, run in (("here", serial), ("there", partial(dask, cluster[0]))):
        with Store(tmp_path / f"{name}.sqlite") as store:
            assert run_sweep(sweep, store, run, quiet=True).finished == 8
            found.append({record["key"]: record["statistics"] for record in store})
    assert found[0] == found[1]


def test_dask_survives_the_kill_of_a_worker(cluster, tmp_path: Path):
    """Tasks it has begun are run again, and so are finished ones whose results were not fetched yet."""
    address, workers = cluster
    victim = workers[0]
    jobs = [Job(3000 + number, seconds=0.2, folder=tmp_path) for number in range(30)]
    with import_module("distributed").Client(address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
        run = dask(address, square, jobs)
        found = {next(run).task.number}

        def unfetched() -> set[int]:
            """Jobs done by the victim whose results this process has not got yet."""
            marks = {job.number: tmp_path / job.key for job in jobs}
            done_there = {
                number
                for number, mark in marks.items()
                if mark.exists() and str(victim.pid) in mark.read_text().split()
            }
            return done_there - found

        wait_until(lambda: len(unfetched()) > 0)
        victim.kill()
        victim.wait()
        lost = unfetched()
        # The scheduler, and with it the run, has heard of the loss.
        wait_until(lambda: len(client.nthreads()) == 1)
        outcomes = list(run)
    assert [outcome.message for outcome in outcomes if outcome.message] == []
    assert found | {outcome.task.number for outcome in outcomes} == {job.number for job in jobs}
    for number in lost:
        assert len((tmp_path / f"job-{number}").read_text().split()) == 2


def test_spinning_takes_as_long_as_it_says():
    began = time.perf_counter()
    assert spin(Job(5, 0.05)) == 5
    assert time.perf_counter() - began >= 0.05
