"""Functions with loops and branches around traced numbers.

A program is written as it runs. This one counts the entries of an array before the first 0::

    program = Program("count", "x out")
    x, out = program.arguments
    out[0] = 0.0
    with program.repeat() as leave:
        n = out[0]
        leave(compare("ole", x[n], 0.0))
        out[0] = n + 1.0
    (count,) = compiled(program)

Python runs these lines once, and they write LLVM's: the body of a loop too is written once, and
`leave` writes a branch. So a Python variable such as `n` stands for the number that a line
computes, each time anew. Every number is a double, counts and indices included.

LLVM's text falls into *blocks*, each of which is entered at its beginning and left at its end; a
loop or a branch begins a new one. A number computed in one block may not exist in another. Those
that are to outlive their block lie in an `Array`; LLVM keeps small arrays of the program in
registers.
"""

import ctypes
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import factorial
from typing import Any

import numpy as np

from polhode.models.once import once
from polhode.models.operations import polynomial
from polhode.solvers.machine_code.llvm import compile_text, host_features
from polhode.solvers.machine_code.tracing import OPERATIONS, Number, operand

# Registers per operation: two keep the processor's pipelines full, as one waits for the result of
# its operation before; more do not fit into the registers that there are.
REGISTERS = 2


@once()
def width() -> int:
    """Particles, or rows, that this processor moves at once."""
    features = host_features()
    # Doubles in a register: of SSE2, which every x86-64 has, of AVX and of AVX-512.
    doubles = 2
    if features.get("avx"):
        doubles = 4
    if features.get("avx512f"):
        doubles = 8
    return REGISTERS * doubles


def widened(line: str, lanes: int = 0) -> str:
    """A line about numbers as one about vectors, by default as wide as this processor's.

    Types, constants, names of functions and conditions change, as in::

        %v7 = fmul contract double %v1, 0x4000000000000000
        %v7 = fmul contract <8 x double> %v1, splat (double 0x4000000000000000)
    """
    lanes = lanes or width()
    line = re.sub(r"\bdouble\b", f"<{lanes} x double>", line)
    line = re.sub(r"\b0x[0-9A-F]{16}", lambda number: f"splat (double {number[0]})", line)
    line = re.sub(r"@llvm\.(\w+)\.f64", rf"@llvm.\1.v{lanes}f64", line)
    return line.replace("select i1", f"select <{lanes} x i1>").replace(", 0.0", ", zeroinitializer")


