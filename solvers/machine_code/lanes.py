"""Maps of states, repeated for many particles at once in machine code: one particle in each SIMD lane.

A map is a straight line of arithmetic, traced like a vector field; its lines serve vectors of doubles as they are.
"""

import ctypes
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from polhode.solvers.machine_code.llvm import MachineCode, compile_file, host_features
from polhode.solvers.machine_code.tracing import Number, operand
from polhode.solvers.machine_code.underflow import FlushedToZero

Step = Callable[[Sequence[Any], Sequence[Any]], Sequence[Any]]

# Registers per operation: two keep the processor's pipelines full; more spill.
REGISTERS = 2


@cache
def width() -> int:
    """Particles, or rows, that this processor moves at once."""
    features = host_features()
    return REGISTERS * (8 if features.get("avx512f") else 4 if features.get("avx") else 2)


@dataclass(frozen=True)
class Lanes:
    """A compiled map; see `lanes`."""

    code: MachineCode
    dimension: int

    def march(self, starts: np.ndarray, rows: int, constants: np.ndarray, steps: int) -> np.ndarray:
        """States in lanes, shape (groups, rows, d, width), each row so many times the map of the one before.

        Of starts, shape (n, d), the last one fills the lanes that are left over.
        """
        groups = -(-len(starts) // width())
        states = np.empty((groups, rows, self.dimension, width()))
        filled = starts[np.minimum(np.arange(groups * width()), len(starts) - 1)]
        states[:, 0] = filled.reshape(groups, width(), self.dimension).swapaxes(1, 2)
        function = self.code.function(ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 3))
        with FlushedToZero():
            # The machine code tests after a row, not before.
            _ = rows > 1 and function(states.ctypes.data, constants.ctypes.data, steps, rows, groups)
        return states


def by_particle(states: np.ndarray, particles: int) -> np.ndarray:
    """States in lanes as states of particles, shape (particles, rows, d), component by component in memory."""
    groups, rows, dimension, wide = states.shape
    return np.moveaxis(states.transpose(2, 0, 3, 1).reshape(dimension, groups * wide, rows), 0, 2)[:particles]


def lanes(step: Step, dimension: int, constants: int, before: Step | None = None, after: Step | None = None) -> Lanes:
    """Compile ``step(y, constants) -> y`` over generic numbers; the constants are the same for all particles.

    Rows are states as the map `after` makes them of what is stepped, and the map `before` makes that of a row.
    """
    components = range(dimension)
    begun, before_lines = _traced(before, "before", [f"%row{i}" for i in components], constants)
    results, step_lines = _traced(step, "step", [f"%y{i}" for i in components], constants)
    rows, after_lines = _traced(after, "after", results, constants)
    fields: dict[str, Any] = {"vector": f"<{width()} x double>", "width": width()}
    fields |= {"constant": constants, "component": dimension}
    fields |= {"before": before_lines, "step": step_lines, "after": after_lines}
    for name, numbers in (("begun", begun), ("result", results), ("row", rows)):
        fields |= {f"{name}{i}": widened(number) for i, number in enumerate(numbers)}
    return Lanes(compile_file(Path(__file__).with_suffix(".ll"), **fields), dimension)


def _traced(step: Step | None, name: str, state: Sequence[str], constants: int) -> tuple[list[str], str]:
    """The numbers that a map makes of a state's, and the lines that do; the state's own if there is no map."""
    lines: dict[str, str] = {}
    given = [Number(lines, f"%c{i}") for i in range(constants)]
    numbers = [Number(lines, each) for each in state]
    made = numbers if step is None else step(numbers, given)

    def named(text: str) -> str:
        """Several maps stand in one function."""
        return re.sub(r"%v(\d+)", rf"%{name}_\1", text)

    text = "\n".join(f"{each} = {line}" for line, each in lines.items())
    return [named(operand(each)) for each in made], widened(named(text))


def widened(line: str, lanes: int = 0) -> str:
    """A line about numbers as one about vectors of them, of as many as this processor moves at once if not said."""
    lanes = lanes or width()
    line = re.sub(r"\bdouble\b", f"<{lanes} x double>", line)
    line = re.sub(r"\b0x[0-9A-F]{16}", lambda number: f"splat (double {number[0]})", line)
    line = re.sub(r"@llvm\.(\w+)\.f64", rf"@llvm.\1.v{lanes}f64", line)
    return line.replace("select i1", f"select <{lanes} x i1>").replace(", 0.0", ", zeroinitializer")
