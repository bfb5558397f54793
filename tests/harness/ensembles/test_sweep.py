"""Sweeps through the command line, against whatever ends a run: the store holds every task once, with its numbers."""

import json
import os
import resource
import signal
import sqlite3
import subprocess
import time
import tomllib
import tracemalloc
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from commandline import SCRIPT, Run, small_disk
from dasks import contact, dask_scheduler, dask_worker

from polhode.harness.common.store import DamagedStoreError, Store, export
from polhode.harness.ensembles.engines import serial
from polhode.harness.ensembles.ensemble import Ensemble, Task
from polhode.harness.ensembles.statistics import SECOND, Statistics
from polhode.harness.ensembles.summary import means
from polhode.harness.ensembles.sweep import (
    gather,
    in_random_order,
    parse_sweep,
    perform,
    read_sweep,
    run_sweep,
)
from polhode.harness.pages.ensembles import _DRAWN, _FILES, picture, write_results

# Tasks of some hundredths of a second.
SWEEP = """\
name = "small"
title = "A small sweep"
shapes = [[1.0, 1.0, 2.0]]
stokes = [200.0, 300.0, 500.0]
time = 60.0
particles = 900
block = 100
samples = 11
snapshots = 3
bins = 8
tolerance = 1e-8
start.motion = "fluid"
"""
TASKS = 27


@pytest.fixture
def sweep_file(tmp_path: Path) -> Path:
    path = tmp_path / "sweep.toml"
    path.write_text(SWEEP, encoding="utf-8")
    return path


def rows(path: Path) -> dict[str, str]:
    """Statistics of each task that a store holds, as they stand there."""
    if not path.exists():
        return {}
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=10)) as connection:
        try:
            found = connection.execute("SELECT key, result FROM cases").fetchall()
        except sqlite3.OperationalError:
            return {}
    assert len({key for key, _ in found}) == len(found)
    return {key: json.dumps(json.loads(result)["statistics"]) for key, result in found}


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without their pictures, which take longer than all else."""
    for name in ("save", "picture"):
        monkeypatch.setattr(f"polhode.harness.pages.ensembles.{name}", lambda *_: None)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What a run that nothing disturbs leaves in its store, made in this process."""
    path = tmp_path_factory.mktemp("whole") / "store.sqlite"
    with Store(path) as store:
        tally = run_sweep(parse_sweep(tomllib.loads(SWEEP)), store, serial, quiet=True)
    assert (tally.finished, tally.found, tally.failed) == (TASKS, 0, 0)
    return rows(path)


def start(
    folder: Path, environment: dict[str, str], *words: str, **options
) -> subprocess.Popen[str]:
    command = [SCRIPT, "sweep", "sweep.toml", "--out", "out", *words]
    return subprocess.Popen(
        command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True, **options
    )


def wait_for_rows(path: Path, least: int, process: subprocess.Popen[str]) -> None:
    while process.poll() is None and len(rows(path)) < least:
        time.sleep(0.01)


def children(pid: int) -> list[int]:
    """Processes that a process has started to work for it."""
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        found += [int(child) for child in (task / "children").read_text().split()]
    return [child for child in found if "spawn_main" in Path(f"/proc/{child}/cmdline").read_text()]


def gone(pid: int, seconds: float = 10.0) -> bool:
    """Whether a process ends soon; one that waits to be reaped has ended."""
    status = Path(f"/proc/{pid}/stat")
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        try:
            if status.read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.05)
    return False


def test_a_killed_worker_and_a_killed_run_cost_nothing(
    here: Run, environment, sweep_file: Path, tmp_path: Path, undisturbed
):
    path = tmp_path / "out" / "store.sqlite"
    with start(tmp_path, environment, "--workers", "1") as process:
        wait_for_rows(path, 1, process)
        # Killed first, a worker costs nothing: another one goes on.
        (first,) = children(process.pid)
        os.kill(first, signal.SIGKILL)
        while process.poll() is None and set(children(process.pid)) <= {first}:
            time.sleep(0.01)
        wait_for_rows(path, len(rows(path)) + 2, process)
        workers = children(process.pid)
        process.kill()
        process.communicate()
    assert process.returncode == -signal.SIGKILL
    assert len(workers) == 1
    assert workers != [first]
    early = rows(path)
    assert 2 <= len(early) < TASKS
    assert not (tmp_path / "out" / "README.md").exists()
    refused = here("sweep", "sweep.toml", "--out", "out")
    assert refused.returncode == 2
    assert refused.stderr == (
        "polhode: out/store.sqlite: exists, expected --resume to go on with it, or another --out\n"
    )
    done = here("sweep", "sweep.toml", "--out", "out", "--resume", "--quiet", "--workers", "1")
    assert (done.returncode, done.stdout, done.stderr) == (0, "out/README.md\n", "")
    assert rows(path) == undisturbed
    for pid in workers:
        assert gone(pid)