class Program(dict[str, str]):
    """A function without result; its arguments are arrays and numbers.

    Numbers that are traced (`tracing.Number`) look up their lines in a dictionary, so that equal
    lines are written once. A program is that dictionary for the present block, name by line, and
    holds the text of all blocks. It is emptied where a block ends.

    Parameters
    ----------
    name : str
    arrays, numbers : str
        Names of the arguments, between blanks; arrays come first.
    linkage : str
        "internal" if other programs alone are to call it.
    attribute : str
        One of LLVM's for functions: "noinline", or `WIDEST_REGISTERS`.
    """

    def __init__(
        self, name: str, arrays: str, numbers: str = "", linkage: str = "", attribute: str = ""
    ) -> None:
        super().__init__()
        arguments = [f"ptr noalias %{argument}" for argument in arrays.split()]
        arguments += [f"double %{argument}" for argument in numbers.split()]
        self.head = f"define {linkage} void @{name}({', '.join(arguments)}) {attribute} {{\nstart:"
        self.name = name
        self.linkage = linkage
        # Lines of all blocks, and those that make room, which stand before them.
        self.text = []
        self.rooms = []
        # Names given so far.
        self.count = 0
        self.arguments: list[Any] = [Array(self, f"%{argument}") for argument in arrays.split()]
        self.arguments += [Number(self, f"%{argument}") for argument in numbers.split()]

    def __str__(self) -> str:
        """The function in LLVM's language."""
        return "\n".join([self.head, *self.rooms, *self.text, "ret void\n}"])

    def setdefault(self, line: str, _: str) -> str:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The number that a line computes, a new line or an equal one of this block."""
        if line not in self:
            self[line] = self.fresh(line)
        return self[line]

    def fresh(self, line: str) -> str:
        """The number that a line computes; an equal line before may have computed another one."""
        name = f"%{self.new()}"
        self.text.append(f"{name} = {line}")
        return name

    def new(self) -> str:
        """A name not used so far."""
        self.count += 1
        return f"v{self.count}"

    def room(self, size: int = 1, lanes: int = 1) -> "Array":
        """Space on the stack for `size` numbers, or for `size` vectors of one number a lane."""
        array = Array(self, f"%{self.new()}", lanes)
        self.rooms.append(f"{array.pointer} = alloca {array.kind}, i64 {size}")
        return array

    def cell(self, value: Any) -> "Array":
        """Space for a number that changes."""
        room = self.room()
        room[0] = value
        return room

    def call(self, callee: "Program", *arguments: Any) -> None:
        """Run another program."""
        operands = list[str]()
        for argument in arguments:
            is_array = isinstance(argument, Array)
            operands.append(
                f"ptr {argument.pointer}" if is_array else f"double {operand(argument)}"
            )
        self.text.append(f"call void @{callee.name}({', '.join(operands)})")

    def _begin(self, label: str) -> None:
        """End the present block, and begin one that follows it."""
        self.text += [f"br label %{label}", f"{label}:"]
        self.clear()

    def _branch(self, condition: str, yes: str, no: str, follows: str) -> None:
        """End the present block by a branch to one of two, and begin the one that `follows`."""
        self.text += [f"br i1 {condition}, label %{yes}, label %{no}", f"{follows}:"]
        self.clear()

    @contextmanager
    def when(self, condition: str) -> Iterator[None]:
        """Do what follows if a condition holds."""
        inside = self.new()
        after = self.new()
        self._branch(condition, inside, after, inside)
        yield
        self._begin(after)

    @contextmanager
    def repeat(self) -> Iterator[Callable[[str], None]]:
        """Do what follows again and again, until it is left on a condition."""
        begin = self.new()
        after = self.new()
        self._begin(begin)

        def leave(condition: str) -> None:
            following = self.new()
            self._branch(condition, after, following, following)

        yield leave
        self.text += [f"br label %{begin}", f"{after}:"]
        self.clear()

    @contextmanager
    def times(self, number: Any) -> Iterator[Number]:
        """Do what follows `number` times; yields how often it has been done."""
        done = self.cell(0.0)
        with self.repeat() as leave:
            now = done[0]
            leave(compare("oge", now, number))
            yield now
            done[0] = now + 1.0


class Wide(Number):
    """A number in each of several SIMD lanes."""

    def __init__(self, lines: dict[str, str], name: str, lanes: int) -> None:
        super().__init__(lines, name)
        self.lanes = lanes

    def emit(self, line: str) -> "Wide":
        return Wide(self.lines, super().emit(widened(line, self.lanes)).name, self.lanes)

    def total(self) -> Number:
        """The sum over the lanes, in the order that is quickest."""
        # -0.0 is where the sum begins: unlike 0.0 it leaves any number as it is.
        arguments = f"double {operand(-0.0)}, {widened('double', self.lanes)} {self.name}"
        return super().emit(
            f"call reassoc double @llvm.vector.reduce.fadd.v{self.lanes}f64({arguments})"
        )


def splat(number: Number, lanes: int) -> Number:
    """The same number in each lane."""
    if lanes == 1:
        return number
    vector = widened("double", lanes)
    # A vector with the number in lane 0; then one whose every lane is that one's lane 0.
    first = number.emit(f"insertelement {vector} poison, double {number.name}, i64 0")
    lane_0_for_all = f"{vector} poison, <{lanes} x i32> zeroinitializer"
    same = number.emit(f"shufflevector {vector} {first.name}, {lane_0_for_all}")
    return Wide(number.lines, same.name, lanes)


class Array:
    """Numbers in memory, by an index that is counted from 0: a constant, or a computed number.

    With lanes, a vector of one number for each lane stands at an index. ``array[i]`` writes the line
    that loads entry i, ``array[i] = x`` the one that stores x there, ``array + i`` is what begins
    at entry i.
    """

    def __init__(self, program: Program, pointer: str, lanes: int = 1) -> None:
        self.program = program
        self.pointer = pointer  # LLVM's name of the address of entry 0
        self.lanes = lanes
        # LLVM's type of an entry.
        self.kind = widened("double", lanes) if lanes > 1 else "double"

    def __add__(self, index: Any) -> "Array":
        """The array from the entry of that index on."""
        if not isinstance(index, Number):
            whole = int(index)
        else:
            whole = self.program.setdefault(f"fptosi double {index.name} to i64", "")
        place = self.program.setdefault(
            f"getelementptr {self.kind}, ptr {self.pointer}, i64 {whole}", ""
        )
        return Array(self.program, place, self.lanes)

    def __getitem__(self, index: Any) -> Number:
        # The same line again may load another number, as one may have been stored in between.
        name = self.program.fresh(f"load {self.kind}, ptr {(self + index).pointer}, align 8")
        return (
            Wide(self.program, name, self.lanes) if self.lanes > 1 else Number(self.program, name)
        )

    def __setitem__(self, index: Any, value: Any) -> None:
        line = f"store double {operand(value)}, ptr {(self + index).pointer}, align 8"
        self.program.text.append(widened(line, self.lanes) if self.lanes > 1 else line)

    def of(self, lanes: int) -> "Array":
        """The same place, with `lanes` numbers in each entry."""
        return Array(self.program, self.pointer, lanes)

    def load(self, size: int) -> tuple[Number, ...]:
        """The first numbers."""
        return tuple(self[i] for i in range(size))

    def store(self, values: Sequence[Any]) -> None:
        """Overwrite the first numbers."""
        for i, value in enumerate(values):
            self[i] = value


class Same:
    """Numbers in memory, each of them for all lanes."""

    def __init__(self, array: Array, lanes: int) -> None:
        self.array = array
        self.lanes = lanes

    def __getitem__(self, index: Any) -> Number:
        return splat(self.array[index], self.lanes)


def _expm1(x: Any) -> Any:
    """exp(x) - 1 by its series at x/128, doubled seven times; -1 below -40, NaN of NaN.

    Below -40 exp(x) is 4e-18, less than rounding of -1. For ``|x| <= 40`` the series' 13 terms err by
    3e-18 of its sum. ``v (v + 2)`` is exp(2x) - 1 where v is exp(x) - 1.
    """
    # NaN fails the condition, and stays.
    small = OPERATIONS.where_positive(-40.0 - x, -40.0, x) * (1 / 128)
    value = small * polynomial([1 / factorial(k) for k in range(1, 14)], small)
    for _ in range(7):
        value = value * (value + 2.0)
    return value


# Operations on numbers in lanes: C's library has no expm1 for vectors.
WIDE = replace(OPERATIONS, expm1=_expm1)
# A buffer of no bytes: it shows where an array begins.
_NOTHING = ctypes.c_char * 0
# Left to itself, LLVM halves the widest registers.
WIDEST_REGISTERS = '"prefer-vector-width"="512"'


def compare(how: str, left: Any, right: Any) -> str:
    """The condition that numbers compare as "olt", "ole", "ogt" or "oge": less, ..., greater or equal.

    NaN fulfils none of these, but "ult", "ule", "ugt" and "uge" (LLVM's ordered and unordered).
    """
    number: Any = left if isinstance(left, Number) else right
    return number.lines.setdefault(f"fcmp {how} double {operand(left)}, {operand(right)}", "")


def _address(array: np.ndarray) -> int:
    """Address of an array's numbers, in a quarter of NumPy's time unless the array is read-only."""
    try:
        return ctypes.addressof(_NOTHING.from_buffer(array))  # pyright: ignore[reportArgumentType]
    except TypeError:
        return array.__array_interface__["data"][0]


def compiled(*programs: Program, number: type = float, level: int = 1) -> list[Callable[..., None]]:
    """Compile programs together, which may call each other.

    Those that are not internal have arrays alone as arguments, and become functions, in order.

    The arrays, or their addresses, are contiguous and of the type named, float or x86's
    `numpy.longdouble`: nothing checks that. A call releases Python's lock. `level` goes to
    `llvm.compile_text`; programs of long loops gain nothing by more than 1.
    """
    engine = compile_text(
        "\n".join(str(program) for program in programs), level=level, extended=number is not float
    )

    def function(program: Program) -> Callable[..., None]:
        types = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(program.arguments))
        code = types(engine.get_function_address(program.name))

        def call(*arrays: np.ndarray | int) -> None:
            code(*[array if isinstance(array, int) else _address(array) for array in arrays])

        call.engine = engine  # pyright: ignore[reportFunctionMemberAccess]
        return call

    return [function(program) for program in programs if program.linkage != "internal"]
