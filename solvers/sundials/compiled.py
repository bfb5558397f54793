"""CVODE and IDA in machine code alone: field, Jacobian and the loop over rows are compiled, Python looks on in between.

A call takes a bounded number of steps, after which the library says "too much work" and goes on,
when called again, from where it stands: deadlines and Ctrl-C are looked at there, over the very
same steps. While it runs, numbers below 2e-308 count as zero, on x86 alone.
"""

import ctypes
import re
from collections.abc import Callable
from math import inf, ulp
from pathlib import Path
from typing import Any
from weakref import finalize

import numpy as np

from polhode.models.once import once
from polhode.models.problem import Factory, Problem
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Status, change
from polhode.solvers.machine_code.address import address_of
from polhode.solvers.machine_code.derivatives import trace_jacobian
from polhode.solvers.machine_code.llvm import MachineCode, compile_file
from polhode.solvers.machine_code.tracing import trace
from polhode.solvers.machine_code.underflow import FlushedToZero
from polhode.solvers.sundials.library import FAILURES, TOO_MUCH_WORK, Sundials, posed

# Steps between two looks at deadline and Ctrl-C. An estimate: they take some 0.02 to 0.1 s with the forms
# of the equations, longer with a field that costs more.
_CHUNK = 20_000
# IDA's IDA_YA_YDP_INIT (ida.h): `CalcIC` finds the algebraic components and the derivatives of the
# others.
_ALGEBRAIC = 1
# It takes the scale of time from a first output this far beyond the start, as scikit-sundae has it.
_BEYOND = 0.01
# The least step: at a step of 0, where it ends if the time stands still, CVODE's corrector repeats
# itself for ever. Far below the spacing of times, so that it changes no other run.
_LEAST_STEP = 1e-150


class ReportAt:
    """Places in the report that `rows.ll` writes: 64 bits each, whole numbers but for two doubles."""

    CODE = 0  # the library's last one
    STEPS = 1
    TIME = 2  # a double: the time reached
    RATES = 3  # evaluations of the field
    DIFFERENCES = 4  # further ones, for differences
    ERRORS = 5  # failed error tests
    FAILURES = 6  # steps whose correction failed
    JACOBIANS = 7
    FACTORIZATIONS = 8
    STEP = 9  # a double: the step to be tried next
    SIZE = 10


