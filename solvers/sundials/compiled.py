"""CVODE and IDA in machine code alone: field, Jacobian and the loop over rows are compiled, Python looks on in between.

A call takes a bounded number of steps, after which the library says "too much work" and goes on, when called again,
from where it stands: deadlines and Ctrl-C are looked at there, over the very same steps. While it runs, numbers below
2e-308 count as zero.
"""

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any
from weakref import finalize

import numpy as np

from polhode.models.problem import Problem
from polhode.solvers.contract import Integrator, Outcome, Record, Settings, Status
from polhode.solvers.machine_code.derivatives import trace_jacobian
from polhode.solvers.machine_code.llvm import MachineCode, Signature, compile_lines
from polhode.solvers.machine_code.tracing import FieldFactory, trace
from polhode.solvers.machine_code.underflow import FlushedToZero
from polhode.solvers.sundials.library import FAILURES, TOO_MUCH_WORK, Sundials, posed

# Steps between two looks at deadline and Ctrl-C: a tenth of a second at most.
CHUNK = 20_000
# What the loop reports: code, steps, time reached, and counts.
_CVODE_COUNTS = ("NumRhsEvals", "NumLinRhsEvals")
_IDA_COUNTS = ("NumResEvals", "NumLinResEvals")
_COUNTS = ("NumErrTestFails", "NumStepSolveFails", "NumJacEvals", "NumLinSolvSetups")
# IDA's "IDA_YA_YDP_INIT" and how far beyond the start it looks, as scikit-sundae has it.
_ALGEBRAIC, _BEYOND = 1, 0.01


class Memory:
    """A problem in the library's memory, which is freed with this object; every run or piece of it begins anew."""

    def __init__(self, library: Sundials, problem: Problem, settings: Settings, method: tuple[int, ...]) -> None:
        self.library, self.implicit = library, library.prefix == "IDA"
        d = problem.dimension
        self.mass, values = posed(problem, self.implicit)
        # The arrays live as long as what points to them.
        self.data, self.start = np.array([*values, *self.mass]), np.array(problem.start)
        self.slope, self.residual, self.differential = np.zeros(d), np.zeros(d), (self.mass != 0).astype(float)
        self._owned: list[tuple[str, int, Any]] = []
        finalize(self, _free, library, self._owned)

        box = ctypes.c_int64()
        library("SUNContext_Create", 0, ctypes.addressof(box))
        self._owned.append(("SUNContext_Free", ctypes.addressof(box), box))
        context = box.value
        library("SUNContext_ClearErrHandlers", context)
        arrays = (self.start, self.slope, self.residual, self.differential)
        vectors = [self._own("N_VDestroy", "N_VMake_Serial", d, each.ctypes.data, context) for each in arrays]
        self.state, self.rate, self.rest, identity = vectors
        # Vectors made after its image add several others at once: the same numbers, 5 % faster.
        library("N_VEnableFusedOps_Serial", self.state, 1)
        matrix = self._own("SUNMatDestroy", "SUNDenseMatrix", d, d, context)
        linear = self._own("SUNLinSolFree", "SUNLinSol_Dense", self.state, matrix, context)
        memory = ctypes.c_int64(library("Create", *method, context))
        self._owned.append(("Free", ctypes.addressof(memory), memory))
        self.address = memory.value

        self.field = _field(library, problem.field, d, len(values))
        self._set("Init", self.field.address, 0.0, *self._states)
        self._set("SetUserData", self.data.ctypes.data)
        self._set("SStolerances", settings.tolerance, settings.tolerance)
        self._set("SetLinearSolver", linear, matrix)
        if settings.jacobian == "exact":
            self.jacobian = _jacobian(library, problem.field, d, len(values))
            self._set("SetJacFn", self.jacobian.address)
        if self.implicit:
            self._set("SetId", identity)
            pointers = [ctypes.c_void_p] * 4
            self._residual = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, *pointers)(self.field.address)
        self._advance, self.report = _loop(library), np.zeros(9, dtype=np.int64)

    def _own(self, free: str, make: str, *arguments: int) -> int:
        made = self.library(make, *arguments)
        self._owned.append((free, made, None))
        return made

    def _set(self, name: str, *arguments: float) -> None:
        self.library(name, self.address, *arguments)

    @property
    def _states(self) -> tuple[int, ...]:
        return (self.state, self.rate) if self.implicit else (self.state,)

    def begin(self, record: Record) -> None:
        """Start from a record's first row, which IDA makes consistent; RuntimeError where it cannot."""
        time = float(record.times[0])
        self.library("N_VSetArrayPointer", record.rows.ctypes.data, self.state)
        if self.implicit:
            self.slope[:] = 0.0
            self._residual(time, *self._states, self.rest, self.data.ctypes.data)
            np.divide(-self.residual, self.mass, out=self.slope, where=self.mass > 0)
        self._set("ReInit", time, *self._states)
        if not self.differential.all():
            self._set("CalcIC", _ALGEBRAIC, time + _BEYOND)
            self._set("GetConsistentIC", *self._states)
        self._set("SetStopTime", float(record.times[-1]))

    def advance(self, record: Record, most: int) -> int:
        """Go on until the end, a failure or a number of steps; the library's last code."""
        times, rows = record.times, record.rows
        pointers = self.address, self.state, self.rate, times.ctypes.data, rows.ctypes.data, self.report.ctypes.data
        record.filled = self._advance(*pointers, record.filled, len(times), rows.shape[1], most)
        return int(self.report[0])


