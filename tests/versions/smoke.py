"""What polhode does on a machine, step by step: `python smoke.py [PART …]`, a line of JSON for each.

A line has the step, its seconds, and either `numbers`, with which other machines are compared, or
`refused`, the line in which polhode names a library that is missing. All else is a `fault`. Exit
code 1 if there is one.
"""

import io
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import polhode
from polhode.harness.cli import main as main_command
from polhode.harness.ensembles.engines import check_dask, dask
from polhode.models.catalogue import FORMS, form
from polhode.models.libraries import MissingLibraryError, installed
from polhode.models.scene import Scene
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import SOLVERS, solver
from polhode.solvers.solve import solve as run

Numbers = list[float]
Step = Callable[[], Numbers]
# A scene for the forms that do not take the scene of the paper.
SCENE_OF = {
    "spheroid-angles": "spheroid",
    "spheroid-axis": "spheroid",
    "tumbling": "tumbler",
    "jeffery": "jeffery",
    "euler-top": "top",
    "averaged-spheroid": "spheroid",
    "averaged-second-order": "spheroid",
}
# Forms with a solver of their own; the others run by SciPy's DOP853, which is everywhere.
SOLVER_OF = {"jeffery": "exact", "euler-top": "exact"}
# A long run that is nearly free of torque: here stroboscopic averaging skips turns. Both numbers are
# estimates.
NEARLY_FREE = replace(named_scene("spheroid"), stokes=1e6, time=1e4)
# Of the runs of forms and solvers: an estimate. What numbers of other machines may differ by, `emulated.py`
# says.
TOLERANCE = 1e-8
# Seconds after which a run by one solver is stopped: under emulation the slowest takes 20.
MAX_SECONDS = 300.0


def slow_of(solution: Any) -> Numbers:
    """L and E of the last row."""
    if not solution.success:
        raise RuntimeError(f"{solution.status}: {solution.message}")
    return [float(number) for number in solution.observables.slow[-1]]


def by_form(name: str) -> Step:
    """A run of a form."""
    scene = SCENE_OF.get(name, "paper")
    method = SOLVER_OF.get(name, "dop853")

    def step() -> Numbers:
        solution = polhode.solve(scene, form=name, solver=method, tolerance=TOLERANCE, samples=3)
        return slow_of(solution)

    return step


def scene_for(name: str) -> tuple[Scene, str]:
    """A scene that a solver is made for, and the form."""
    if name == "exact":
        return named_scene("jeffery"), "jeffery"
    if name == "stroboscopic":
        return NEARLY_FREE, "spheroid-axis"
    return named_scene("spheroid"), "spheroid-axis"


def by_solver(name: str) -> Step:
    """A run by a solver; what is missing raises MissingLibraryError."""

    def step() -> Numbers:
        method = solver(name)
        if not method.available:
            raise MissingLibraryError(method.why_not)
        scene, equations = scene_for(name)
        answer = run(form(equations).problem(scene), name, TOLERANCE, max_seconds=MAX_SECONDS)
        if not answer.success:
            raise RuntimeError(f"{answer.status}: {answer.message}")
        return [float(number) for number in answer.states[-1]]

    return step


def default_run() -> Numbers:
    """`solve` by what it chooses itself, to an error that it confirms."""
    solution = polhode.solve("paper", error=1e-6, samples=3)
    if not solution.error.slow.high <= 1e-6:
        raise RuntimeError(f"stated error {solution.error.slow}")
    return slow_of(solution)


def choice() -> Numbers:
    """`pick`: that it ranks something; times are the machine's own."""
    ranking = polhode.pick("spheroid", error=1e-4).ranking
    return [float(len(ranking) > 0)]


def own_function() -> Numbers:
    """`solve_ivp` on an oscillator."""
    answer = polhode.solve_ivp(lambda t, y: [y[1], -y[0]], (0.0, 1.0), [1.0, 0.0], rtol=1e-9)
    if not answer.success:
        raise RuntimeError(answer.message)
    return [float(number) for number in answer.y[:, -1]]


def cost_against_accuracy() -> Numbers:
    """`WorkPrecision` of an oscillator by two solvers of SciPy: that all runs meet their end."""
    return [float((oscillator().frame["status"] == "reached_end").sum())]


