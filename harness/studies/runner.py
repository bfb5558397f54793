"""Running a study into a store: batch by batch, so that an interrupted run is taken up where it stopped.

A batch has one scene, form and tolerance, and all solvers. Each case is run once and judged. Those that
reached their end are then timed in rounds, one run of each in a round: a slow moment of the machine meets all
of them. The "sentinel" is a fixed piece of arithmetic that shows such moments.
"""

import gc
from dataclasses import dataclass, field
from itertools import chain
from math import inf

from polhode.harness.common.machine import now, surroundings
from polhode.harness.common.progress import Steps
from polhode.harness.common.store import Record, Store
from polhode.harness.common.text import short
from polhode.harness.common.timing import Patience, Timing, sentinel
from polhode.harness.common.worker import ATTEMPTS, Failure, KilledFromOutsideError, Worker
from polhode.harness.studies.case import Case, attempt, judge, missing, time_once
from polhode.harness.studies.study import Study
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Backend, Jacobian, Status

# Seconds that a run may spend on compilation, beyond its time limit; at twice their sum it is killed. An
# estimate: compilation takes seconds, and a larger value only kills a process that hangs later. The sentinel,
# which takes milliseconds, has as many.
COMPILATION = 60.0
# A stopped run that was further off than this, in L and E over I_max, had gone wrong: a tighter
# tolerance may well be faster. L and E over I_max are of order 1 themselves.
SANE_ERROR = 1.0

# Cases that differ in tolerance alone: scene, St, form, solver, back end, Jacobian.
Group = tuple[str, float, str, str, Backend | None, Jacobian | None]