def integrator(memory: Memory, count: bool) -> Integrator:
    """Runs into records."""

    def integrate(record: Record) -> Outcome:
        try:
            memory.begin(record)
        except RuntimeError as error:
            return Status.STEP_UNDERFLOW, f"no consistent initial values: {error}"
        work, report, steps = record.work, memory.report, 0
        while True:
            with FlushedToZero():
                code = memory.advance(record, min(steps + CHUNK, record.max_steps))
            before, record.now = record.now, float(report.view(float)[2])
            _, work.steps, _, calls, linear, errors, failures, work.jacobians, work.factorizations = report.tolist()
            steps, work.rejected = work.steps, errors + failures
            work.rhs_calls = calls + linear if count else None
            if code >= 0:
                return Status.REACHED_END, ""
            if code != TOO_MUCH_WORK:
                status, words = FAILURES.get(code, (Status.NON_FINITE, f"code {code}"))
                return status, f"{words} at t = {record.now!r}"
            if steps >= record.max_steps:
                return Status.STEP_LIMIT, f"{steps} steps"
            if record.now == before:
                return Status.STEP_UNDERFLOW, f"stalled at t = {record.now!r}"
            if record.expired:
                return Status.TIME_LIMIT, f"after {steps} steps"

    return integrate


def _free(library: Sundials, owned: list[tuple[str, int, Any]]) -> None:
    for name, pointer, _ in reversed(owned):
        library(name, pointer)


@cache
def _field(library: Sundials, factory: FieldFactory, dimension: int, parameters: int) -> MachineCode:
    """CVODE's ``int f(double t, N_Vector y, N_Vector rate, void *p)``, or IDA's with its residual before p."""
    implicit = library.prefix == "IDA"
    vectors = {"y": "state", "slope": "rate", "out": "rest"} if implicit else {"y": "state", "out": "rate"}
    head = f"double %t, {', '.join(f'ptr %{vector}' for vector in vectors.values())}, ptr %p"
    arrays = {name: f"{library.address('N_VGetArrayPointer')}(ptr %{vector})" for name, vector in vectors.items()}
    return _callback(head, arrays, parameters, trace(factory, dimension, parameters, mass=implicit))


@cache
def _jacobian(library: Sundials, factory: FieldFactory, dimension: int, parameters: int) -> MachineCode:
    """The Jacobian of `_field`, as the library calls it."""
    implicit = library.prefix == "IDA"
    numbers, vectors = ("double %cj, ", "ptr %rest, ") if implicit else ("", "")
    head = f"double %t, {numbers}ptr %state, ptr %rate, {vectors}ptr %matrix, ptr %p, ptr, ptr, ptr"
    state, matrix = library.address("N_VGetArrayPointer"), library.address("SUNDenseMatrix_Data")
    arrays = {"y": f"{state}(ptr %state)", "out": f"{matrix}(ptr %matrix)"}
    return _callback(head, arrays, parameters, trace_jacobian(factory, dimension, parameters, mass=implicit))


