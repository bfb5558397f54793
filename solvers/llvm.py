"""Vector fields in machine code: traced into LLVM's language over `Operations`, compiled by llvmlite in some 10 ms.

A field is a straight line of arithmetic. Called with numbers that write down what is done to them, it yields one line
for each operation, ``%v7 = fmul contract double %v1, %v4``. Equal lines are written once; arithmetic on constants is
Python's own. `contract` lets the processor round a*b + c once instead of twice, which changes the last bit and never
the meaning; the compiler may change nothing else.
"""

import inspect
import math
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from numbers import Real
from struct import pack, unpack
from typing import Any

from polhode.models.operations import Field, Operations

FieldFactory = Callable[[Operations], Field]

# Powers that are multiplied out.
MULTIPLIED_OUT = range(-16, 17)


class FieldError(ValueError):
    """A vector field does what no field may do; the message names file and line."""


class Number:
    """A traced number: the name of the line that computes it. Arithmetic appends further lines."""

    # NumPy's functions refuse it, and NumPy's numbers leave arithmetic to it.
    __array_ufunc__ = None
    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __init__(self, lines: dict[str, str], name: str) -> None:
        self.lines, self.name = lines, name

    def emit(self, line: str) -> "Number":
        """The number that a line computes, a new line or an equal one from before."""
        return Number(self.lines, self.lines.setdefault(line, f"%v{len(self.lines)}"))

    def __add__(self, other: Any) -> "Number":
        return _arithmetic("fadd", self, other)

    def __radd__(self, other: Any) -> "Number":
        return _arithmetic("fadd", other, self)

    def __sub__(self, other: Any) -> "Number":
        return _arithmetic("fsub", self, other)

    def __rsub__(self, other: Any) -> "Number":
        return _arithmetic("fsub", other, self)

    def __mul__(self, other: Any) -> "Number":
        return _arithmetic("fmul", self, other)

    def __rmul__(self, other: Any) -> "Number":
        return _arithmetic("fmul", other, self)

    def __truediv__(self, other: Any) -> "Number":
        return _arithmetic("fdiv", self, other)

    def __rtruediv__(self, other: Any) -> "Number":
        return _arithmetic("fdiv", other, self)

    def __neg__(self) -> "Number":
        return self.emit(f"fneg double {self.name}")

    def __pos__(self) -> "Number":
        return self

    def __pow__(self, exponent: Any) -> Any:
        if isinstance(exponent, Number) or exponent not in MULTIPLIED_OUT:
            return _call("pow", self, exponent)
        n = int(exponent)
        if n < 2:
            return (1.0, self)[n] if n >= 0 else 1.0 / self**-n
        half = self ** (n // 2)
        return half * half * self if n % 2 else half * half

    def __rpow__(self, base: Any) -> "Number":
        return _call("pow", base, self)

    def _compare(self, other: Any = None) -> bool:
        raise TypeError("a field cannot compare or branch; use ops.where_positive(x, a, b)")

    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _compare  # pyright: ignore

    def __float__(self) -> float:
        raise TypeError("a field cannot use float() or math's functions; use ops.sin, ops.cos, ops.sqrt")


def _operand(x: Any) -> str:
    """How a line refers to a number or a constant."""
    return x.name if isinstance(x, Number) else f"0x{unpack('<Q', pack('<d', float(x)))[0]:016X}"


def _arithmetic(instruction: str, left: Any, right: Any) -> Any:
    if not (isinstance(left, Number | Real) and isinstance(right, Number | Real)):
        return NotImplemented
    number: Any = left if isinstance(left, Number) else right
    return number.emit(f"{instruction} contract double {_operand(left)}, {_operand(right)}")


def _call(function: str, *arguments: Any) -> Any:
    """A mathematical function of numbers and constants."""
    wrong = next((x for x in arguments if not isinstance(x, Number | Real)), None)
    if wrong is not None:
        raise TypeError(f"{function}: got {wrong!r}, expected a number")
    number = next((x for x in arguments if isinstance(x, Number)), None)
    if number is None:
        return getattr(math, function)(*arguments)
    operands = ", ".join(f"double {_operand(x)}" for x in arguments)
    return number.emit(f"call contract double @llvm.{function}.f64({operands})")


def _where_positive(x: Any, a: Any, b: Any) -> Any:
    if not isinstance(x, Number):
        return a if x > 0 else b
    positive = x.emit(f"fcmp ogt double {x.name}, 0.0").name
    return x.emit(f"select i1 {positive}, double {_operand(a)}, double {_operand(b)}")


OPERATIONS = Operations(partial(_call, "sin"), partial(_call, "cos"), partial(_call, "sqrt"), _where_positive)


@dataclass(frozen=True)
class Signature:
    """A C function around a field, which reads arrays of doubles at the pointers %y, %p, ... and writes one at %out."""

    head: str
    # Lines before the field's, where those pointers are no arguments.
    prologue: str = ""
    result: str = "void"
    # Functions that the prologue calls.
    helpers: str = ""


# What CyRK calls: void(double *dy, double t, double *y, double *p).
CALLBACK = Signature("void @function(ptr %out, double %t, ptr %y, ptr %p)")


def counting(signature: Signature, parameters: int) -> Signature:
    """A function that counts its calls: behind the parameters stands the address of an integer of eight bytes."""
    lines = f"""
%counter_at = getelementptr double, ptr %p, i64 {parameters}
%counter = load ptr, ptr %counter_at
%before = load i64, ptr %counter
%after = add i64 %before, 1
store i64 %after, ptr %counter
"""
    return replace(signature, prologue=signature.prologue + lines)


@cache
def trace(factory: FieldFactory, dimension: int, parameters: int, mass: bool = False) -> str:
    """LLVM's lines that compute a field's rates, read at %y and %p and written at %out.

    Parameters
    ----------
    factory : callable
    dimension, parameters : int
        Lengths of the state y and of p.
    mass : bool
        Compute the residual ``mass * slope - field(y, p)`` instead, with two further arrays %slope and %mass.

    Raises
    ------
    FieldError
        If the field does what no field may do.
    """
    lines: dict[str, str] = {}

    def array(name: str, size: int) -> tuple[Number, ...]:
        start = Number(lines, f"%{name}")
        places = [start.emit(f"getelementptr double, ptr %{name}, i64 {i}") for i in range(size)]
        return tuple(place.emit(f"load double, ptr {place.name}") for place in places)

    rates = _evaluate(factory, array("y", dimension), array("p", parameters))
    if mass:
        slopes, masses = array("slope", dimension), array("mass", dimension)
        rates = [m * slope - rate for m, slope, rate in zip(masses, slopes, rates, strict=True)]
    text = [f"{name} = {line}" for line, name in lines.items()]
    for i, rate in enumerate(rates):
        text += [f"%out{i} = getelementptr double, ptr %out, i64 {i}", f"store double {_operand(rate)}, ptr %out{i}"]
    return "\n".join(text)


def _evaluate(factory: FieldFactory, y: tuple[Number, ...], p: tuple[Number, ...]) -> tuple[Any, ...]:
    """The rates of a traced state, or the place where the field goes wrong."""
    rhs = factory(OPERATIONS)
    code = getattr(rhs, "__code__", None)
    place = f"{code.co_filename}:{code.co_firstlineno}" if code else repr(rhs)
    names = list(inspect.signature(rhs).parameters)
    if len(names) != 2 or names[0] == "t":
        raise FieldError(f"{place}: got rhs({', '.join(names)}), expected rhs(y, p)")
    try:
        rates = rhs(y, p)
    except Exception as error:
        frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename != __file__]
        where, line = (f"{frames[-1].filename}:{frames[-1].lineno}", frames[-1].line) if frames else (place, "")
        raise FieldError(f"{where}: {error}: {line}") from error
    if not isinstance(rates, tuple | list) or len(rates) != len(y):
        got = f"{len(rates)} rates" if isinstance(rates, tuple | list) else f"{type(rates).__name__!r}"
        raise FieldError(f"{place}: got {got}, expected a tuple of {len(y)}, one per component of the state")
    wrong = next((rate for rate in rates if not isinstance(rate, Number | Real)), None)
    if wrong is not None:
        raise FieldError(f"{place}: got the rate {wrong!r}, expected a number")
    return tuple(rates)


@dataclass(frozen=True)
class MachineCode:
    """A compiled function, which lives as long as this object."""

    address: int
    engine: Any


def compile_lines(signature: Signature, lines: str) -> MachineCode:
    """Compile a function for this processor."""
    llvm = _llvm()
    text = f"define {signature.head} {{\n{signature.prologue}\n{lines}\nret {signature.result}\n}}"
    module = llvm.parse_assembly("\n".join([_DECLARATIONS, signature.helpers, text]))
    target = llvm.Target.from_default_triple()
    machine = target.create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=3
    )
    passes = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    passes.getModulePassManager().run(module, passes)
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    return MachineCode(engine.get_function_address("function"), engine)


@cache
def _llvm() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


_DECLARATIONS = """
declare double @llvm.sin.f64(double)
declare double @llvm.cos.f64(double)
declare double @llvm.sqrt.f64(double)
declare double @llvm.pow.f64(double, double)
"""
