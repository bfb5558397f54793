"""Cost against accuracy of several solvers on one problem, whatever it describes, and on classical test problems."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import inf
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from tqdm import tqdm

from polhode.harness.analysis.frames import rows_of
from polhode.harness.common.files import digest
from polhode.harness.common.machine import machine, versions
from polhode.harness.common.progress import Progress
from polhode.harness.common.store import Record, Store
from polhode.harness.common.timing import time_runs, within
from polhode.harness.common.worker import Failure, KilledFromOutsideError, Worker
from polhode.harness.ivp import check_samples
from polhode.harness.references.extended import reference_runs
from polhode.harness.references.reference import LONG_DOUBLE, SAFETY
from polhode.harness.references.uncertainty import least_known
from polhode.harness.studies.runner import COMPILATION, how_failed
from polhode.models.libraries import need
from polhode.models.problem import Problem
from polhode.models.problems.catalogue import PROBLEMS
from polhode.models.problems.classical import Classical
from polhode.models.registry import hint
from polhode.solvers.catalogue import SOLVERS, available_like, solver as find_solver
from polhode.solvers.compile import as_it_stands, check_field
from polhode.solvers.contract import Solver, Status
from polhode.solvers.solve import Solution, solve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Of the classical problems.
TOLERANCES, QUICK = tuple(10.0**-k for k in range(3, 13)), (1e-4, 1e-7, 1e-10)
# What the reference is compared with where the right-hand side branches.
BRANCHES = "cyrk-dop853", 1e-10


@dataclass(frozen=True)
class WorkPrecision:
    """A work-precision study of one problem: `frame` holds the rows, `plot` draws them.

    The column `error` is the largest deviation of any component at any sample from a Taylor
    solution in long double, over that component's largest magnitude; `uncertainty` is that of this
    reference, ten times the difference of two tolerances. Without heyoka, which runs Taylor's
    method, the reference is a run in double precision, and its uncertainty ten times the difference
    from a run by an unlike method. `seconds` is the fastest warm run. A line
    on the terminal says how far the study is.

    Parameters
    ----------
    problem : Problem
        One's own (`Problem.from_function`) or a form's (`form("quaternion").problem(scene)`).
    solvers : sequence of str or Solver, optional
        Catalogue names or solvers of one's own; by default every solver that accepts the problem.
    tolerances : sequence of float
    samples : int
        Equispaced times at which the error is measured.
    max_seconds : float
        Time limit of a run. A solver stopped by it does not run at tighter tolerances; the row
        stays.
    classical : Classical, optional
        A test problem: the error is that of the end, `Classical.error`, against the published one.
    """

    problem: Problem
    solvers: Sequence[str | Solver] | None = None
    tolerances: Sequence[float] = (1e-4, 1e-6, 1e-8, 1e-10)
    samples: int = 101
    max_seconds: float = 10.0
    quiet: bool = False
    classical: Classical | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.problem, Problem):
            expected = "expected a Problem: Problem.from_function(f, y0, t_end), or a form's"
            raise ValueError(f"problem: got {self.problem!r:.60}, {expected}")
        check_samples(self.samples)
        given = [*self.tolerances] if np.iterable(self.tolerances) else []
        if not (given and all(isinstance(each, Real) and each > 0 for each in given)):
            raise ValueError(f"tolerances: got {self.tolerances!r}, expected positive numbers")
        object.__setattr__(self, "problem", as_it_stands(self.problem))

    @cached_property
    def reference(self) -> tuple[np.ndarray, float]:
        """States in long double, shape (samples, d), and their uncertainty in the same measure as the errors."""
        if self.classical:
            # What the end is worth is part of the test problem.
            return np.array([self.problem.start, self.classical.reference]), 0.0
        states, loose = reference_runs(self.problem, self.times, LONG_DOUBLE)
        apart = SAFETY * self.error_of(loose, states)
        # Taylor's method sees no branch within a step.
        return states, max(
            apart, self._stepped(states) if getattr(self.problem.field, "branches", False) else 0.0
        )

    def _stepped(self, exact: np.ndarray) -> float:
        """How far a method that steps into kinks, begun anew at every sample, is from the reference."""
        states = [np.array(self.problem.start)]
        name, tolerance = BRANCHES
        for duration in np.diff(self.times).tolist():
            piece = replace(self.problem, start=tuple(states[-1].tolist()), end=duration)
            run = solve(piece, available_like(name), tolerance, max_seconds=self.max_seconds)
            if not run.success:
                return inf
            states.append(run.states[-1])
        return self.error_of(np.array(states), exact)

    @property
    def times(self) -> np.ndarray:
        """Sample times in the problem's own time."""
        return np.linspace(0.0, self.problem.end, self.samples)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """One row per solver and tolerance; `known` marks errors above ten times the reference's uncertainty."""
        check_field(self.problem)
        rows, methods = [], self._accepted()
        with Progress(self.quiet) as progress:
            progress.begin(f"{self.problem.name}: reference")
            exact, uncertainty = self.reference
            for i, method in enumerate(methods):
                progress.begin(
                    f"{self.problem.name}: {method.name}, {i + 1} of {len(methods)} solvers"
                )
                for tolerance in sorted(self.tolerances, reverse=True):
                    row = self._measure(method, tolerance, exact)
                    known = row["error"] is not None and row["error"] > least_known(uncertainty)
                    rows.append({**row, "uncertainty": uncertainty, "known": known})
                    if row["status"] == Status.TIME_LIMIT:
                        break
        return pd.DataFrame(rows)

    def plot(self, axes: "Axes") -> "Axes":
        """Draw wall time against error, grey where the reference does not resolve it; return the axes."""
        need("plot", "matplotlib")
        from polhode.harness.pages.figures.work_precision import work_precision

        names = {"error": "slow_error", "uncertainty": "slow_uncertainty"}
        work_precision(axes, self.frame.rename(columns=names).assign(form=""))
        axes.xaxis.set_inverted(True)
        axes.set(
            xlabel="largest relative error; more accurate to the right",
            ylabel="wall time of a warm run, s",
        )
        return axes

    def error_of(self, states: np.ndarray, exact: np.ndarray) -> float:
        """The largest deviation of any component, over that component's largest magnitude."""
        if self.classical:
            return self.classical.error(states[-1])
        size = np.max(np.abs(exact), axis=0)
        return float(np.max(np.abs(states - exact) / np.where(size > 0, size, 1)))

    def _accepted(self) -> list[Solver]:
        named = self.solvers is not None
        if isinstance(self.solvers, str) or (named and not self.solvers):
            raise ValueError(
                f"solvers: got {self.solvers!r}, expected a sequence: [{self.solvers or 'taylor'!r}]"
            )
        methods = [find_solver(name) for name in self.solvers or SOLVERS]
        return [each for each in methods if named or (each.available and each.takes(self.problem))]

    def _measure(self, method: Solver, tolerance: float, exact: np.ndarray) -> dict[str, Any]:
        def run(limit: float = self.max_seconds, *, count: bool = False) -> Solution:
            return solve(
                self.problem, method, tolerance, self.times, count=count, max_seconds=limit
            )

        solution, _ = within(
            self.max_seconds, partial(run, count=True), lambda own: own.status is Status.TIME_LIMIT
        )
        timing = time_runs(partial(run, inf)) if solution.success else None
        return {
            "solver": method.name,
            "tolerance": tolerance,
            "status": str(solution.status),
            "message": solution.message,
            "error": self.error_of(solution.states, exact) if solution.success else None,
            "seconds": timing.seconds if timing else None,
            "spread": timing.spread if timing else None,
            "implicit": method.implicit,
            **vars(solution.work),
        }


