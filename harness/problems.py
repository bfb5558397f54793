"""Every solver on the classical test problems: cost against error of the published solution, into a store."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from tqdm import tqdm

from polhode.harness.common.files import digest
from polhode.harness.common.machine import machine, versions
from polhode.harness.common.store import Record, Store
from polhode.harness.common.worker import Failure, KilledFromOutsideError, Worker
from polhode.harness.work_precision import WorkPrecision
from polhode.models.problems.catalogue import PROBLEMS
from polhode.models.problems.classical import Classical
from polhode.models.registry import hint
from polhode.solvers.catalogue import SOLVERS, solver as find_solver

# Seconds for compilation, beyond the runs.
COMPILATION = 60.0
TOLERANCES, QUICK = tuple(10.0**-k for k in range(3, 13)), (1e-4, 1e-7, 1e-10)


@dataclass(frozen=True)
class AtTheEnd(WorkPrecision):
    """A study whose error is that of the end, `Classical.error`, against the published one."""

    classical: Classical | None = None

    @cached_property
    def reference(self) -> tuple[np.ndarray, float]:
        """The states at the start and the end; what the end is worth is part of the test problem."""
        assert self.classical is not None
        return np.array([self.problem.start, self.classical.reference]), 0.0

    def error_of(self, states: np.ndarray, exact: np.ndarray) -> float:
        """That of the end alone."""
        assert self.classical is not None
        return self.classical.error(states[-1])


def measured(name: str, solver: str, tolerances: Sequence[float], max_seconds: float) -> list[Record]:
    """Rows of one problem by one solver."""
    one = PROBLEMS[name]
    study = AtTheEnd(one.problem, [solver], tolerances, 2, max_seconds, quiet=True, classical=one)
    return study.frame.astype(object).where(study.frame.notna(), None).to_dict("records")  # pyright: ignore


def run_problems(
    store: Store, names: Sequence[str] = (), solvers: Sequence[str] = (), *, quick: bool = False, quiet: bool = False
) -> list[Record]:
    """Measure what the store lacks; return the rows of all, each with problem, machine, versions and date."""
    for name in names:
        if name not in PROBLEMS:
            raise ValueError(f"scene: got {name!r}{hint(name, PROBLEMS)}, expected one of {', '.join(PROBLEMS)}")
    settings = {"tolerances": QUICK if quick else TOLERANCES, "max_seconds": 0.3 if quick else 3.0}
    pairs = [(name, solver) for name in names or PROBLEMS for solver in solvers or SOLVERS if _takes(name, solver)]
    cases = [{"problem": name, "solver": solver, **settings, "versions": versions()} for name, solver in pairs]
    known = store.keys()
    limit = COMPILATION + len(settings["tolerances"]) * (settings["max_seconds"] + 2.0)
    with Worker() as worker, tqdm(cases, disable=quiet or None, unit="case", desc="problems", leave=False) as progress:
        for case in progress:
            key = digest(case)
            if key in known:
                continue
            reply = worker.run(measured, case["problem"], case["solver"], *settings.values(), limit=limit)
            if reply.failure is Failure.LOST:
                raise KilledFromOutsideError(f"{case['problem']} by {case['solver']}: {reply.message}")
            failed = [{"solver": case["solver"], "tolerance": None, "status": "crashed", "message": reply.message}]
            rows = reply.value if reply.failure is None else failed
            store.put(key, {"problem": case["problem"]}, {"rows": rows, "machine": machine(), "versions": versions()})
    wanted, found = {digest(case) for case in cases}, []
    for record in store:
        if record["key"] in wanted:
            kept = {name: record[name] for name in ("problem", "machine", "versions", "date")}
            found += [{**row, **kept} for row in record["rows"]]
    return found


def _takes(name: str, solver: str) -> bool:
    one, method = PROBLEMS[name], find_solver(solver)
    return method.available and solver not in one.hopeless and method.takes(one.problem)