@pytest.mark.usefixtures("undrawn")
def test_a_lost_scheduler_costs_no_finished_task(
    here: Run, environment, sweep_file: Path, tmp_path: Path, undisturbed
):
    pytest.importorskip("distributed")
    path = tmp_path / "out" / "store.sqlite"
    with dask_scheduler(tmp_path) as scheduler, dask_worker(tmp_path) as worker:
        # A lost scheduler is waited for no longer than this.
        waiting = environment | {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "2s"}
        with start(tmp_path, waiting, "--dask", contact(tmp_path)) as process:
            wait_for_rows(path, 3, process)
            scheduler.kill()
            _, said = process.communicate(timeout=60)
        worker.kill()
    assert process.returncode == 1
    assert said.splitlines()[-1].endswith(
        "finished tasks are in out/store.sqlite, --resume goes on"
    )
    early = rows(path)
    assert 3 <= len(early) < TASKS
    done = here("sweep", "sweep.toml", "--out", "out", "--resume", "--quiet", "--workers", "0")
    assert (done.returncode, done.stderr) == (0, "")
    assert rows(path) == undisturbed


@pytest.mark.usefixtures("undrawn")
def test_two_runs_at_once_share_a_store(
    here: Run, environment, sweep_file: Path, tmp_path: Path, undisturbed
):
    path = tmp_path / "out" / "store.sqlite"
    with start(tmp_path, environment, "--workers", "0", "--resume") as one:
        wait_for_rows(path, 1, one)
        two = here("sweep", "sweep.toml", "--out", "out", "--workers", "0", "--resume")
        _, first = one.communicate(timeout=100)
    assert (one.returncode, two.returncode) == (0, 0), first + two.stderr
    assert rows(path) == undisturbed


@pytest.mark.parametrize(
    ("number", "workers"),
    [(signal.SIGINT, "0"), (signal.SIGTERM, "1")],
    ids=["Ctrl-C", "terminated with a process"],
)
def test_ends_cleanly_and_says_how_to_go_on(
    environment, sweep_file: Path, tmp_path: Path, undisturbed, number: int, workers: str
):
    path = tmp_path / "out" / "store.sqlite"
    with start(tmp_path, environment, "--workers", workers) as process:
        wait_for_rows(path, 2, process)
        pids = children(process.pid)
        process.send_signal(number)
        _, text = process.communicate(timeout=30)
    assert process.returncode == 1
    last = text.splitlines()[-1].rpartition("\r")[2].strip()
    assert last == "polhode: interrupted: finished tasks are in out/store.sqlite, --resume goes on"
    assert "Traceback" not in text
    assert len(pids) == int(workers)
    for pid in pids:
        assert gone(pid)
    early = rows(path)
    assert early.items() <= undisturbed.items()
    assert 2 <= len(early) < TASKS


def finish(here: Run, path: Path, undisturbed: dict[str, str]) -> None:
    early = rows(path)
    assert early.items() <= undisturbed.items()
    assert len(early) < TASKS
    done = here("sweep", "sweep.toml", "--out", "out", "--resume", "--quiet", "--workers", "0")
    assert (done.returncode, done.stderr) == (0, "")
    assert rows(path) == undisturbed


@pytest.mark.usefixtures("undrawn")
def test_a_limit_of_file_size_loses_nothing(
    here: Run, environment, sweep_file: Path, tmp_path: Path, undisturbed
):
    path = tmp_path / "out" / "store.sqlite"

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (150_000, 150_000))

    with start(tmp_path, environment, "--workers", "0", preexec_fn=limit) as process:
        _, text = process.communicate(timeout=100)
    assert process.returncode == 1
    assert text.splitlines()[-1].endswith(
        "; finished tasks are in out/store.sqlite, --resume goes on"
    )
    assert "Traceback" not in text
    finish(here, path, undisturbed)