class Memory:
    """A problem in the library's memory, which is freed with this object; every run or segment of it begins anew.

    `method` has the arguments of the library's constructor: CVODE's number of the method, none of IDA.
    """

    def __init__(
        self, library: Sundials, problem: Problem, settings: Settings, method: tuple[int, ...]
    ) -> None:
        self.library = library
        self.implicit = library.prefix == "IDA"
        self.flushed_to_zero = FlushedToZero()
        d = problem.dimension
        self.mass, values = posed(problem, self.implicit)
        self.count = len(values)
        # The library holds pointers to these arrays, which live as long as this object. `data` is
        # what the field reads: parameters, then masses. `differential` is 1 for a component with
        # a derivative in the equations and 0 for an algebraic one.
        self.data = np.array([*values, *self.mass])
        self.start = np.array(problem.start)
        self.slope = np.zeros(d)
        self.residual = np.zeros(d)
        self.differential = (self.mass != 0).astype(float)
        # Things to free: the library's function, its argument, and the box that this points to.
        self._owned: list[tuple[str, int, Any]] = []
        finalize(self, _free, library, self._owned)

        box = ctypes.c_int64()
        library("SUNContext_Create", 0, ctypes.addressof(box))
        self._owned.append(("SUNContext_Free", ctypes.addressof(box), box))
        context = box.value
        library("SUNContext_ClearErrHandlers", context)
        # The library's views of these arrays: its "vectors".
        arrays = (self.start, self.slope, self.residual, self.differential)
        vectors = [self._vector(array, context) for array in arrays]
        self.state, self.rate, self.rest, identity = vectors
        # Vectors made after its image add several others at once: the same numbers, 5 % faster.
        library("N_VEnableFusedOps_Serial", self.state, 1)
        matrix = self._own("SUNMatDestroy", "SUNDenseMatrix", d, d, context)
        linear = self._own("SUNLinSolFree", "SUNLinSol_Dense", self.state, matrix, context)
        memory = ctypes.c_int64(library("Create", *method, context))
        self._owned.append(("Free", ctypes.addressof(memory), memory))
        self.address = memory.value

        self.field = _callback(library, "field", problem.field, d, len(values))
        self._set("Init", self.field.address, 0.0, *self._states)
        self._set("SetUserData", address_of(self.data))
        self._set_tolerances(settings, context)
        if settings.max_step < inf:
            self._set("SetMaxStep", settings.max_step)
        if settings.first_step is not None:
            self._set("SetInitStep", settings.first_step)
        self._set("SetLinearSolver", linear, matrix)
        self._set("SetMinStep", _LEAST_STEP)
        if settings.jacobian == "exact":
            self.jacobian = _callback(library, "jacobian", problem.field, d, len(values))
            self._set("SetJacFn", self.jacobian.address)
        if self.implicit:
            self._set("SetId", identity)
            # Time; vectors of state, slope and residual; the field's data.
            kind = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, *[ctypes.c_void_p] * 4)
            self._residual = self.field.function(kind)
        self._advance = _loop(library)
        self.report = np.zeros(ReportAt.SIZE, dtype=np.int64)
        # The same bits, of which two places are doubles.
        self.report_doubles = self.report.view(float)

    def _own(self, free: str, make: str, *arguments: int) -> int:
        """The address of an object that the function `make` makes, and `free` will free."""
        made = self.library(make, *arguments)
        self._owned.append((free, made, None))
        return made

    def _vector(self, array: np.ndarray, context: int) -> int:
        """An array, which is to live as long as this object, as the library's vector."""
        return self._own("N_VDestroy", "N_VMake_Serial", array.size, address_of(array), context)

    def _set(self, name: str, *arguments: float) -> None:
        """Call one of the library's functions whose first argument is its memory."""
        self.library(name, self.address, *arguments)

    def _set_tolerances(self, settings: Settings, context: int) -> None:
        if isinstance(settings.atol, tuple):
            self.absolute = np.array(settings.atol)
            self._set("SVtolerances", settings.tolerance, self._vector(self.absolute, context))
        else:
            self._set("SStolerances", settings.tolerance, float(settings.atols()))

    @property
    def _states(self) -> tuple[int, ...]:
        """The vectors of a state: CVODE's, or IDA's with the slope."""
        return (self.state, self.rate) if self.implicit else (self.state,)

    def begin(self, record: Record) -> None:
        """Start from a record's first row, which IDA makes consistent; RuntimeError where it cannot."""
        time = float(record.times[0])
        change(self.data, self.count, record)
        self.library("N_VSetArrayPointer", address_of(record.rows), self.state)
        if self.implicit:
            self.slope[:] = 0.0
            self._residual(time, *self._states, self.rest, address_of(self.data))
            np.divide(-self.residual, self.mass, out=self.slope, where=self.mass > 0)
        self._set("ReInit", time, *self._states)
        if not self.differential.all():
            self._set("CalcIC", _ALGEBRAIC, time + _BEYOND)
            self._set("GetConsistentIC", *self._states)
        self._set("SetStopTime", float(record.times[-1]))

    def advance(self, record: Record, most: int) -> int:
        """Go on until the end, a failure, or `most` steps since the start; returns the library's last code."""
        times = record.times
        rows = record.rows
        pointers = (
            self.address,
            self.state,
            self.rate,
            address_of(times),
            address_of(rows),
            address_of(self.report),
        )
        record.filled = self._advance(*pointers, record.filled, len(times), rows.shape[1], most)
        return int(self.report[ReportAt.CODE])