def oscillator() -> polhode.WorkPrecision:
    """A study of two solvers of SciPy."""
    problem = polhode.Problem.from_function(lambda t, y: [y[1], -y[0]], [1.0, 0.0], 1.0)
    return polhode.WorkPrecision(problem, ["dop853", "rk45"], [1e-5, 1e-7])


def plotted() -> Numbers:
    """`WorkPrecision.plot` (extra `figures`)."""
    axes: Any = None
    if installed("matplotlib"):
        from matplotlib.figure import Figure

        axes = Figure().add_subplot()
    return [float(len(oscillator().plot(axes).lines) > 0)]


def command(*words: str) -> None:
    """Run a command; a line of a library that is missing raises MissingLibraryError."""
    complaint = io.StringIO()
    code: Any = 0
    with redirect_stderr(complaint), redirect_stdout(io.StringIO()):
        try:
            main_command(list(words))
        except SystemExit as end:
            code = end.code
    text = complaint.getvalue().strip()
    if code == 1 and "is not installed" in text and "\n" not in text:
        raise MissingLibraryError(text)
    if code:
        raise RuntimeError(f"exit code {code}: {text[-300:]}")


def drawn() -> Numbers:
    """`polhode draw` (extra `figures`)."""
    command("draw", "paper", "--out", "a.png")
    return [float(Path("a.png").stat().st_size > 0)]


def reported() -> Numbers:
    """`polhode report` (extra `site`)."""
    command("report", "--reports", ".", "--out", "site", "--quiet")
    return [float(Path("site", "index.html").stat().st_size > 0)]


def shared() -> Numbers:
    """A task for a Dask scheduler (extra `dask`)."""
    if not installed("distributed"):
        try:
            check_dask("tcp://127.0.0.1:1")
        except ValueError as error:
            raise MissingLibraryError(str(error)) from None
    from distributed import LocalCluster

    task = SimpleNamespace(key="one")
    with LocalCluster(
        n_workers=1, processes=False, dashboard_address=None, protocol="tcp"
    ) as cluster:
        check_dask(cluster.scheduler_address)
        return [outcome.value for outcome in dask(cluster.scheduler_address, one_of, [task])]


def one_of(task: Any) -> float:
    """What a task of Dask computes."""
    return float(task.key == "one")


def dataset() -> Numbers:
    """`to_xarray` (extra `data`)."""
    return [float(len(polhode.solve("paper", samples=3).to_xarray()["t"]))]


def parquet() -> Numbers:
    """`to_parquet` (extra `data`)."""
    polhode.solve("paper", samples=3).to_parquet("a.parquet")
    return [float(Path("a.parquet").stat().st_size > 0)]


EXTRAS: dict[str, Step] = {
    "plot": plotted,
    "draw": drawn,
    "report": reported,
    "dask": shared,
    "to_xarray": dataset,
    "to_parquet": parquet,
}


def steps(parts: list[str]) -> Iterator[tuple[str, Step]]:
    """Steps of the parts that are named; of all but the extras if none is."""
    if not parts or "forms" in parts:
        yield from ((f"form {name}", by_form(name)) for name in FORMS)
    if not parts or "solvers" in parts:
        yield from ((f"solver {name}", by_solver(name)) for name in SOLVERS)
    if not parts or "answers" in parts:
        yield "solve", default_run
        yield "pick", choice
        yield "solve_ivp", own_function
        yield "WorkPrecision", cost_against_accuracy
    if "extras" in parts:
        yield from EXTRAS.items()


def taken(step: Step) -> dict[str, Any]:
    """What a step answers."""
    try:
        return {"numbers": step()}
    except MissingLibraryError as error:
        return {"refused": str(error)}
    except Exception as error:
        return {"fault": f"{type(error).__name__}: {error}"}


def main() -> int:
    """Take all steps; 1 if any is a fault."""
    faults = 0
    for name, step in steps(sys.argv[1:]):
        began = time.monotonic()
        answer = taken(step)
        faults += "fault" in answer
        seconds = round(time.monotonic() - began, 2)
        print(json.dumps({"step": name, "seconds": seconds, **answer}), flush=True)
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