@pytest.mark.usefixtures("undrawn")
def test_a_full_disk_loses_nothing(
    here: Run, environment, sweep_file: Path, tmp_path: Path, undisturbed
):
    with small_disk(tmp_path / "out", "300k") as folder:
        with start(tmp_path, environment, "--workers", "0") as process:
            _, text = process.communicate(timeout=100)
        assert process.returncode == 1
        assert "disk" in text.splitlines()[-1]
        assert text.splitlines()[-1].endswith(
            "; finished tasks are in out/store.sqlite, --resume goes on"
        )
        assert "Traceback" not in text
        subprocess.run(["mount", "-o", "remount,size=30m", str(folder)], check=True)
        finish(here, folder / "store.sqlite", undisturbed)


def test_no_room_for_a_store_is_no_damage(here: Run, sweep_file: Path, tmp_path: Path):
    with small_disk(tmp_path / "out", "4k"):
        done = here("sweep", "sweep.toml", "--out", "out", "--workers", "0")
    assert done.returncode == 1
    assert done.stderr == (
        "polhode: out/store.sqlite: database or disk is full, expected a writable file and room for it; "
        "--resume goes on\n"
    )


@pytest.mark.parametrize("size", [100, 0.5])
def test_a_truncated_store_is_named_and_left_alone(
    here: Run, sweep_file: Path, tmp_path: Path, size
):
    path = tmp_path / "out" / "store.sqlite"
    with Store(path) as store:
        for number in range(50):
            store.put(str(number), {}, {"text": "x" * 2000})
    content = path.read_bytes()
    path.write_bytes(content[: int(size * len(content)) if size < 1 else size])
    content = path.read_bytes()
    done = here("sweep", "sweep.toml", "--out", "out", "--resume")
    assert done.returncode == 2
    assert done.stderr.startswith("polhode: out/store.sqlite: ")
    assert done.stderr.count("\n") == 1
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    "damage",
    [
        """replace(result, '"particles": 20', '"particles": 21')""",
        "substr(result, 1, 100)",
        """'{"statistics": {}}'""",
        "'[]'",
    ],
    ids=["another number", "cut off", "no checksum", "no record"],
)
def test_a_changed_record_is_named_and_left_alone(tmp_path: Path, damage: str):
    sweep = parse_sweep(
        {**tomllib.loads(SWEEP), "particles": 20, "stokes": [200.0], "shapes": [[1.0, 1.0, 2.0]]}
    )
    path = tmp_path / "store.sqlite"
    with Store(path) as store:
        run_sweep(sweep, store, serial, quiet=True)
        gather(sweep.ensembles[0], store)
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(f"UPDATE cases SET result = {damage}")
    content = path.read_bytes()
    with Store(path) as store:
        assert run_sweep(sweep, store, serial, quiet=True).finished == 0
        (key,) = store.keys()
        with pytest.raises(
            DamagedStoreError,
            match=f"store.sqlite: the store is damaged: case {key} fails its checks",
        ):
            gather(sweep.ensembles[0], store)
    assert path.read_bytes() == content


def test_starts_that_averaging_does_not_take_are_followed_in_full():
    start = {"motion": "fluid", "orientation": [0.5, 0.5, 0.5, 0.5]}
    changed = {"shapes": [[1.0, 0.8, 0.5]], "stokes": [1e9], "tolerance": 1e-4, "start": start}
    (ensemble,) = parse_sweep(tomllib.loads(SWEEP) | changed).ensembles
    assert ensemble.equations == "full"


def test_a_tolerance_below_rounding_is_refused():
    with pytest.raises(ValueError, match="tolerance: got 1e-20, expected"):
        parse_sweep(tomllib.loads(SWEEP) | {"tolerance": 1e-20})