def integrator(memory: Memory, count: bool) -> Integrator:
    """An integrator that fills records, by a problem in the library's memory; `count` right-hand sides or not."""

    def integrate(record: Record) -> Outcome:
        try:
            memory.begin(record)
        except RuntimeError as error:
            return Status.STEP_UNDERFLOW, f"no consistent initial values: {error}"
        work = record.work
        steps = 0
        while True:
            with memory.flushed_to_zero:
                code = memory.advance(record, min(steps + record.chunk(_CHUNK), record.max_steps))
            record.now = float(memory.report_doubles[ReportAt.TIME])
            step = float(memory.report_doubles[ReportAt.STEP])
            report = memory.report.tolist()
            work.steps = steps = report[ReportAt.STEPS]
            work.rejected = report[ReportAt.ERRORS] + report[ReportAt.FAILURES]
            work.jacobians = report[ReportAt.JACOBIANS]
            work.factorizations = report[ReportAt.FACTORIZATIONS]
            rate_calls = report[ReportAt.RATES] + report[ReportAt.DIFFERENCES]
            work.rhs_calls = rate_calls if count else None
            if code >= 0:
                return Status.REACHED_END, ""
            # Steps below the spacing of numbers move the time now and then.
            if steps < record.max_steps and 0 < step <= ulp(record.now):
                return Status.STEP_UNDERFLOW, f"stalled at t = {record.now!r}"
            if code != TOO_MUCH_WORK:
                status, words = FAILURES.get(code, (Status.NON_FINITE, f"code {code}"))
                return status, f"{words} at t = {record.now!r}"
            if stopped := record.stopped or record.crawls(steps, record.now):
                return stopped

    return integrate


def _free(library: Sundials, owned: list[tuple[str, int, Any]]) -> None:
    """Free the library's objects, the latest first: later ones point to earlier ones."""
    for name, pointer, _ in reversed(owned):
        library(name, pointer)


@once()
def _callback(
    library: Sundials, what: str, factory: Factory, dimension: int, parameters: int
) -> MachineCode:
    """The "field" or its "jacobian" as the library calls it."""
    traced = trace if what == "field" else trace_jacobian
    lines = traced(factory, dimension, parameters, mass=library.prefix == "IDA")
    lines += _returned(lines)
    file = Path(__file__).with_name(f"{library.prefix.lower()}_{what}.ll")
    return compile_file(file, library, lines=lines, parameters=parameters)


def _returned(lines: str) -> str:
    """Lines by which a function returns 0, or 1 if an entry that it has written is not finite.

    The library then tries a shorter step. The sum of all entries times zero is NaN if one of them
    is infinite or NaN.
    """
    text = ""
    total = "0.0"
    for i, entry in enumerate(re.findall(r"store double (\S+),", lines)):
        text += f"\n%sum{i} = fadd reassoc double {total}, {entry}"
        total = f"%sum{i}"
    text += f"\n%none = fmul double {total}, 0.0"
    text += "\n%wrong = fcmp uno double %none, 0.0"
    text += "\n%code = zext i1 %wrong to i32"
    return f"{text}\nret i32 %code"


@once()
def _loop(library: Sundials) -> Callable[..., int]:
    """Fill rows ``first <= i < count`` in at most `most` steps since the start; the first row not filled."""
    implicit = library.prefix == "IDA"
    # IDASolve and IDAGetNumResEvals, where CVODE has CVode itself and CVodeGetNumRhsEvals.
    solve = "Solve" if implicit else ""
    kind = "Res" if implicit else "Rhs"
    fields = {
        "solve": library[solve],
        "arguments": "ptr %now_at, ptr %y, ptr %slope" if implicit else "ptr %y, ptr %now_at",
        "too_much_work": TOO_MUCH_WORK,
        "evaluations": library[f"GetNum{kind}Evals"],
        "differences": library[f"GetNumLin{kind}Evals"],
    }
    code = compile_file(Path(__file__).with_name("rows.ll"), library, **fields)
    # Six addresses and four whole numbers, as `Memory.advance` passes them.
    return code.function(
        ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 6, *[ctypes.c_int64] * 4)
    )
