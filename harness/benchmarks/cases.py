"""The suite's cases: a study like the one of `polhode bench`, limited or extended by pytest's options."""

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

# Durations of runs.
_SLOW_FROM = 1.0  # St from which on the duration is in slow time.
_SLOW_TIME = 0.5  # Slow time from that St on.
_SHEAR_TIMES = 20.0  # Inverse shear rates below that St.
# Relaxation times at most: the reference of a stiff scene costs seconds.
_RELAXATION_TIMES = 2000.0
# Seconds that a reference may take. If extended precision would take longer, as in long runs, two
# unlike methods in double precision confirm each other.
_REFERENCE_SECONDS = 60.0
# The loosest of these tolerances that meets a requested error is sought.
_TOLERANCES = tuple(float(f"1e-{exponent}") for exponent in range(2, 14))
_QUICK_TOLERANCES = (1e-3, 1e-7, 1e-11)
# Time limit of each of the quick suite's runs, in seconds.
_QUICK_SECONDS = 0.02
# Name of a row whose runs reach their end, none of them with the requested error.
_NOT_MET = "error not met"

Method = tuple[str, float, str, str]
"""Name of the scene, St, form and solver."""


@dataclass(frozen=True)
class Options:
    """Pytest's options: empty and None where they say nothing."""

    stokes: tuple[float, ...] = ()
    forms: tuple[str, ...] = ()
    solvers: tuple[str, ...] = ()
    errors: tuple[float, ...] = ()
    want: str = "slow"
    with_forms: tuple[str, ...] = ()
    with_solvers: tuple[str, ...] = ()
    quick: bool = False

    @property
    def error(self) -> str:
        """Name of the error in a record: "slow_error", relative to I_max, or "orientation_error", in rad."""
        return f"{self.want}_error"


@dataclass(frozen=True)
class Row:
    """One row of the table: a method at a tolerance, or at the loosest tolerance that meets an error."""

    method: Method
    tolerance: float | None
    error: float | None

    @property
    def name(self) -> str:
        """Its name in pytest."""
        scene, stokes, form, solver = self.method
        last = f"{self.tolerance:g}" if self.error is None else f"error{self.error:g}"
        return f"{scene}-{stokes:g}-{form}-{solver}-{last}"

    @property
    def group(self) -> str:
        """Name of its table."""
        scene, stokes, _, _ = self.method
        return f"{scene}, St = {stokes:g}" + (
            "" if self.error is None else f", error {self.error:g}"
        )


@dataclass(frozen=True)
class Suite:
    """The cases by method, from the loosest tolerance to the tightest."""

    options: Options

    @cached_property
    def cases(self) -> dict[Method, list[Case]]:
        """ValueError, in one line, if an option names what is not there, or nothing is left."""
        cases: dict[Method, list[Case]] = {}
        for batch in study(self.options).batches():
            for case in batch:
                method = case.scene_name, case.scene.stokes, case.form, case.solver
                cases.setdefault(method, []).append(case)
        return cases

    def make_references(self, methods: Iterable[Method]) -> None:
        """Compute the references that some methods need, on all cores: they are cached, and not waited for again."""
        cases = {}
        for method in methods:
            case = self.cases[method][0]
            averaged = find_form(case.form).averaged
            cases.setdefault((case.scene, case.form if averaged else ""), case)
        if len(cases) < 2:
            # Not worth a process, which takes a second to begin.
            for case in cases.values():
                _make_reference(case)
            return
        context = get_context("spawn")
        with ProcessPoolExecutor(os.cpu_count(), context) as pool, suppress(BrokenProcessPool):
            list(pool.map(_make_reference, cases.values()))

    def rows(self) -> list[Row]:
        """All rows, method by method: the tolerances, or the requested errors from the largest on."""
        errors = sorted(self.options.errors, reverse=True)
        rows: list[Row] = []
        for method, cases in self.cases.items():
            if errors:
                rows += [Row(method, None, error) for error in errors]
            else:
                rows += [Row(method, case.tolerance, None) for case in cases]
        return rows

    def choose(self, row: Row) -> tuple[Case, Record, str]:
        """The case of a row, its record, and why it has no time: empty if it has one."""
        cases = self.cases[row.method]
        if row.error is not None:
            return self._loosest(cases, row.error)
        case = next(case for case in cases if case.tolerance == row.tolerance)
        record = examine(case, cases)
        return case, record, failure(record)

    def _loosest(self, cases: list[Case], error: float) -> tuple[Case, Record, str]:
        best = cases[0]
        for case in cases:
            record = examine(case, cases)
            if meets(record, self.options.error, error):
                return case, record, ""
            if _error(record, self.options.error) <= _error(
                examine(best, cases), self.options.error
            ):
                best = case
        record = examine(best, cases)
        return best, record, failure(record) or _missed(record, self.options.error, error)


