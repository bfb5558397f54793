"""The fixture `work_precision`: a problem by one solver, timed by pytest-benchmark, judged by a reference."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from polhode.harness.analysis.frames import rows_of
from polhode.harness.common.files import write_file
from polhode.harness.studies.setups import as_setups
from polhode.harness.work_precision import WorkPrecision
from polhode.models.problem import Problem
from polhode.solvers.contract import Solver, Status

# File of the counts beside the tests that ask for them.
_COUNTS_FILE = "work_counts.json"
# Counts of work that may be stored; those that a library does not report are not.
_COUNTS = ("rhs_calls", "steps", "jacobians", "factorizations")
# Another processor may round a last bit otherwise, and a few steps more follow. A count may exceed the
# stored one by a share of it, and by one more: 2 % of fewer than 50 steps are less than a step. Both
# numbers are estimates.
_SLACK = 0.02
_MORE = 1


@dataclass(frozen=True)
class Measured:
    """One run of a problem, judged.

    Parameters
    ----------
    solver : str
    tolerance : float
    status : str
        "reached_end", or how the run failed (`polhode.solvers.contract.Status`), or "refused" if the
        solver needs a compiled function and this one runs as plain Python.
    message : str
        Why it failed; empty after success.
    error : float or None
        As `WorkPrecision` measures it; None for a run that failed. By default it is the largest
        deviation of a component at any sample, over the component's largest magnitude.
    uncertainty : float or None
        How well the reference is known, in the same measure as `error`.
    seconds : float or None
        The fastest call of `solve`, as pytest-benchmark times it; the fastest integration alone, by
        `WorkPrecision`, where benchmarks are disabled. None for a run that failed.
    rhs_calls, steps, jacobians, factorizations : int or None
        Work of one run; None where the library does not report it.
    counts : Counts
        The test's stored counts, which `grown` compares with these.
    """

    solver: str
    tolerance: float
    status: str
    message: str
    error: float | None
    uncertainty: float | None
    seconds: float | None
    rhs_calls: int | None
    steps: int | None
    jacobians: int | None
    factorizations: int | None
    counts: "Counts" = field(repr=False, compare=False)

    @property
    def grown(self) -> dict[str, tuple[int, int]]:
        """Counts of work above the stored ones, by name: stored and now; empty if the work has not grown.

        The test fails if no counts are stored for it.
        """
        now = {name: getattr(self, name) for name in _COUNTS}
        return self.counts.grown({name: count for name, count in now.items() if count is not None})


@dataclass(frozen=True)
class Counts:
    """The stored counts of one test, in a file beside it."""

    path: Path
    test: str
    update: bool

    def grown(self, now: Mapping[str, int]) -> dict[str, tuple[int, int]]:
        """Which counts are above the stored ones; with ``--polhode-update-counts`` they are stored instead."""
        stored = self._read()
        if self.update:
            text = json.dumps({**stored, self.test: dict(now)}, indent=1, sort_keys=True)
            write_file(self.path, text + "\n")
            return {}
        if self.test not in stored:
            pytest.fail(
                f"{self.path}: no counts of {self.test}, expected some: "
                f"pytest --polhode-update-counts stores them",
                pytrace=False,
            )
        before = stored[self.test]
        return {
            name: (before[name], count)
            for name, count in now.items()
            if name in before and count > before[name] * (1 + _SLACK) + _MORE
        }

    def _read(self) -> dict[str, dict[str, int]]:
        """The stored counts by test and name; empty where no file is."""
        if not self.path.exists():
            return {}
        return json.loads(self.path.read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Measure:
    """The fixture: called once in a test, it runs a problem, has pytest-benchmark time it, and judges it."""

    request: pytest.FixtureRequest
    benchmark: Any

    def __call__(
        self,
        problem: Problem,
        solver: str | Solver | Callable[..., Any],
        tolerance: float,
        **study: Any,
    ) -> Measured:
        """Measure one run.

        Parameters
        ----------
        problem : Problem
            One's own (`Problem.from_function`) or a form's (`form("quaternion").problem(scene)`).
        solver : str, Solver or callable
            A function in place of a solver as `WorkPrecision` takes it.
        tolerance : float
        **study
            Further arguments of `WorkPrecision`: samples, max_seconds, atol, error, reference; not
            `over`, which would make several runs.

        Returns
        -------
        Measured

        Raises
        ------
        ValueError
            If an argument is out of range, or the solver does not accept the problem.
        """
        # A study of one row: one solver at one tolerance.
        study_case = WorkPrecision(problem, [solver], [tolerance], quiet=True, **study)
        (row,) = rows_of(study_case.frame)
        if row["status"] == Status.REACHED_END:
            (setup,) = as_setups([solver], study_case.one)
            self.benchmark(study_case.runner(setup, tolerance))
            # pytest-codspeed's fixture has none.
            stats = getattr(self.benchmark, "stats", None)
            if stats is not None:
                row["seconds"] = float(stats.stats.min)
        else:
            # Nothing is timed; the fixture would warn that it was not used.
            self.benchmark._mode = "work_precision"
        names = ("solver", "tolerance", "status", "message", "error", "uncertainty", "seconds")
        values = {name: row.get(name) for name in (*names, *_COUNTS)}
        self.benchmark.extra_info["polhode"] = {"problem": problem.name, **values}
        path = self.request.path.with_name(_COUNTS_FILE)
        # Files of tests in one folder share the counts, so their tests need names of their own.
        test = self.request.node.nodeid.partition("::")[2]
        update = bool(self.request.config.getoption("polhode_update_counts"))
        fields: dict[str, Any] = {**values, "counts": Counts(path, test, update)}
        return Measured(**fields)
