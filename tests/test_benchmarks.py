"""The pytest plug-in: the suite's options, table and JSON, and the fixture for tests of one's own."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from commandline import SCRIPT

from polhode.harness.analysis.asv import write_asv
from polhode.harness.analysis.comparison import benchmark_records
from polhode.harness.benchmarks.cases import Options, Row, Suite, meets
from polhode.harness.benchmarks.measured import Counts
from polhode.harness.benchmarks.table import name_rows
from polhode.solvers.catalogue import SOLVERS

pytestmark = pytest.mark.usefixtures("quickly_compiled")

ROOT = Path(__file__).parents[1]
SUITE = ["tests/benchmarks", "-o", "python_files=bench_*.py"]
# Beside the own solver of the docs, one that never reaches the end.
STOPS = """
from polhode.solvers.contract import Solver, Status

class Stops(Solver):
    name = summary = accepts = "stops"
    library = package = "numpy"
    backends = ("python",)
    error_constant = 1.0

    def prepare(self, problem, settings):
        def integrate(record):
            return Status.STEP_LIMIT, "never begins"

        return integrate
"""


def run_pytest(
    *words: str | Path, folder: Path = ROOT, path: str = ""
) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", "pytest", *map(str, words), "-p", "no:cacheprovider"]
    paths = [*os.environ.get("PYTHONPATH", "").split(os.pathsep), path]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    return subprocess.run(
        command,
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_outside_forms_and_solvers_are_timed():
    outside = [
        "--with-solver",
        "own_solver:ClassicalRungeKutta",
        "--with-form",
        "own_form:Directions",
    ]
    done = run_pytest(*SUITE, "--collect-only", *outside, path=str(ROOT / "docs" / "examples"))
    assert "paper-100-quaternion-own_solver:ClassicalRungeKutta-0.001" in done.stdout, done.stderr
    assert "paper-1000-own_form:Directions-taylor-1e-07" in done.stdout


def test_the_suite_is_found_by_its_name(tmp_path: Path):
    words = ["--pyargs", "polhode.harness.benchmarks", "--collect-only", "-q", "--polhode-quick"]
    done = run_pytest(*words, folder=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "test_solve[paper-100-quaternion-taylor-0.001]" in done.stdout


def test_the_suite_has_every_solver_both_shapes_and_all_sides():
    methods = Suite(Options()).cases
    assert {solver for _, _, _, solver in methods} >= set(SOLVERS) - {"exact", "splitting-extended"}
    stokes = {name: {st for scene, st, *_ in methods if scene == name} for name, *_ in methods}
    assert stokes == {
        "paper": {1e-3, 1e2, 1e3, 1e4, 1e5, 1e6},
        "spheroid": {1e-3, 1e3, 1e5, 1e6},
    }
    long = {(form, solver) for _, st, form, solver in methods if st == 1e6}
    assert {("hybrid", "cyrk-vern8"), ("spheroid-axis", "stroboscopic")} <= long


def test_options_choose_the_rows():
    options = Options(stokes=(1e-2, 50.0), forms=("euler-angles",), solvers=("cyrk-bdf", "radau"))
    suite = Suite(options)
    assert {method[1:] for method in suite.cases if method[0] == "paper"} == {
        (st, "euler-angles", solver) for st in (1e-2, 50.0) for solver in options.solvers
    }
    first = suite.rows()[0]
    assert (first.name, first.group) == (
        "paper-0.01-euler-angles-cyrk-bdf-0.001",
        "paper, St = 0.01",
    )
    rows = Suite(Options(stokes=(50.0,), solvers=("taylor",), errors=(1e-6, 1e-2))).rows()
    assert [row.error for row in rows[:2]] == [1e-2, 1e-6]
    assert rows[1].group == "paper, St = 50, error 1e-06"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (Options(forms=("quaternions",)), "did you mean 'quaternion'"),
        (Options(solvers=("vern9",)), "got 'vern9'"),
        (Options(forms=("jeffery",)), "expected one that some scene and solver accept"),
    ],
)
def test_wrong_names_are_refused(options: Options, reason: str):
    with pytest.raises(ValueError, match=reason):
        Suite(options).rows()


def test_an_error_is_met_at_the_loosest_tolerance():
    suite = Suite(Options(stokes=(100.0,), solvers=("cyrk-vern8",), errors=(1e-3, 1e-7)))
    method = "paper", 100.0, "quaternion", "cyrk-vern8"
    for error in (1e-3, 1e-7):
        case, record, reason = suite.choose(Row(method, None, error))
        assert reason == ""
        assert record["slow_error"] <= error
        looser = [other for other in suite.cases[method] if other.tolerance > case.tolerance]
        assert looser
        for other in looser:
            _, worse, _ = suite.choose(Row(method, other.tolerance, None))
            assert not meets(worse, "slow_error", error)
    *_, reason = suite.choose(Row(method, None, 1e-15))
    assert reason.startswith("error not met: the ")
    *_, reason = suite.choose(Row(("paper", 100.0, "averaged", "cyrk-vern8"), None, 1e-7))
    assert reason.startswith("error not met: the error is ")


def row(seconds: float, error: float | None, **more: Any) -> dict[str, Any]:
    case = {"form": "quaternion", "solver": "taylor", "tolerance": 1e-7}
    result = {"slow_error": error, "slow_uncertainty": 1e-16}
    info = {"case": case, "result": result, "want": "slow", **more}
    return {"name": "test_solve[x]", "min": seconds, "extra_info": info}


def test_rows_say_solver_tolerance_and_error_and_mark_the_front():
    own = {"name": "test_own", "min": 1.0, "extra_info": {}}
    rows = [row(2.0, 1e-8), row(1.0, 3.2e-4), row(3.0, 1e-6), row(4.0, 1e-17), row(0.5, None), own]
    name_rows(rows)
    assert [each["name"] for each in rows] == [
        "quaternion  taylor  tol 1e-7  error 1.0e-8   *",
        "quaternion  taylor  tol 1e-7  error 3.2e-4   *",
        "quaternion  taylor  tol 1e-7  error 1.0e-6    ",
        "quaternion  taylor  tol 1e-7  error <1.0e-15 *",
        "quaternion  taylor  tol 1e-7  error unknown   ",
        "test_own",
    ]


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of two saved runs of a small suite, with one solver that fails; the output of the second."""
    folder = tmp_path_factory.mktemp("runs")
    (folder / "stops.py").write_text(STOPS, encoding="utf-8")
    words = ["--polhode-stokes", "100", "--polhode-forms", "averaged", "-k", "paper"]
    words += ["--polhode-solvers", "cyrk-dop853,cyrk-vern8", "--with-solver", "stops:Stops", "-rs"]
    for name, more in (("first", []), ("second", ["--benchmark-compare"])):
        done = run_pytest(
            *SUITE,
            *words,
            *more,
            f"--benchmark-storage={folder / 'storage'}",
            f"--benchmark-save={name}",
            f"--benchmark-json={folder / name}.json",
            path=str(folder),
        )
        assert done.returncode == 0, done.stdout + done.stderr
        (folder / f"{name}.txt").write_text(done.stdout, encoding="utf-8")
    return folder


