"""A compiled field as a built-in function of Python over NumPy arrays: a call takes 30 ns, through ctypes 900.

No command repeats these two times: they are estimates. The function reads inner layouts of Python and
NumPy. Without it whole runs of the solvers that call a field back take 1.05 to 1.6 times as long: LSODA 1.5
to 1.6, CVODE 1.3, SciPy's Radau 1.1 (`tests/benchmarks/array_function.py`, the paper's ellipsoid,
St = 10 and 0.01).
"""

import ctypes
from collections.abc import Callable, Mapping
from pathlib import Path
from struct import pack
from typing import Any

import numpy as np

from polhode.solvers.machine_code.llvm import compile_file

# The file in LLVM's language needs these facts of Python and NumPy: size of the head that every
# object begins with, in bytes; the character that NumPy has for the processor's byte order; its
# number of the type float64; and the addresses of objects, which `id` gives.
_LAYOUT = {
    "head": object.__basicsize__,
    "native": ord("="),
    "double": np.dtype(float).num,
    "ndarray": id(np.ndarray),
    "type_error": id(TypeError),
    "none": id(None),
}
# NumPy's flags of arrays (ndarraytypes.h).
_C_CONTIGUOUS = 0x0001
_ALIGNED = 0x0100
_IS_WRITEABLE = 0x0400
_READABLE = _C_CONTIGUOUS | _ALIGNED
_WRITEABLE = _READABLE | _IS_WRITEABLE
# Python's flag of a function that receives its arguments as a C array and their number
# (methodobject.h).
_FASTCALL = 0x0080
# The message of the TypeError; a C string.
_EXPECTED = b"expected one-dimensional contiguous arrays of float64, of the field's sizes, the last one writeable"


def array_function(lines: str, arrays: Mapping[str, int]) -> Callable[..., None]:
    """Compile traced lines into a function of arrays, by name and length, the last one ``out``.

    `lines` are instructions of LLVM, as `tracing` writes them: they find an array as the pointer of its
    name, and write their results at ``%out``. The function raises a TypeError unless each array is
    contiguous, of float64 and of its length.
    """
    python = ctypes.pythonapi
    message = ctypes.create_string_buffer(_EXPECTED)
    fields: dict[str, Any] = {
        **_LAYOUT,
        "lines": lines,
        "count": len(arrays),
        "message": ctypes.addressof(message),
    }
    for function in ("PyErr_SetString", "Py_IncRef"):
        fields[function] = ctypes.cast(python[function], ctypes.c_void_p).value
    for i, (name, length) in enumerate(arrays.items()):
        fields[f"name{i}"] = name
        fields[f"length{i}"] = length
        fields[f"flags{i}"] = _WRITEABLE if name == "out" else _READABLE
    code = compile_file(Path(__file__).with_suffix(".ll"), **fields)
    # Python's `PyMethodDef`: name, function, flags and documentation, which is NULL. "PPiP" are two
    # addresses, an int, and an address, laid out as C does.
    name = ctypes.create_string_buffer(b"field")
    definition = ctypes.create_string_buffer(
        pack("PPiP", ctypes.addressof(name), code.address, _FASTCALL, 0)
    )
    new = python.PyCFunction_NewEx
    new.argtypes = [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p]
    new.restype = ctypes.py_object
    # The second argument is what the function is bound to, its `self`, and thereby kept alive: all
    # that the machine code and Python point to.
    return new(ctypes.addressof(definition), (code, definition, name, message), None)
