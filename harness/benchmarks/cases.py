"""The suite's cases: a study like the one of `polhode bench`, changed by pytest's options.

`study` makes a study of `suite.toml` and the options. `Suite` sorts its cases by method, and lists
a row for each benchmark of pytest. `examine` runs a case once: the record says whether it has a
time.
"""

import os
import tomllib
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product
from math import inf
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from polhode.harness.common.store import Record
from polhode.harness.common.text import scientific, short
from polhode.harness.references.extended import ReferenceFailedError
from polhode.harness.references.reference import reference
from polhode.harness.references.uncertainty import least_known, uncertainty_of
from polhode.harness.studies.case import Case, attempt, judge, missing
from polhode.harness.studies.runner import SANE_ERROR
from polhode.harness.studies.study import Study, parse_study
from polhode.models.catalogue import FORMS, form as find_form, reference_form
from polhode.models.registry import plug_ins
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Status

# Durations of runs at St that the user gives (`--polhode-stokes`).
# St from which on the duration is in slow time. An estimate: the regime map changes at St = 10, and runs
# between are shorter here than there.
_SLOW_TIME_FROM = 1.0
_SLOW_TIME = 0.5  # Slow time from that St on, as in `suite.toml`.
# Inverse shear rates below that St and at St = inf, at most; as on the regime map.
_SHEAR_TIMES = 20.0
# Most relaxation times, each of St inverse shear rates, as of the stiff scenes in `suite.toml`: the
# reference of a stiff scene costs seconds.
_RELAXATION_TIMES = 2000.0
# Seconds that a reference in extended precision may take; an estimate. If it is expected to take longer,
# as in long runs, two unlike methods in double precision confirm each other.
_REFERENCE_SECONDS = 60.0
# For `--polhode-errors`: the loosest of these tolerances that meets a requested error is sought.
# Rounding leaves no use for a tighter one, and 0.01 is looser than anybody asks.
_TOLERANCES = tuple(float(f"1e-{exponent}") for exponent in range(2, 14))
# For `--polhode-quick`: a loose, a middle and a tight tolerance, and the time limit of a run, in
# seconds. With them, which are estimates, the quick suite takes some ten seconds.
_QUICK_TOLERANCES = (1e-3, 1e-7, 1e-11)
_QUICK_SECONDS = 0.02
# Name of a row whose runs reach their end, none of them with the requested error.
_NOT_MET = "error not met"

Method = tuple[str, float, str, str]
"""Name of the scene, St, form and solver."""


@dataclass(frozen=True)
class Options:
    """The plug-in's options of pytest; those not given are empty, and the suite decides."""

    stokes: tuple[float, ...] = ()
    forms: tuple[str, ...] = ()
    solvers: tuple[str, ...] = ()
    errors: tuple[float, ...] = ()  # requested errors, for a row each instead of one per tolerance
    want: str = "slow"  # which error: "slow" of L and E, or "orientation"
    with_forms: tuple[str, ...] = ()  # forms from outside, beside the others
    with_solvers: tuple[str, ...] = ()  # solvers from outside, beside the others
    quick: bool = False

    @property
    def error(self) -> str:
        """Name of the error in a record: "slow_error", relative to I_max, or "orientation_error", in rad."""
        return f"{self.want}_error"


@dataclass(frozen=True)
class Row:
    """One row of a table: a method at a tolerance, or at the loosest one that meets an error.

    The other one of `tolerance` and `error` is None.
    """

    method: Method
    tolerance: float | None
    error: float | None

    @property
    def name(self) -> str:
        """The row's name in pytest."""
        scene, stokes, form, solver = self.method
        last = f"{self.tolerance:g}" if self.error is None else f"error{self.error:g}"
        return f"{scene}-{stokes:g}-{form}-{solver}-{last}"

    @property
    def group(self) -> str:
        """Name of the row's table: there is one for each scene, St and requested error."""
        scene, stokes, _, _ = self.method
        return f"{scene}, St = {stokes:g}" + (
            "" if self.error is None else f", error {self.error:g}"
        )