def test_results_tell_what_the_store_holds(here: Run, sweep_file: Path, tmp_path: Path):
    shapes = SWEEP.replace("[[1.0, 1.0, 2.0]]", "[[1.0, 1.0, 2.0], [1.0, 1.0, 0.5]]").replace(
        "300.0, ", ""
    )
    sweep_file.write_text(shapes, encoding="utf-8")
    done = here("sweep", "sweep.toml", "--out", "out", "--json", "--quiet", "--workers", "0")
    assert (done.returncode, done.stderr) == (0, "")
    table = json.loads(done.stdout)
    assert [(row["a"], row["b"], row["c"], row["stokes"]) for row in table] == [
        (1.0, b, c, stokes) for b, c in ((1.0, 2.0), (1.0, 0.5)) for stokes in (200.0, 500.0)
    ]
    assert {row["particles"] for row in table} == {900}
    page = (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    assert "- 0 of 3600 particles failed.\n- 1 : 1 : 2, in the end: at St = 200, " in page
    assert "Made by `polhode sweep sweep.toml --workers 0`." in page
    sweep = read_sweep(sweep_file)
    with Store(tmp_path / "out" / "store.sqlite") as store:
        mean, _ = means(gather(sweep.ensembles[0], store), "second")
        assert {record["timing"] for record in store} == {"no times: tasks may run side by side"}
    lines = (tmp_path / "out" / "moments.csv").read_text(encoding="utf-8").splitlines()
    header, first = lines[0].split(","), lines[1].split(",")
    assert dict(zip(header, first, strict=True))["moment"] == "xx"
    assert float(first[header.index("mean")]) == mean[0, 0, 0]
    names = sorted(
        path.name for path in (tmp_path / "out").iterdir() if not path.name.startswith("store")
    )
    tables = [
        "arrivals.csv",
        "distributions.csv",
        "ensembles.json",
        "moments.csv",
        "rates.csv",
        "slow.csv",
        "voigt.csv",
    ]
    assert names == sorted(["README.md", "SHA256SUMS", "shape-1.png", "shape-2.png", *tables])
    written = tmp_path / "out" / "README.md"
    written.write_text(page.replace("particles failed", "particles vanished"), encoding="utf-8")
    again = here("sweep", "sweep.toml", "--out", "out", "--page-only")
    assert (again.returncode, again.stderr, again.stdout) == (0, "", "out/README.md\n")
    assert written.read_text(encoding="utf-8") == page


def test_a_sweep_of_which_nothing_finished_has_a_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def nothing(ensemble: Ensemble, _: Store) -> Statistics:
        count = ensemble.particles
        return replace(
            Statistics.empty(ensemble.layout), particles=count, failures={"step_limit": count}
        )

    monkeypatch.setattr("polhode.harness.pages.ensembles.gather", nothing)
    with Store(tmp_path / "store.sqlite") as store:
        page, _ = write_results(parse_sweep(tomllib.loads(SWEEP)), store, tmp_path, "polhode sweep")
    text = page.read_text(encoding="utf-8")
    assert "- 2700 of 2700 particles failed.\n" in text
    assert "in the end" not in text


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"particles": 0}, "particles: got 0, expected a whole number from 1 to 10"),
        ({"samples": 10**9}, "samples: got 1000000000, expected a whole number from 2 to 1000000"),
        ({"slow_time": 1.0}, "got both of slow_time and time, expected exactly one"),
        ({"grid": 1}, "grid: unknown key, expected one of name, title"),
        ({"start": {"motion": "spin"}}, "start.motion: got 'spin', expected 'rest', 'fluid'"),
        (
            {"start": {"orientation": "random"}},
            "start.orientation: got 'random', expected 'isotropic' or a quaternion",
        ),
        (
            {"start": {"orientation": [1.0, 2.0]}},
            "start.orientation: got [1.0, 2.0], expected 'isotropic' or a",
        ),
        ({"shapes": [[1.0, 1.0]]}, "shapes[0]: got [1.0, 1.0], expected at least 3 items"),
        ({"stokes": [100.0, 100.0]}, "expected each once"),
        (
            {"stokes": 0.0, "time": None, "slow_time": 1.0},
            "slow_time: got 1.0 at stokes = 0, expected time",
        ),
        ({"snapshots": 7}, "snapshots: got 7"),
        ({"stokes": 0.0, "equations": "averaged"}, "St = 0 has no slow variables"),
    ],
)
def test_bad_sweeps_get_one_line(change, line):
    contents = {
        name: value
        for name, value in {**tomllib.loads(SWEEP), **change}.items()
        if value is not None
    }
    with pytest.raises(ValueError) as refusal:  # noqa: PT011
        parse_sweep(contents)
    assert line in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_the_sweep_that_comes_with_the_package_is_one():
    sweep = read_sweep(None)
    assert len(sweep.ensembles) == 6
    assert sweep.size == len(list(sweep.tasks()))


