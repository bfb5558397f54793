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

# The data of an array that is what it should be, else null.
_CHECK = f"""
define internal ptr @data(ptr %array, i64 %length, i32 %flags) alwaysinline {{
  %type_at = getelementptr i8, ptr %array, i64 {_TYPE}
  %type = load ptr, ptr %type_at
  %is_array = icmp eq ptr %type, inttoptr (i64 {id(np.ndarray)} to ptr)
  br i1 %is_array, label %array_found, label %wrong
array_found:
  %dimensions_at = getelementptr i8, ptr %array, i64 {_DIMENSIONS}
  %dimensions = load i32, ptr %dimensions_at
  %is_vector = icmp eq i32 %dimensions, 1
  br i1 %is_vector, label %vector, label %wrong
vector:
  %lengths_at = getelementptr i8, ptr %array, i64 {_LENGTHS}
  %lengths = load ptr, ptr %lengths_at
  %got_length = load i64, ptr %lengths
  %is_long = icmp eq i64 %got_length, %length
  %element_at = getelementptr i8, ptr %array, i64 {_ELEMENT}
  %element = load ptr, ptr %element_at
  %order_at = getelementptr i8, ptr %element, i64 {_ORDER}
  %order = load i8, ptr %order_at
  %is_native = icmp eq i8 %order, {ord("=")}
  %number_at = getelementptr i8, ptr %element, i64 {_NUMBER}
  %number = load i32, ptr %number_at
  %is_double = icmp eq i32 %number, {np.dtype(float).num}
  %flags_at = getelementptr i8, ptr %array, i64 {_FLAGS}
  %got_flags = load i32, ptr %flags_at
  %common = and i32 %got_flags, %flags
  %is_usable = icmp eq i32 %common, %flags
  %both = and i1 %is_long, %is_native
  %three = and i1 %both, %is_double
  %all = and i1 %three, %is_usable
  br i1 %all, label %right, label %wrong
right:
  %data_at = getelementptr i8, ptr %array, i64 {_DATA}
  %data = load ptr, ptr %data_at
  ret ptr %data
wrong:
  ret ptr null
}}
"""


class _Definition(ctypes.Structure):
    """Python's `PyMethodDef`."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


def array_function(lines: str, arrays: Mapping[str, int]) -> Callable[..., None]:
    """Compile a function of arrays, which raises a TypeError unless each is contiguous, of float64 and of its length.

    Parameters
    ----------
    lines : str
        As `polhode.solvers.machine_code.tracing.trace` makes them.
    arrays : mapping of str to int
        Names and lengths of the arguments, in their order; the last one is ``out``.
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
    return Signature("ptr @function(ptr %self, ptr %arguments, i64 %count)", "\n".join(lines), none, _CHECK)


def _python(name: str) -> str:
    """The address of a function of Python's own."""
    return f"inttoptr (i64 {ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value} to ptr)"