@dataclass(frozen=True)
class Suite:
    """The cases that the options ask for, and the rows that pytest makes benchmarks of."""

    options: Options

    @cached_property
    def cases(self) -> dict[Method, list[Case]]:
        """The cases by method, from the loosest tolerance to the tightest.

        Raises ValueError, in one line, if an option names what is not there, or nothing is left.
        """
        cases: dict[Method, list[Case]] = {}
        for batch in study(self.options).batches():
            for case in batch:
                method = case.scene_name, case.scene.stokes, case.form, case.solver
                cases.setdefault(method, []).append(case)
        return cases

    def make_references(self, methods: Iterable[Method]) -> None:
        """Compute the references that some methods need, on all cores, before any run is timed.

        References are cached: examining a case finds them.
        """
        # A case for each reference: one of the full equations for a scene, and one more for each
        # averaged form.
        cases = {}
        for method in methods:
            case = self.cases[method][0]
            averaged = find_form(case.form).averaged
            cases.setdefault((case.scene, case.form if averaged else ""), case)
        if len(cases) < 2:
            # A single reference is not worth a process, which takes a second to begin.
            for case in cases.values():
                _make_reference(case)
            return
        # If a worker dies, its references are computed later, when a case is examined.
        context = get_context("spawn")
        with ProcessPoolExecutor(os.cpu_count(), context) as pool, suppress(BrokenProcessPool):
            list(pool.map(_make_reference, cases.values()))

    def rows(self) -> list[Row]:
        """All rows, method by method: one for each tolerance or, if requested, for each error."""
        errors = sorted(self.options.errors, reverse=True)
        rows: list[Row] = []
        for method, cases in self.cases.items():
            if errors:
                rows += [Row(method, None, error) for error in errors]
            else:
                rows += [Row(method, case.tolerance, None) for case in cases]
        return rows

    def choose(self, row: Row) -> tuple[Case, Record, str]:
        """The case of a row, its record, and why it has no time, which is empty if it has one."""
        cases = self.cases[row.method]
        if row.error is not None:
            return self._loosest_to_meet(cases, row.error)
        case = next(case for case in cases if case.tolerance == row.tolerance)
        record = examine(case, cases)
        return case, record, failure(record)

    def _loosest_to_meet(self, cases: list[Case], error: float) -> tuple[Case, Record, str]:
        """As `choose`, for a requested error: the loosest case that meets it, else the most accurate one."""
        best = cases[0]
        for case in cases:
            record = examine(case, cases)
            if meets(record, self.options.error, error):
                return case, record, ""
            best_record = examine(best, cases)
            if _error_of(record, self.options.error) <= _error_of(best_record, self.options.error):
                best = case
        record = examine(best, cases)
        return best, record, failure(record) or _why_not_met(record, self.options.error, error)


def _make_reference(case: Case) -> None:
    """Compute the reference of a case; a reference that fails says so when the case is judged."""
    averaged = find_form(case.form).averaged
    form = case.form if averaged else reference_form(case.scene)
    with suppress(ReferenceFailedError):
        reference(case.scene, form, case.samples, case.reference_seconds)


def study(options: Options) -> Study:
    """The suite as a study.

    Raises ValueError, in one line, if an option names what is not there, or nothing is left.
    """
    path = Path(__file__).with_name("suite.toml")
    contents = tomllib.loads(path.read_text(encoding="utf-8"))
    if options.quick:
        contents |= {"tolerances": list(_QUICK_TOLERANCES), "max_seconds": _QUICK_SECONDS}
        contents["scenes"] = _quick_scenes(contents["scenes"])
    if options.errors:
        contents["tolerances"] = list(_TOLERANCES)
    if options.stokes:
        scenes = dict.fromkeys(scene["name"] for scene in contents["scenes"])
        contents["scenes"] = [_scene_at(*pair) for pair in product(scenes, options.stokes)]
    # Forms of installed plug-ins are added to the suite's list. It has no list of solvers: all of
    # the catalogue take part, plug-ins' too.
    more_forms = (*_of_plug_ins(FORMS, "forms"), *options.with_forms)
    _limit_and_extend(contents, "forms", options.forms, more_forms)
    _limit_and_extend(contents, "solvers", options.solvers, options.with_solvers)
    return replace(parse_study(contents), reference_seconds=_REFERENCE_SECONDS)


