"""CVODE and IDA in machine code alone: field, Jacobian and the loop over rows are compiled, Python looks on in between.

A call takes a bounded number of steps, after which the library says "too much work" and goes on,
when called again, from where it stands: deadlines and Ctrl-C are looked at there, over the very
same steps. While it runs, numbers below 2e-308 count as zero.
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

# Steps between two looks at deadline and Ctrl-C: a tenth of a second at most.
_CHUNK = 20_000
# IDA's "IDA_YA_YDP_INIT" and how far beyond the start it looks, as scikit-sundae has it.
_ALGEBRAIC = 1
_BEYOND = 0.01


class Memory:
    """A problem in the library's memory, which is freed with this object; every run or segment of it begins anew."""

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
        # What to free: the library's function, its argument, and the box that this points to.
        self._owned: list[tuple[str, int, Any]] = []
        finalize(self, _free, library, self._owned)

        box = ctypes.c_int64()
        library("SUNContext_Create", 0, ctypes.addressof(box))
        self._owned.append(("SUNContext_Free", ctypes.addressof(box), box))
        context = box.value
        library("SUNContext_ClearErrHandlers", context)
        arrays = (self.start, self.slope, self.residual, self.differential)
        vectors = [self._vector(each, context) for each in arrays]
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
        # At a step of 0, where it ends if the time stands still, CVODE's corrector repeats itself
        # for ever.
        self._set("SetMinStep", 1e-150)
        if settings.jacobian == "exact":
            self.jacobian = _callback(library, "jacobian", problem.field, d, len(values))
            self._set("SetJacFn", self.jacobian.address)
        if self.implicit:
            self._set("SetId", identity)
            kind = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, *[ctypes.c_void_p] * 4)
            self._residual = self.field.function(kind)
        self._advance = _loop(library)
        # What `rows.ll` writes: the last code, steps, time, evaluations of the field, further ones
        # for differences, failed error tests, steps whose correction failed, Jacobians,
        # factorizations, and the step to be tried next. Time and step, at 2 and 9, are doubles in
        # the same 64 bits.
        self.report = np.zeros(10, dtype=np.int64)

    def _own(self, free: str, make: str, *arguments: int) -> int:
        made = self.library(make, *arguments)
        self._owned.append((free, made, None))
        return made

    def _vector(self, array: np.ndarray, context: int) -> int:
        """An array, which is to live as long as this object, as the library's vector."""
        return self._own("N_VDestroy", "N_VMake_Serial", array.size, address_of(array), context)

    def _set(self, name: str, *arguments: float) -> None:
        self.library(name, self.address, *arguments)

    def _set_tolerances(self, settings: Settings, context: int) -> None:
        if isinstance(settings.atol, tuple):
            self.absolute = np.array(settings.atol)
            self._set("SVtolerances", settings.tolerance, self._vector(self.absolute, context))
        else:
            self._set("SStolerances", settings.tolerance, float(settings.atols()))

    @property
    def _states(self) -> tuple[int, ...]:
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
        """Go on until the end, a failure or a number of steps; the library's last code."""
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
        return int(self.report[0])


def integrator(memory: Memory, count: bool) -> Integrator:
    """Runs into records."""

    def integrate(record: Record) -> Outcome:
        try:
            memory.begin(record)
        except RuntimeError as error:
            return Status.STEP_UNDERFLOW, f"no consistent initial values: {error}"
        work = record.work
        report = memory.report
        steps = 0
        while True:
            with memory.flushed_to_zero:
                code = memory.advance(record, min(steps + record.chunk(_CHUNK), record.max_steps))
            record.now, step = report.view(float)[[2, 9]].tolist()
            (
                _,
                work.steps,
                _,
                calls,
                linear,
                errors,
                failures,
                work.jacobians,
                work.factorizations,
                _,
            ) = report.tolist()
            steps = work.steps
            work.rejected = errors + failures
            work.rhs_calls = calls + linear if count else None
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
    for name, pointer, _ in reversed(owned):
        library(name, pointer)


@once()
def _callback(
    library: Sundials, what: str, factory: Factory, dimension: int, parameters: int
) -> MachineCode:
    """The "field" or its "jacobian" as the library calls it."""
    traced = trace if what == "field" else trace_jacobian
    lines = traced(factory, dimension, parameters, mass=library.prefix == "IDA")
    # The sum of the entries times zero is NaN if an entry is not finite: the function returns 1, and
    # the library tries a shorter step.
    total = "0.0"
    for i, entry in enumerate(re.findall(r"store double (\S+),", lines)):
        lines += f"\n%sum{i} = fadd reassoc double {total}, {entry}"
        total = f"%sum{i}"
    lines += f"\n%none = fmul double {total}, 0.0\n%wrong = fcmp uno double %none, 0.0"
    lines += "\n%code = zext i1 %wrong to i32\nret i32 %code"
    file = Path(__file__).with_name(f"{library.prefix.lower()}_{what}.ll")
    return compile_file(file, library, lines=lines, parameters=parameters)


@once()
def _loop(library: Sundials) -> Callable[..., int]:
    """Fill rows ``first <= i < count`` in at most `most` steps since the start; the first row not filled."""
    implicit = library.prefix == "IDA"
    solve, kind = ("Solve", "Res") if implicit else ("", "Rhs")
    fields = {"solve": library[solve], "too_much_work": TOO_MUCH_WORK}
    fields |= {
        "evaluations": library[f"GetNum{kind}Evals"],
        "differences": library[f"GetNumLin{kind}Evals"],
    }
    arguments = "ptr %now_at, ptr %y, ptr %slope" if implicit else "ptr %y, ptr %now_at"
    code = compile_file(Path(__file__).with_name("rows.ll"), library, arguments=arguments, **fields)
    return code.function(
        ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 6, *[ctypes.c_int64] * 4)
    )
