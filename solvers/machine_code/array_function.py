"""A compiled field as a built-in function of Python over NumPy arrays: a call takes 30 ns, through ctypes 900."""

import ctypes
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from polhode.solvers.machine_code.llvm import compile_file

_HEAD = object.__basicsize__
# NumPy's `PyArrayObject` and `PyArray_Descr` (ndarraytypes.h, alike in NumPy 1 and 2): where an array keeps its type,
# data, number of dimensions, their lengths, element type and flags; an element type its byte order and number.
_PLACES = {
    "type_at": _HEAD - 8,
    "data_at": _HEAD,
    "dimensions_at": _HEAD + 8,
    "lengths_at": _HEAD + 16,
    "element_at": _HEAD + 40,
    "flags_at": _HEAD + 48,
    "order_at": _HEAD + 10,
    "number_at": _HEAD + 12,
}
# What is expected there, and what else the function knows of Python.
_VALUES = {"native": ord("="), "double": np.dtype(float).num, "ndarray": id(np.ndarray)}
_VALUES |= {"type_error": id(TypeError), "none": id(None)}
_READABLE, _WRITEABLE = 0x0101, 0x0501  # C-contiguous and aligned; writeable as well
# Python's flag of a function that receives its arguments as a C array.
_FASTCALL = 0x0080
_EXPECTED = b"expected one-dimensional contiguous arrays of float64, of the field's sizes, the last one writeable"


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
    python, message = ctypes.pythonapi, ctypes.create_string_buffer(_EXPECTED)
    calls = {name: ctypes.cast(python[name], ctypes.c_void_p).value for name in ("PyErr_SetString", "Py_IncRef")}
    checks = "\n".join(_check(i, name, length) for i, (name, length) in enumerate(arrays.items()))
    own = {"lines": lines, "checks": checks, "count": len(arrays), "message": ctypes.addressof(message)}
    code = compile_file(Path(__file__).with_suffix(".ll"), **_PLACES, **_VALUES, **calls, **own)
    definition = _Definition(b"field", code.address, _FASTCALL, None)
    new = python.PyCFunction_NewEx
    new.argtypes, new.restype = [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p], ctypes.py_object
    # The function keeps alive what it is bound to.
    return new(ctypes.addressof(definition), (code, definition, message), None)


def _check(i: int, name: str, length: int) -> str:
    """The lines that find the data of an argument, or refuse it."""
    return f"""check{i}:
%at{i} = getelementptr ptr, ptr %arguments, i64 {i}
%array{i} = load ptr, ptr %at{i}
%{name} = call ptr @data(ptr %array{i}, i64 {length}, i32 {_WRITEABLE if name == "out" else _READABLE})
%wrong{i} = icmp eq ptr %{name}, null
br i1 %wrong{i}, label %refuse, label %check{i + 1}"""
