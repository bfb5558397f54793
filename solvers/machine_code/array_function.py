"""A compiled field as a built-in function of Python over NumPy arrays: a call takes 30 ns, through ctypes 900."""

import ctypes
from collections.abc import Callable, Mapping

import numpy as np

from polhode.solvers.machine_code.llvm import Signature, compile_lines

# NumPy's `PyArrayObject` and `PyArray_Descr` (ndarraytypes.h, alike in NumPy 1 and 2): where an array keeps its type,
# data, number of dimensions, their lengths, element type and flags; an element type its byte order and number.
_HEAD = object.__basicsize__
_TYPE, _DATA, _DIMENSIONS, _LENGTHS, _ELEMENT, _FLAGS = _HEAD - 8, *(_HEAD + 8 * i for i in (0, 1, 2, 5, 6))
_ORDER, _NUMBER = _HEAD + 10, _HEAD + 12
_READABLE, _WRITEABLE = 0x0101, 0x0501  # C-contiguous and aligned; writeable as well
# Python's flag of a function that receives its arguments as a C array.
_FASTCALL = 0x0080
_EXPECTED = b"expected one-dimensional contiguous arrays of float64, of the field's sizes, the last one writeable"


def _data() -> str:
    """The function of an array, a length and flags: where its data are, null if it is not what it should be."""
    requirements = (
        ("array", _TYPE, "ptr", f"inttoptr (i64 {id(np.ndarray)} to ptr)"),
        ("array", _DIMENSIONS, "i32", "1"),
        ("lengths", 0, "i64", "%length"),
        ("element", _ORDER, "i8", str(ord("="))),
        ("element", _NUMBER, "i32", str(np.dtype(float).num)),
    )
    lines = ["define internal ptr @data(ptr %array, i64 %length, i32 %flags) alwaysinline {"]

    def load(name: str, kind: str, base: str, offset: int) -> None:
        lines.append(f"%{name}_at = getelementptr i8, ptr %{base}, i64 {offset}\n%{name} = load {kind}, ptr %{name}_at")

    for i, (base, offset, kind, expected) in enumerate(requirements):
        if base != "array":
            load(f"{base}{i}", "ptr", "array", {"lengths": _LENGTHS, "element": _ELEMENT}[base])
        load(f"got{i}", kind, base if base == "array" else f"{base}{i}", offset)
        lines += [f"%is{i} = icmp eq {kind} %got{i}, {expected}", f"br i1 %is{i}, label %right{i}, label %wrong"]
        lines.append(f"right{i}:")
    load("got_flags", "i32", "array", _FLAGS)
    load("data", "ptr", "array", _DATA)
    lines += ["%common = and i32 %got_flags, %flags", "%usable = icmp eq i32 %common, %flags"]
    lines += ["%found = select i1 %usable, ptr %data, ptr null", "ret ptr %found", "wrong:", "ret ptr null", "}"]
    return "\n".join(lines)


class _Definition(ctypes.Structure):
    """Python's `PyMethodDef`."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


def array_function(lines: str, arrays: Mapping[str, int]) -> Callable[..., None]:
    """Compile traced lines into a function of arrays, by name and length, the last one ``out``.

    It raises a TypeError unless each is contiguous, of float64 and of its length.
    """
    message = ctypes.create_string_buffer(_EXPECTED)
    code = compile_lines(_signature(arrays, ctypes.addressof(message)), lines)
    definition = _Definition(b"field", code.address, _FASTCALL, None)
    new = ctypes.pythonapi.PyCFunction_NewEx
    new.argtypes, new.restype = [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p], ctypes.py_object
    # The function keeps alive what it is bound to.
    return new(ctypes.addressof(definition), (code, definition, message), None)


def _signature(arrays: Mapping[str, int], message: int) -> Signature:
    lines = [f"%few = icmp eq i64 %count, {len(arrays)}", "br i1 %few, label %check0, label %refuse"]
    for i, (name, size) in enumerate(arrays.items()):
        lines += [
            f"check{i}:",
            f"%at{i} = getelementptr ptr, ptr %arguments, i64 {i}",
            f"%array{i} = load ptr, ptr %at{i}",
            f"%{name} = call ptr @data(ptr %array{i}, i64 {size}, i32 {_WRITEABLE if name == 'out' else _READABLE})",
            f"%wrong{i} = icmp eq ptr %{name}, null",
            f"br i1 %wrong{i}, label %refuse, label %check{i + 1}",
        ]
    lines += [
        "refuse:",
        f"call void {_python('PyErr_SetString')}(ptr inttoptr (i64 {id(TypeError)} to ptr), "
        f"ptr inttoptr (i64 {message} to ptr))",
        "ret ptr null",
        f"check{len(arrays)}:",
        f"call void {_python('Py_IncRef')}(ptr inttoptr (i64 {id(None)} to ptr))",
    ]
    none = f"ptr inttoptr (i64 {id(None)} to ptr)"
    return Signature("ptr @function(ptr %self, ptr %arguments, i64 %count)", "\n".join(lines), none, _data())


def _python(name: str) -> str:
    """The address of a function of Python's own."""
    return f"inttoptr (i64 {ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value} to ptr)"
