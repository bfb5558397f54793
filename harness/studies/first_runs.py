"""First runs: what a fresh process pays for importing a library and compiling a form, which later runs do not."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from tempfile import TemporaryDirectory

from polhode.harness.common.worker import Worker
from polhode.harness.studies.cost import FirstRun, first_run
from polhode.models.catalogue import form as find_form
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.solvers.catalogue import solver as find_solver

LIMIT = 60.0
TOLERANCE = 1e-8
# Part of a scene's time that tells what a first run takes more.
BEGINNING = 1e-6

Method = tuple[str, str]


def first_runs(problem: Problem, solvers: Sequence[str]) -> dict[str, tuple[FirstRun, FirstRun]]:
    """Cold and warm first run of each solver, every one in a fresh process.

    Solvers whose run fails are left out.
    """
    found = {}
    for name in solvers:
        with TemporaryDirectory() as folder:
            pair = [_fresh(problem, name, folder) for _ in range(2)]
        if all(pair):
            found[name] = tuple(pair)
    return found


def first_seconds(scenes: Mapping[str, Scene], methods: Iterable[Method]) -> dict[Method, float]:
    """Seconds that the first of all runs by a form and solver takes more than later ones, import and compilation.

    Measured once for the solvers that share what is compiled for a form, without a cache on disk.

    Parameters
    ----------
    scenes : mapping of str to Scene
        One scene for each form; only a beginning of it is run.
    methods : iterable of (str, str)
        Forms and solvers.

    Returns
    -------
    dict of (str, str) to float
        0.0 where the first run fails.
    """
    known: dict[Method, float] = {}
    found = {}
    for form, solver in methods:
        group = form, compile_group(solver)
        if group not in known:
            with TemporaryDirectory() as folder:
                run = _fresh(_beginning(find_form(form).problem(scenes[form])), solver, folder)
            known[group] = run.library + run.compilation if run else 0.0
        found[form, solver] = known[group]
    return found


def compile_group(solver: str) -> str:
    """Solvers that share what is compiled for a form."""
    method = find_solver(solver)
    return f"{method.library}{' implicit' if method.implicit else ''}" if method.library != "CyRK" else "CyRK"


def _beginning(problem: Problem) -> Problem:
    return replace(problem, end=problem.end * BEGINNING, least_steps=0)


def _fresh(problem: Problem, solver: str, folder: str) -> FirstRun | None:
    with Worker() as worker:
        return worker.run(first_run, problem, solver, TOLERANCE, folder, limit=LIMIT).value