def _callback(arguments: str, arrays: dict[str, str], parameters: int, lines: str) -> MachineCode:
    """A function of traced lines whose arrays are found by calls; the masses stand behind the parameters."""
    prologue = [f"%{name} = call ptr {found}" for name, found in arrays.items()]
    prologue.append(f"%mass = getelementptr double, ptr %p, i64 {parameters}")
    return compile_lines(Signature(f"i32 @function({arguments})", "\n".join(prologue), "i32 0"), lines)


@cache
def _loop(library: Sundials) -> Callable[..., int]:
    """Fill rows ``first <= i < count`` in at most `most` steps since the start; the first row not filled."""
    implicit = library.prefix == "IDA"

    counts = "\n".join(
        f"%place{i} = getelementptr i64, ptr %report, i64 {i + 3}\n"
        f"call i32 {library.address(f'Get{name}')}(ptr %memory, ptr %place{i})"
        for i, name in enumerate((*(_IDA_COUNTS if implicit else _CVODE_COUNTS), *_COUNTS))
    )
    solve = ("Solve", "ptr %now_at, ptr %y, ptr %slope") if implicit else ("", "ptr %y, ptr %now_at")
    lines = f"""
entry:
%steps_at = getelementptr i64, ptr %report, i64 1
%now_at = getelementptr i64, ptr %report, i64 2
br label %again
again:
%i = phi i64 [%first, %entry], [%next, %filled]
%more = icmp slt i64 %i, %count
br i1 %more, label %look, label %end
look:
%time_at = getelementptr double, ptr %times, i64 %i
%time = load double, ptr %time_at
call i32 {library.address("GetNumSteps")}(ptr %memory, ptr %steps_at)
%steps = load i64, ptr %steps_at
%left = sub i64 %most, %steps
%any_left = icmp sgt i64 %left, 0
br i1 %any_left, label %solve, label %spent
spent:
call i32 {library.address("GetCurrentTime")}(ptr %memory, ptr %now_at)
%now = load double, ptr %now_at
%within_step = fcmp ole double %time, %now
br i1 %within_step, label %solve, label %end
solve:
%allowed = select i1 %any_left, i64 %left, i64 1
call i32 {library.address("SetMaxNumSteps")}(ptr %memory, i64 %allowed)
%offset = mul i64 %i, %width
%row = getelementptr double, ptr %rows, i64 %offset
call void {library.address("N_VSetArrayPointer")}(ptr %row, ptr %y)
%code = call i32 {library.address(solve[0])}(ptr %memory, double %time, {solve[1]}, i32 1)
%good = icmp sge i32 %code, 0
br i1 %good, label %filled, label %end
filled:
%next = add i64 %i, 1
br label %again
end:
%last = phi i32 [0, %again], [{TOO_MUCH_WORK}, %spent], [%code, %solve]
%reported = sext i32 %last to i64
store i64 %reported, ptr %report
call i32 {library.address("GetNumSteps")}(ptr %memory, ptr %steps_at)
call i32 {library.address("GetCurrentTime")}(ptr %memory, ptr %now_at)
{counts}
"""
    pointers = "memory", "y", "slope", "times", "rows", "report"
    numbers = "first", "count", "width", "most"
    arguments = ", ".join([*(f"ptr %{name}" for name in pointers), *(f"i64 %{name}" for name in numbers)])
    code = compile_lines(Signature(f"i64 @function({arguments})", "", "i64 %i"), lines)
    types = [ctypes.c_void_p] * len(pointers) + [ctypes.c_int64] * len(numbers)
    function = ctypes.CFUNCTYPE(ctypes.c_int64, *types)(code.address)
    function.code = code  # pyright: ignore[reportAttributeAccessIssue]
    return function