def _make_reference(case: Case) -> None:
    """Compute the references of a case; what fails says so when the case is judged."""
    averaged = find_form(case.form).averaged
    form = case.form if averaged else reference_form(case.scene)
    with suppress(ReferenceFailedError):
        reference(case.scene, form, case.samples, case.reference_seconds)


def study(options: Options) -> Study:
    """The suite as a study; ValueError, in one line, if an option names what is not there, or nothing is left."""
    path = Path(__file__).with_name("suite.toml")
    contents = tomllib.loads(path.read_text(encoding="utf-8"))
    if options.quick:
        contents |= {"tolerances": list(_QUICK_TOLERANCES), "max_seconds": _QUICK_SECONDS}
        contents["scenes"] = _quick(contents["scenes"])
    if options.errors:
        contents["tolerances"] = list(_TOLERANCES)
    if options.stokes:
        scenes = dict.fromkeys(scene["name"] for scene in contents["scenes"])
        contents["scenes"] = [_scene(*pair) for pair in product(scenes, options.stokes)]
    _choose(contents, "forms", options.forms, (*_of_plug_ins(FORMS, "forms"), *options.with_forms))
    _choose(contents, "solvers", options.solvers, options.with_solvers)
    return replace(parse_study(contents), reference_seconds=_REFERENCE_SECONDS)


def _quick(scenes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those tagged for a look, and time limits short."""
    return [
        {key: value for key, value in scene.items() if key != "max_seconds"}
        for scene in scenes
        if "quick" in scene.get("tags", ())
    ]


def _scene(name: str, stokes: float) -> dict[str, Any]:
    """A scene of the suite at another St."""
    if _SLOW_FROM <= stokes < inf:
        duration = {"slow_time": _SLOW_TIME}
    else:
        relaxed = _RELAXATION_TIMES * stokes if stokes > 0 else inf
        duration = {"time": min(_SHEAR_TIMES, relaxed)}
    return {"name": name, "stokes": stokes, "builtin": True, **duration}


def _choose(contents: dict[str, Any], kind: str, named: Sequence[str], more: Sequence[str]) -> None:
    """Limit the study to the named forms or solvers, and add those from outside."""
    usual = contents.get(kind, list(SOLVERS))
    contents[kind] = list(dict.fromkeys([*(named or usual), *more]))
    for scene in contents["scenes"]:
        if named:
            scene.pop(kind, None)
        elif kind in scene:
            scene[kind] = [*scene[kind], *more]


def _of_plug_ins(catalogue: dict[str, str], kind: str) -> list[str]:
    """Names in a catalogue that installed packages added."""
    return [name for name, target in plug_ins(kind).items() if catalogue.get(name) == target]


@cache
def _examined(case: Case) -> Record:
    """Status, errors and work of a case."""
    if not find_solver(case.solver).available:
        return missing(case)
    try:
        tried = attempt(case)
    except Exception as error:
        return {"status": str(Status.CRASHED), "message": repr(error), "inferred": False}
    # States that have grown beyond all bounds are data as well.
    with np.errstate(all="ignore"):
        return judge(case, *tried)


def examine(case: Case, cases: Sequence[Case]) -> Record:
    """The same, inferred where a looser tolerance of the method was too slow already."""
    for looser in cases[: cases.index(case)]:
        record = _examined(looser)
        off = record.get("slow_error_so_far", 0.0)
        if record["status"] == Status.TIME_LIMIT and off < SANE_ERROR:
            message = f"at tolerance {short(looser.tolerance)} already"
            return {"status": record["status"], "message": message, "inferred": True}
    return _examined(case)


def meets(record: Record, error: str, target: float) -> bool:
    """Whether a run reached its end with an error that meets a target which its reference resolves."""
    resolved = least_known(record.get(uncertainty_of(error))) < target
    return not failure(record) and resolved and _error(record, error) <= target


def _error(record: Record, error: str) -> float:
    """The error of a run; infinite where there is none."""
    value = record.get(error)
    return inf if failure(record) or value is None else float(value)


def failure(record: Record) -> str:
    """Status and reason of a run that did not reach its end; empty if it did."""
    if record["status"] == Status.REACHED_END:
        return ""
    return f"{record['status']}: {record.get('message') or 'no reason given'}"


def _missed(record: Record, error: str, target: float) -> str:
    """Why a run that reached its end does not count for an error."""
    if record.get(error) is None:
        return f"{_NOT_MET}: its error is not known"
    least = least_known(record[uncertainty_of(error)])
    if not least < target:
        return f"{_NOT_MET}: the reference resolves errors above {scientific(least)} alone"
    return f"{_NOT_MET}: the error is {scientific(record[error])} at the best tolerance"
