"""Every solver on every form of the paper's ellipsoid, across St and tolerance, as pytest-benchmark cases.

Run by ``pytest tests/benchmarks -o python_files='bench_*.py' --benchmark-json=FILE``. Errors, work
and status are in `extra_info`; `polhode compare` reads the file. A run that failed keeps its row,
with its status and without a time. Plug-ins take part; so do ``--with-solver my_module:Mine`` and
``--with-form my_module:Mine``.
"""

import json
from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np
import pytest

from polhode.harness.common.store import Record
from polhode.harness.common.timing import Patience, sentinel
from polhode.harness.studies.case import Case, attempt, judge
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene
from polhode.models.scenes import PAPER_ELLIPSOID, PAPER_START
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import SolverNotValidError, Status

# Duration in units of the inverse shear rate, by St: t₂ = 0.5, and some thousand relaxation times
# on the stiff side.
TIMES = {1e2: 50.0, 1e3: 500.0, 1e4: 5e3, 1e-3: 20.0}
TOLERANCES = (1e-4, 1e-7, 1e-10)
SAMPLES = 201
# Limit of each run, and of the repeated runs of a case together, in seconds.
MAX_SECONDS, REPEATED_SECONDS = 0.3, 0.3
MOST_ROUNDS = 10
# A run shorter than this is slow when the processor's caches hold something else: another one goes
# before it.
SHORT = 0.01
# Slow moments of the machine are waited out before every round, for a quarter of the suite's time
# at most.
PATIENCE = Patience(sentinel, share=0.25)
# Below it averaged forms describe nothing.
AVERAGED_FROM = 1.0


def cases(forms: Iterable[str] = (), solvers: Iterable[str] = ()) -> Iterator[Case]:
    """All cases that forms and solvers accept, each method from its loosest tolerance to its tightest.

    Beside those of the catalogues, `forms` and `solvers` are "module:class".
    """
    for stokes, time in TIMES.items():
        scene = Scene(Ellipsoid(PAPER_ELLIPSOID), stokes, PAPER_START, time)
        for form in (*FORMS, *forms):
            for solver in (*SOLVERS, *solvers):
                if _accepted(scene, form, solver):
                    for tolerance in TOLERANCES:
                        yield Case("paper", scene, form, solver, tolerance, SAMPLES, MAX_SECONDS)


def _accepted(scene: Scene, form: str, solver: str) -> bool:
    method = find_solver(solver)
    if not method.available or (find_form(form).averaged and scene.stokes < AVERAGED_FROM):
        return False
    try:
        method.check(find_form(form).problem(scene))
    except (FormNotValidError, SolverNotValidError):
        return False
    return True


@cache
def examined(case: Case) -> Record:
    """Status, errors and work of a case; inferred where a looser tolerance was too slow already."""
    position = TOLERANCES.index(case.tolerance)
    if position:
        looser = examined(_at(case, TOLERANCES[position - 1]))
        if looser["status"] == Status.TIME_LIMIT:
            return {
                "status": looser["status"],
                "message": "at a looser tolerance already",
                "inferred": True,
            }
    try:
        tried = attempt(case)
    except Exception as error:
        return {"status": str(Status.CRASHED), "message": repr(error), "inferred": False}
    # States that have grown beyond all bounds are data as well.
    with np.errstate(all="ignore"):
        return judge(case, *tried)


def _at(case: Case, tolerance: float) -> Case:
    return Case(
        case.scene_name,
        case.scene,
        case.form,
        case.solver,
        tolerance,
        case.samples,
        case.max_seconds,
    )


def _name(case: Case) -> str:
    return f"{case.scene.stokes:g}-{case.form}-{case.solver}-{case.tolerance:g}"


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test per case."""
    outside = (
        metafunc.config.getoption(option) or () for option in ("--with-form", "--with-solver")
    )
    metafunc.parametrize("case", list(cases(*outside)), ids=_name)


@pytest.mark.usefixtures("time_left")
def test_solve(benchmark, case: Case) -> None:
    """Time one case; a failure is data."""
    benchmark.group = f"St = {case.scene.stokes:g}"
    record = examined(case)
    # Plain numbers: the plugin writes NumPy's as strings.
    benchmark.extra_info |= json.loads(
        json.dumps({"key": case.key, "case": case.content, "result": record}, default=float)
    )
    steadiness = [PATIENCE.steady()]
    if record["status"] == Status.REACHED_END:
        seconds = record["counted_seconds"]
        rounds = max(1, min(MOST_ROUNDS, int(REPEATED_SECONDS / seconds)))

        def ready() -> None:
            steadiness.append(PATIENCE.steady())
            if seconds < SHORT:
                case.solve()

        benchmark.pedantic(case.solve, setup=ready, rounds=rounds, iterations=1, warmup_rounds=1)
        benchmark.extra_info["seconds_runs"] = [
            float(seconds) for seconds in benchmark.stats.stats.data
        ]
    else:
        benchmark.pedantic(_nothing, rounds=1, iterations=1, warmup_rounds=1)
    benchmark.extra_info["sentinel_seconds"] = min(steadiness)


def _nothing() -> None:
    """What is timed in place of a run that failed."""