def test_failed_runs_have_no_row_and_stay_in_the_json(saved: Path):
    out = (saved / "first.txt").read_text(encoding="utf-8")
    assert "benchmark 'paper, St = 100': 10 tests" in out
    assert out.count("averaged  cyrk-vern8   tol ") == 5
    assert "stops:Stops  tol" not in out
    assert "step_limit: never begins" in out
    assert "Without a time: 5 step_limit" in out
    contents = json.loads((saved / "first.json").read_text(encoding="utf-8"))
    assert len(contents["benchmarks"]) == 10
    failed = contents["polhode"]["failed"]
    assert [each["extra_info"]["result"]["status"] for each in failed] == 5 * ["step_limit"]
    assert {each["params"]["solver"] for each in failed} == {"stops:Stops"}
    for each in benchmark_records(contents):
        timed = each["status"] == "reached_end"
        assert timed == ("seconds" in each)
        if timed:
            assert each["seconds"] == min(each["seconds_runs"]) > 0
            assert isinstance(each["slow_error"], float)
            assert isinstance(each["work"]["rhs_calls"], int)


def test_runs_that_all_have_times_have_a_legend_and_name_their_machine(tmp_path: Path):
    words = ["--polhode-stokes", "100", "--polhode-forms", "averaged", "-k", "paper and 1e-07"]
    saved = tmp_path / "runs.json"
    done = run_pytest(
        *SUITE, *words, "--polhode-solvers", "cyrk-vern8", f"--benchmark-json={saved}"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "no other run in the table is both as fast and as accurate" in done.stdout
    assert "Without a time" not in done.stdout
    contents = json.loads(saved.read_text(encoding="utf-8"))
    assert contents["polhode"]["failed"] == []
    assert contents["polhode"]["versions"]["polhode"]


def test_saved_runs_are_compared_by_both_commands(saved: Path):
    out = (saved / "second.txt").read_text(encoding="utf-8")
    assert "benchmark 'paper, St = 100': 20 tests" in out
    assert "(NOW)" in out
    command = [Path(sys.executable).with_name("pytest-benchmark"), "--storage", saved / "storage"]
    command += [
        "compare",
        "--group-by",
        "param:solver",
        "--columns",
        "min",
        "--csv",
        saved / "a.csv",
    ]
    done = subprocess.run(
        command, cwd=saved, capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.count("benchmark 'solver=") == 2
    assert (saved / "a.csv").read_text(encoding="utf-8").count("\n") == 21
    words = [SCRIPT, "compare", saved / "first.json", saved / "second.json", "--slower", "100"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("15 cases compared, 0 gone, 0 new; the machine takes ")


def test_a_histogram_is_drawn(saved: Path):
    pytest.importorskip("pygal")
    command = [Path(sys.executable).with_name("pytest-benchmark"), "--storage", saved / "storage"]
    command += ["compare", "--histogram", saved / "plot", "0001"]
    subprocess.run(command, cwd=saved, capture_output=True, timeout=60, check=True)
    assert [path.name for path in saved.glob("plot*.svg")] == ["plot-paper__St_=_100.svg"]


def test_asv_gets_its_files(saved: Path, tmp_path: Path):
    contents = json.loads((saved / "first.json").read_text(encoding="utf-8"))
    contents["commit_info"] = {"id": "0123456789abcdef", "time": "2026-11-24T10:00:00+00:00"}
    contents["machine_info"]["node"] = "a machine"
    (tmp_path / "run.json").write_text(json.dumps(contents), encoding="utf-8")
    for _ in range(2):
        path = write_asv(tmp_path / "run.json", tmp_path / "results")
    assert path.parent == tmp_path / "results" / "a-machine"
    assert path.name.startswith("01234567-existing-py3.")
    result = json.loads(path.read_text(encoding="utf-8"))
    times = dict(
        zip(
            result["result_columns"],
            result["results"]["paper.St100.averaged.time_solve"],
            strict=True,
        )
    )
    solvers, tolerances = times["params"]
    assert (len(solvers), len(tolerances), len(times["result"])) == (3, 5, 15)
    row = contents["benchmarks"][0]
    info = row["extra_info"]["case"]
    place = solvers.index(repr(info["solver"])) * 5 + [float(each) for each in tolerances].index(
        info["tolerance"]
    )
    assert times["result"][place] == row["stats"]["min"]
    assert times["result"].count(None) == 5
    listed = json.loads((tmp_path / "results" / "benchmarks.json").read_text(encoding="utf-8"))
    assert set(listed) == {*result["results"], "version"}
    contents["commit_info"] = {"id": "unknown"}
    (tmp_path / "run.json").write_text(json.dumps(contents), encoding="utf-8")
    with pytest.raises(
        ValueError, match="got commit 'unknown', expected the JSON of a run in a clone"
    ):
        write_asv(tmp_path / "run.json", tmp_path / "results")


def test_counts_that_grow_are_named(tmp_path: Path):
    path = tmp_path / "work_counts.json"
    assert Counts(path, "test_a", update=True).grown({"rhs_calls": 100, "steps": 10}) == {}
    assert Counts(path, "test_b", update=True).grown({"rhs_calls": 7}) == {}
    stored = Counts(path, "test_a", update=False)
    assert stored.grown({"rhs_calls": 103, "steps": 9, "jacobians": 3}) == {}
    assert stored.grown({"rhs_calls": 104, "steps": 10}) == {"rhs_calls": (100, 104)}
    with pytest.raises(pytest.fail.Exception, match="no counts of test_c"):
        Counts(path, "test_c", update=False).grown({"rhs_calls": 1})


FAILING = """
import pytest
from polhode import Problem

def test_blow_up(work_precision):
    problem = Problem.from_function(lambda t, y: [y[0] * y[0]], [1.0], 2.0)
    run = work_precision(problem, "cyrk-dop853", 1e-8, max_seconds=1.0)
    assert run.status != "reached_end"
    assert run.error is None and run.seconds is None

def test_a_function_in_place_of_a_solver(work_precision):
    def exact(f, t_span, y0, t_eval, rtol, atol):
        import numpy as np
        return np.exp(-t_eval)[:, None]

    problem = Problem.from_function(lambda t, y: [-y[0]], [1.0], 2.0)
    run = work_precision(problem, exact, 1e-8, samples=21)
    assert run.error < 1e-12
    assert run.seconds > 0
"""


def test_the_example_project(tmp_path: Path):
    """Its counts are those stored; one that is smaller fails the test that names it."""
    example = ROOT / "docs" / "examples" / "benchmarks"
    for path in example.glob("*.*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    # By its module, whether or not the installation declares it.
    words = ["-p", "no:polhode", "-p", "polhode.harness.benchmarks.plugin"]
    words += ["--benchmark-max-time=0.01"]
    (tmp_path / "test_failing.py").write_text(FAILING, encoding="utf-8")
    done = run_pytest(*words, folder=tmp_path)
    assert "5 passed" in done.stdout, done.stdout
    assert "test_work_and_accuracy[cyrk-vern8]  error " in done.stdout
    stored = json.loads((tmp_path / "work_counts.json").read_text(encoding="utf-8"))
    stored["test_work_and_accuracy[taylor]"]["steps"] -= 10
    (tmp_path / "work_counts.json").write_text(json.dumps(stored), encoding="utf-8")
    done = run_pytest(*words, "--benchmark-disable", "-k", "work_and", folder=tmp_path)
    assert "1 failed, 2 passed" in done.stdout
    assert "{'steps': (" in done.stdout


def test_the_plug_in_is_light():
    code = "import sys; import polhode.harness.benchmarks.plugin; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    loaded = set(done.stdout.split())
    assert not loaded & {"numpy", "scipy", "pandas", "heyoka", "CyRK", "llvmlite", "pydantic"}