def measured(
    name: str, solver: str, tolerances: Sequence[float], max_seconds: float
) -> list[Record]:
    """Rows of one problem by one solver."""
    one = PROBLEMS[name]
    study = WorkPrecision(
        one.problem, [solver], tolerances, 2, max_seconds, quiet=True, classical=one
    )
    return rows_of(study.frame)


def run_problems(
    store: Store,
    names: Sequence[str] = (),
    solvers: Sequence[str] = (),
    *,
    quick: bool = False,
    quiet: bool = False,
) -> list[Record]:
    """Measure what the store lacks; return the rows of all, each with problem, machine, versions and date."""
    settings = {"tolerances": QUICK if quick else TOLERANCES, "max_seconds": 0.3 if quick else 3.0}
    pairs = pairs_of(names, solvers)
    cases = (
        {"problem": name, "solver": solver, **settings, "versions": versions()}
        for name, solver in pairs
    )
    wanted = {digest(case): case for case in cases}
    known, found = store.keys(), []
    limit = COMPILATION + len(settings["tolerances"]) * (settings["max_seconds"] + 2.0)
    progress = tqdm(
        wanted.items(), disable=quiet or None, unit="case", desc="problems", leave=False
    )
    with Worker() as worker, progress:
        for key, case in progress:
            if key in known:
                continue
            reply = worker.run(
                measured, case["problem"], case["solver"], *settings.values(), limit=limit
            )
            if reply.failure is Failure.LOST:
                raise KilledFromOutsideError(
                    f"{case['problem']} by {case['solver']}: {reply.message}"
                )
            nothing = {"solver": case["solver"], "tolerance": None}
            rows = (
                [nothing | how_failed(reply.failure, reply.message)]
                if reply.failure
                else reply.value
            )
            store.put(
                key,
                {"problem": case["problem"]},
                {"rows": rows, "machine": machine(), "versions": versions()},
            )
    for record in store:
        if record["key"] in wanted:
            kept = {name: record[name] for name in ("problem", "machine", "versions", "date")}
            found += [{**row, **kept} for row in record["rows"]]
    return found


def pairs_of(names: Sequence[str], solvers: Sequence[str]) -> list[tuple[str, str]]:
    """Problems, all unless named, each with every solver that takes it; ValueError by other names, or if none does."""
    for name in names:
        if name not in PROBLEMS:
            raise ValueError(
                f"scene: got {name!r}{hint(name, PROBLEMS)}, expected one of {', '.join(PROBLEMS)}"
            )

    def takes(solver: str, one: Classical) -> bool:
        method = find_solver(solver)
        return method.available and solver not in one.hopeless and method.takes(one.problem)

    own, methods = names or PROBLEMS, solvers or SOLVERS
    if pairs := [(name, each) for name in own for each in methods if takes(each, PROBLEMS[name])]:
        return pairs
    raise ValueError(
        f"solver: got {', '.join(methods)}, expected one that takes {' or '.join(own)}"
    )