@pytest.mark.parametrize(
    ("tolerance", "motion", "expected"),
    [
        # Averaging errs by up to 133/St.
        (1e-2, "fluid", ["full", "averaged"]),
        (1e-6, "fluid", ["full", "full"]),
        (1e-2, "rest", ["full", "full"]),
    ],
)
def test_equations_that_are_not_named_follow_from_the_error_asked_for(tolerance, motion, expected):
    contents = tomllib.loads(SWEEP) | {
        "stokes": [1e3, 1e5],
        "tolerance": tolerance,
        "start": {"motion": motion},
    }
    found = parse_sweep(contents | {"shapes": [[1.0, 0.8, 0.5]]}).ensembles
    assert [ensemble.equations for ensemble in found] == expected
    assert [ensemble.tolerance for ensemble in found] == [
        tolerance if e == "full" else tolerance / 1e4 for e in expected
    ]
    named = parse_sweep(
        contents | {"equations": "averaged", "start": {"motion": "fluid"}}
    ).ensembles
    assert {(ensemble.equations, ensemble.tolerance) for ensemble in named} == {
        ("averaged", tolerance)
    }


@pytest.mark.parametrize(
    "words", [("--workers", "1", "--dask", "tcp://127.0.0.1:9"), ("--dask", "foo"), ("none.toml",)]
)
def test_bad_options_get_one_line(here: Run, tmp_path: Path, words):
    done = here("sweep", *words, "--out", "out")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


AVERAGED = """\
name = "averaged"
title = "Averaged equations"
shapes = [[1.0, 1.0, 2.0]]
stokes = [1000.0]
slow_time = 0.2
particles = 20
block = 20
samples = 11
snapshots = 3
equations = "averaged"
start.motion = "momentum-isotropic"
start.angular_momentum = [0.0, 0.0, 0.7]
"""


def page_of(text: str, folder: Path) -> str:
    """Page of a sweep that is run here and now."""
    sweep = parse_sweep(tomllib.loads(text))
    folder.mkdir(exist_ok=True)
    with Store(folder / "store.sqlite") as store:
        run_sweep(sweep, store, serial, quiet=True)
        return write_results(sweep, store, folder, "polhode sweep mine.toml")[0].read_text(
            encoding="utf-8"
        )


@pytest.mark.parametrize("count", [1, 2, 12, 997])
def test_a_random_order_visits_each_number_once(count: int):
    assert sorted(in_random_order(count)) == [*range(count)]


def test_random_orders_differ():
    assert len({tuple(in_random_order(997)) for _ in range(5)}) > 1


def test_a_task_of_a_number_is_that_of_the_list():
    sweep = parse_sweep(tomllib.loads(SWEEP))
    assert [sweep.task(number) for number in range(sweep.size)] == [*sweep.tasks()]


def test_two_billion_tasks_are_taken_up_at_once(tmp_path: Path):
    contents = {**tomllib.loads(SWEEP), "particles": 10**9, "block": 1, "stokes": [200.0, 300.0]}
    sweep = parse_sweep(contents)
    assert sweep.size == 2 * 10**9
    taken = []

    def first_alone(_, tasks):
        taken.append(next(tasks))
        yield from ()

    with Store(tmp_path / "store.sqlite") as store:
        for number in range(100):
            task = sweep.task(number)
            store.put(task.key, task.content, {})
        tracemalloc.start()
        began = time.process_time()
        run_sweep(sweep, store, first_alone, quiet=True, spread=True)
        seconds = time.process_time() - began
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert taken[0].key not in store
    assert seconds < 1
    assert peak < 10_000_000