@dataclass
class Runner:
    """Runs what the store lacks of batches in a worker process, which is killed and replaced where need be.

    A case is lost if something else kills its process, such as a system without memory. The methods
    raise KilledFromOutsideError, after all else is stored, if cases were lost.
    """

    store: Store
    quiet: bool = False
    _worker: Worker = field(default_factory=Worker)
    # Records of runs that were stopped; tighter tolerances of their group, which come later, are not tried.
    _too_slow: dict[Group, Record] = field(default_factory=dict)
    _patience: Patience = field(init=False)
    _lost: int = field(default=0, init=False)  # cases whose process was killed from outside

    def __post_init__(self) -> None:
        self._patience = Patience(self._sentinel)

    def run(self, study: Study) -> list[Record]:
        """Run what the store does not hold yet and return the records of the whole study."""
        return self.run_batches(study.name, list(study.batches()))

    def run_batches(self, name: str, batches: list[list[Case]]) -> list[Record]:
        """The same of cases in batches, under a name that progress shows.

        Batches come by tolerance, the loosest first: a group that is too slow at one is not tried at the next.
        """
        stored_keys = self.store.keys()
        study_keys = [case.key for case in chain.from_iterable(batches)]
        measured = surroundings()
        progress = Steps(name, len(study_keys), "cases", self.quiet)
        with self._worker, progress:
            for batch in batches:
                fresh = [case for case in batch if case.key not in stored_keys]
                for case in batch:
                    record = self.store.result(case.key) if case.key in stored_keys else None
                    if record is not None and _too_slow(record):
                        self._too_slow.setdefault(_group(case), record)
                for case, record in self._measure(fresh, progress):
                    self.store.put(case.key, case.content, {**record, **measured})
                progress.advance(len(batch) - len(fresh))
        if self._lost:
            lost = f"{self._lost} of {len(study_keys)} cases were killed from outside {ATTEMPTS} times each"
            raise KilledFromOutsideError(f"{lost}, perhaps for want of memory")
        of_study = set(study_keys)
        return [record for record in self.store if record["key"] in of_study]

    def _measure(self, batch: list[Case], progress: Steps) -> list[tuple[Case, Record]]:
        """Records of a batch's cases: all are run once, then those that succeeded are timed in rounds.

        A case that fails when it is timed has failed, whatever its first run did.
        """
        # Garbage of the batch before goes now, not beside a run that is timed.
        gc.collect()
        records: dict[Case, Record] = {}
        for case in batch:
            stokes = short(case.scene.stokes)
            progress.detail(f"{case.solver} {short(case.tolerance)}, St = {stokes}")
            result = self._examine(case)
            progress.advance()
            if result is None:
                self._lost += 1
                continue
            records[case] = {"date": now(), "tags": list(case.tags), **result}
        timings = {case: Timing(()) for case, record in records.items() if _succeeded(record)}
        timed = list(timings)
        # The least time of the sentinel beside this batch.
        sentinel_seconds = self._patience.look() if batch else 0.0
        while timed:
            sentinel_seconds = min(sentinel_seconds, self._patience.steady())
            for case in timed:
                reply = self._worker.run(time_once, case, limit=case.max_seconds + COMPILATION)
                if reply.failure is Failure.LOST:
                    self._lost += 1
                    del records[case]
                elif reply.failure:
                    record = records[case]
                    failed = _failed(reply.failure, reply.message)
                    records[case] = {"date": record["date"], "tags": record["tags"], **failed}
                else:
                    timings[case] = timings[case].and_one(*reply.value)
            timed = [
                case for case in timed if _succeeded(records.get(case)) and timings[case].wants_more
            ]
        for case, timing in timings.items():
            if _succeeded(records.get(case)):
                records[case] |= {
                    "seconds": timing.seconds,
                    "seconds_spread": timing.spread,
                    "seconds_runs": list(timing.runs),
                    "disturbed": timing.disturbed or self._patience.busy(sentinel_seconds),
                }
        return [
            (case, {**record, "sentinel_seconds": sentinel_seconds})
            for case, record in records.items()
        ]

    def _sentinel(self) -> float:
        """The sentinel's time in the worker process; inf if that failed."""
        reply = self._worker.run(sentinel, limit=COMPILATION)
        return inf if reply.failure else float(reply.value)

    def _examine(self, case: Case) -> Record | None:
        """Record of a first run; None if it was killed from outside, which says nothing about the library."""
        if not find_solver(case.solver).available:
            return missing(case)
        earlier = self._too_slow.get(_group(case))
        if earlier is not None:
            return {
                "status": earlier["status"],
                "message": "at a looser tolerance already",
                "inferred": True,
            }
        reply = self._worker.run(attempt, case, limit=case.max_seconds + COMPILATION)
        if reply.failure is Failure.LOST:
            return None
        record = judge(case, *reply.value) if reply.value else _failed(reply.failure, reply.message)
        if _too_slow(record):
            self._too_slow[_group(case)] = record
        return record


def _failed(failure: Failure | None, message: str) -> Record:
    """The record of a case whose run took its process with it, or raised: nothing of it is inferred."""
    return how_failed(failure, message) | {"inferred": False}


def how_failed(failure: Failure | None, message: str) -> Record:
    """Status and message of a run that took its process with it, or raised."""
    status = Status.TIME_LIMIT if failure is Failure.KILLED else Status.CRASHED
    # The last line of a traceback says what was raised.
    return {"status": str(status), "message": message.strip().rpartition("\n")[2]}


def _succeeded(record: Record | None) -> bool:
    """Whether there is a record, of a case that has reached its end."""
    return record is not None and record["status"] == Status.REACHED_END


def _too_slow(record: Record) -> bool:
    """Whether tighter tolerances would be too slow as well: it was stopped, and not by other work or gone wrong."""
    stopped = record["status"] in (Status.TIME_LIMIT, Status.STEP_LIMIT) and not record.get(
        "disturbed"
    )
    return stopped and record.get("slow_error_so_far", 0.0) < SANE_ERROR


def _group(case: Case) -> Group:
    """The group of a case."""
    return case.scene_name, case.scene.stokes, case.form, case.solver, case.backend, case.jacobian