def _quick_scenes(scenes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The scenes tagged "quick", without time limits of their own, which are longer."""
    return [
        {key: value for key, value in scene.items() if key != "max_seconds"}
        for scene in scenes
        if "quick" in scene.get("tags", ())
    ]


def _scene_at(name: str, stokes: float) -> dict[str, Any]:
    """A scene of the suite at a St that the user gives, which may be 0 or infinite."""
    if _SLOW_TIME_FROM <= stokes < inf:
        duration = {"slow_time": _SLOW_TIME}
    else:
        # At St = 0 the body follows the flow at once: relaxation is no limit.
        relaxed = _RELAXATION_TIMES * stokes if stokes > 0 else inf
        duration = {"time": min(_SHEAR_TIMES, relaxed)}
    return {"name": name, "stokes": stokes, "builtin": True, **duration}


def _limit_and_extend(
    contents: dict[str, Any], kind: str, named: Sequence[str], more: Sequence[str]
) -> None:
    """Limit the study's contents to the `named` forms or solvers if there are any, and add `more`.

    `kind` is "forms" or "solvers". A scene of the suite may have a list of its own, which names
    given by the user replace.
    """
    usual = contents.get(kind, list(SOLVERS))
    contents[kind] = list(dict.fromkeys([*(named or usual), *more]))
    for scene in contents["scenes"]:
        if named:
            scene.pop(kind, None)
        elif kind in scene:
            scene[kind] = [*scene[kind], *more]


def _of_plug_ins(catalogue: dict[str, str], kind: str) -> list[str]:
    """Names in a catalogue of a kind, "forms" or "solvers", that installed packages added."""
    return [name for name, target in plug_ins(kind).items() if catalogue.get(name) == target]


@cache
def _examined(case: Case) -> Record:
    """Run a case once: its status, errors and work."""
    if not find_solver(case.solver).available:
        return missing(case)
    try:
        tried = attempt(case)
    except Exception as error:
        return {"status": str(Status.CRASHED), "message": repr(error), "inferred": False}
    # A run that failed may have states beyond all bounds, whose errors are inf or NaN.
    with np.errstate(all="ignore"):
        return judge(case, *tried)


def examine(case: Case, cases: Sequence[Case]) -> Record:
    """Status, errors and work of a case; `cases` has its method's cases, from the loosest tolerance on.

    The case is not run if a looser tolerance was too slow already: its status is inferred. A looser
    run says nothing of tighter ones if it had gone wrong before it was stopped. It had if its error of L
    and E, over I_max, had come to `SANE_ERROR`.
    """
    for looser in cases[: cases.index(case)]:
        record = _examined(looser)
        error_so_far = record.get("slow_error_so_far", 0.0)
        if record["status"] == Status.TIME_LIMIT and error_so_far < SANE_ERROR:
            message = f"at tolerance {short(looser.tolerance)} already"
            return {"status": record["status"], "message": message, "inferred": True}
    return _examined(case)


def meets(record: Record, error: str, target: float) -> bool:
    """Whether a run reached its end with an error of at most a target that its reference resolves.

    `error` is the name of the error in the record.
    """
    resolved = least_known(record.get(uncertainty_of(error))) < target
    return not failure(record) and resolved and _error_of(record, error) <= target


def _error_of(record: Record, error: str) -> float:
    """The error of that name in a record; infinite where there is none."""
    value = record.get(error)
    return inf if failure(record) or value is None else float(value)


def failure(record: Record) -> str:
    """Status and reason of a run that did not reach its end; empty if it did."""
    if record["status"] == Status.REACHED_END:
        return ""
    return f"{record['status']}: {record.get('message') or 'no reason given'}"


def _why_not_met(record: Record, error: str, target: float) -> str:
    """Why a run that reached its end does not meet a target; see `meets`."""
    if record.get(error) is None:
        return f"{_NOT_MET}: its error is not known"
    least = least_known(record[uncertainty_of(error)])
    # As `least` is NaN where the uncertainty is not known, this is not `least >= target`.
    if not least < target:
        return f"{_NOT_MET}: the reference resolves errors above {scientific(least)} alone"
    return f"{_NOT_MET}: the error is {scientific(record[error])} at the best tolerance"
