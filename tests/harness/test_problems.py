"""`polhode bench --problems`: classical problems, measured against published solutions, and their page."""

import re
from pathlib import Path

import pytest
from commandline import Run

from polhode.harness.common.store import Store
from polhode.harness.common.worker import Failure, KilledFromOutsideError, Reply, Worker
from polhode.harness.work_precision import measured, run_problems


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("problems")


def test_errors_are_those_of_the_published_end():
    rows = measured("brusselator", "taylor", (1e-4, 1e-10), 5.0)
    loose, tight = (row["error"] for row in rows)
    assert 1e-9 < loose < 1e-2
    assert tight < 1e-9
    assert all(row["seconds"] > 0 for row in rows)


def test_what_is_in_the_store_is_not_run_again(folder: Path, monkeypatch: pytest.MonkeyPatch):
    wanted = ["kepler", "robertson-dae"], ["cyrk-dop853", "ida"]
    with Store(folder / "store.sqlite") as store:
        rows = run_problems(store, *wanted, quick=True, quiet=True)
        # The differential-algebraic one has a single solver.
        assert {(row["problem"], row["solver"]) for row in rows} == {
            ("kepler", "cyrk-dop853"),
            ("kepler", "ida"),
            ("robertson-dae", "ida"),
        }
        assert len(rows) == 9
        monkeypatch.setattr("polhode.harness.work_precision.Worker.run", None)
        assert run_problems(store, *wanted, quick=True, quiet=True) == rows


def test_a_kill_from_outside_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.harness.common.worker.ATTEMPTS", 1)
    with Store(tmp_path / "store.sqlite") as store:
        with pytest.raises(
            KilledFromOutsideError, match="lorenz by planted:Victim: crashed with SIGKILL"
        ):
            run_problems(store, ("lorenz",), ("planted:Victim",), quick=True, quiet=True)
        assert not store.keys()


def test_a_solver_that_hangs_is_stopped_and_one_that_raises_says_how_in_a_line(
    tmp_path: Path, monkeypatch
):
    replies = iter(
        [
            Reply(None, Failure.KILLED, "killed after 9 s", 9.0),
            Reply(None, Failure.RAISED, "a\nb\n", 1.0),
        ]
    )
    monkeypatch.setattr(Worker, "run", lambda *_, **__: next(replies))
    with Store(tmp_path / "store.sqlite") as store:
        rows = run_problems(store, ("lorenz",), ("taylor", "ida"), quick=True, quiet=True)
    found = [(row["status"], row["message"]) for row in rows]
    assert found == [("time_limit", "killed after 9 s"), ("crashed", "b")]


def test_the_page(here: Run, folder: Path):
    words = ("bench", "--problems", "--quick", "--resume", "--quiet", "--out", folder)
    done = here(
        *words,
        "--scene",
        "kepler",
        "--scene",
        "robertson-dae",
        "--solver",
        "cyrk-dop853",
        "--solver",
        "ida",
    )
    assert done.returncode == 0, done.stderr
    page = (folder / "README.md").read_text()
    assert re.search(r"\| kepler +\| cyrk-dop853: [\d.]+ .s, [\d.]+ × as fast as ida", page)
    assert "**robertson-dae**: F. Mazzia" in page
    assert " % of 2 problems that some method solves. " in page
    assert {"profiles.png", "work-precision.png", "runs.csv"} <= {
        path.name for path in folder.iterdir()
    }
    nobody = (
        "--quick",
        "--quiet",
        "--out",
        folder / "nobody",
        "--scene",
        "robertson",
        "--solver",
        "rk45",
    )
    assert here("bench", "--problems", *nobody).returncode == 0
    assert (
        "- No solver reaches an error of 1e-6 of any problem."
        in (folder / "nobody" / "README.md").read_text()
    )
    look = here(
        "bench", "--problems", "--quick", "--quiet", "--scene", "kepler", "--solver", "cyrk-dop853"
    )
    assert (look.returncode, look.stdout) == (0, "reports/problems-quick/README.md\n")
    refused = here("bench", "--problems", "--scene", "keppler", "--out", folder / "other")
    assert refused.returncode == 2
    assert "got 'keppler' (did you mean 'kepler'?), expected one of hires" in refused.stderr
    assert here("bench", "--problems", "--solver", "rk4", "--out", folder / "other").returncode == 2
    refused = here(
        "bench",
        "--problems",
        "--scene",
        "kepler",
        "--solver",
        "splitting",
        "--out",
        folder / "other",
    )
    assert refused.returncode == 2
    assert refused.stderr == "polhode: solver: got splitting, expected one that takes kepler\n"
    assert not (folder / "other").exists()
    assert here("bench", "--problems", "--form", "quaternion").returncode == 2
    assert here("bench", "--problems", "--page-only", "--out", folder / "other").returncode == 2
