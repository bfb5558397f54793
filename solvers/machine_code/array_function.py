"""A compiled field as a built-in function of Python over NumPy arrays: a call takes 30 ns, through ctypes 900.

It reads inner layouts of Python and NumPy. Without it whole runs of the solvers that call a field
back take 1.05 to 1.6 times as long: LSODA 1.5 to 1.6, CVODE 1.3, SciPy's Radau 1.1
(`tests/benchmarks/array_function.py`, the paper's ellipsoid, St = 10 and 0.01).
"""

import ctypes
from collections.abc import Callable, Mapping
from pathlib import Path
from struct import pack
from typing import Any

import numpy as np

from polhode.solvers.machine_code.llvm import compile_file

# Constants of Python's and NumPy's C interface.
_KNOWN = {"head": object.__basicsize__, "native": ord("="), "double": np.dtype(float).num}
_KNOWN |= {"ndarray": id(np.ndarray), "type_error": id(TypeError), "none": id(None)}
# C-contiguous and aligned; writeable as well
_READABLE = 0x0101
_WRITEABLE = 0x0501
# Python's flag of a function that receives its arguments as a C array.
_FASTCALL = 0x0080
_EXPECTED = b"expected one-dimensional contiguous arrays of float64, of the field's sizes, the last one writeable"


def array_function(lines: str, arrays: Mapping[str, int]) -> Callable[..., None]:
    """Compile traced lines into a function of arrays, by name and length, the last one ``out``.

    It raises a TypeError unless each is contiguous, of float64 and of its length.
    """
    python = ctypes.pythonapi
    message = ctypes.create_string_buffer(_EXPECTED)
    calls = {
        name: ctypes.cast(python[name], ctypes.c_void_p).value
        for name in ("PyErr_SetString", "Py_IncRef")
    }
    own: dict[str, Any] = {
        "lines": lines,
        "count": len(arrays),
        "message": ctypes.addressof(message),
    }
    for i, (name, length) in enumerate(arrays.items()):
        flags = _WRITEABLE if name == "out" else _READABLE
        own |= {f"name{i}": name, f"length{i}": length, f"flags{i}": flags}
    code = compile_file(Path(__file__).with_suffix(".ll"), **_KNOWN, **calls, **own)
    # Python's `PyMethodDef`: name, function, flags and no documentation.
    name = ctypes.create_string_buffer(b"field")
    definition = ctypes.create_string_buffer(
        pack("PPiP", ctypes.addressof(name), code.address, _FASTCALL, 0)
    )
    new = python.PyCFunction_NewEx
    new.argtypes = [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p]
    new.restype = ctypes.py_object
    # The function keeps alive what it is bound to.
    return new(ctypes.addressof(definition), (code, definition, name, message), None)