@pytest.mark.usefixtures("undrawn")
def test_memory_does_not_grow_with_the_tasks_of_a_store(tmp_path: Path):
    one = {**tomllib.loads(AVERAGED), "block": 1, "samples": 11, "snapshots": 11, "bins": 8}
    record = perform(Task(parse_sweep(one).ensembles[0], 0))
    peaks = []
    for count in (2, 2, 8):
        shapes = [[1.0, 1.0, 2.0 + k / 10] for k in range(count)]
        sweep, folder = (
            parse_sweep({**one, "particles": 20, "shapes": shapes}),
            tmp_path / f"{count}",
        )
        with Store(folder / "store.sqlite") as store:
            store._connection.execute("PRAGMA synchronous = OFF")
            for task in sweep.tasks():
                store.put(task.key, task.content, record)
            tracemalloc.start()
            assert run_sweep(sweep, store, serial, quiet=True).found == 20 * count
            rows = write_results(sweep, store, folder, "polhode sweep")[1]
            export(store, folder / "store.csv")
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        assert [row["particles"] for row in rows] == [20] * count
        assert len((folder / "arrivals.csv").read_text().splitlines()) == 1 + 11 * count
    # The keys that a run looks up are held and a row of each ensemble, nothing of the tasks.
    assert peaks[2] - peaks[1] < 100_000


@pytest.mark.usefixtures("undrawn")
def test_a_page_says_when_and_where_its_tasks_ran(tmp_path: Path):
    where = {"processor": "abacus", "cores": 1, "system": "wood", "python": "3.11"}
    with pytest.MonkeyPatch.context() as then:
        then.setattr("polhode.harness.common.store.now", lambda: "2020-02-03T04:05:06Z")
        then.setattr("polhode.harness.ensembles.sweep.machine", lambda: where)
        then.setattr("polhode.harness.ensembles.sweep.commit", lambda: "a" * 9)
        then.setattr("polhode.harness.ensembles.sweep.code_digest", lambda: "b" * 12)
        page_of(AVERAGED, tmp_path)
    # Taken up on another day and machine, where nothing is left to do.
    text = page_of(AVERAGED, tmp_path)
    assert "Measured on 2020-02-03 by polhode " in text
    assert f", commit {'a' * 9}, code {'b' * 12}, on abacus, 1 cores, wood, Python 3.11 (" in text


@pytest.mark.usefixtures("undrawn")
def test_averaged_equations_leave_no_empty_file_of_moments(tmp_path: Path):
    (tmp_path / "moments.csv").write_text("\r\n")
    page = page_of(AVERAGED, tmp_path)
    assert "moments.csv" not in page
    assert not (tmp_path / "moments.csv").exists()
    assert all(path.stat().st_size > 100 for path in tmp_path.glob("*.csv"))
    # All arrive.
    assert "(later" not in page


def test_the_page_says_where_nobody_arrives_or_could(tmp_path: Path):
    short = page_of(AVERAGED.replace("slow_time = 0.2", "slow_time = 0.02"), tmp_path / "short")
    assert "| later (" in short
    lost = page_of(
        AVERAGED.replace("1000.0", "20.0").replace("averaged", "full"), tmp_path / "lost"
    )
    assert "| – " in lost
    assert "[moments.csv]" in lost
    assert "(shape-1.png)" in lost
    assert (tmp_path / "lost" / "shape-1.png").stat().st_size > 10_000


def test_pictures_show_the_moments_and_arrivals(tmp_path: Path):
    sweep = parse_sweep(
        {**tomllib.loads(SWEEP), "particles": 50, "block": 50, "shapes": [[1.0, 1.0, 2.0]]}
    )
    found = [(ensemble, ensemble.run(0)) for ensemble in sweep.ensembles]
    tables = {
        name.removesuffix(".csv"): pd.DataFrame(
            [row for ensemble, statistics in found for row in make(ensemble, statistics)]
        )
        for name, make in _FILES.items()
        if name in _DRAWN
    }
    moments, arrivals = picture(tables).axes
    (histogram,) = arrivals.child_axes
    found.sort(key=lambda pair: pair[0].stokes)
    for k, (ensemble, statistics) in enumerate(found):
        mean, _ = means(statistics, "second")
        for i, component in enumerate(((0, 0), (1, 1), (2, 2))):
            # For each component a line for each St.
            line = moments.lines[len(found) * i + k]
            assert line.get_ydata() == pytest.approx(mean[:, -1, SECOND.index(component)])
            assert line.get_xdata() == pytest.approx(
                [0.0, 30 / ensemble.stokes, 60 / ensemble.stokes]
            )
        # At the start and at the end.
        for patch in histogram.patches[2 * k : 2 * k + 2]:
            assert patch.get_data().values.sum() == pytest.approx(1)
        assert arrivals.lines[k].get_ydata()[-1] == pytest.approx(statistics.arrivals.sum() / 50)
