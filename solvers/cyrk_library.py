"""CyRK's C entry points in 5 ms, without the 0.3 s that its package takes to import numba."""

import ctypes
import importlib.util
import sys
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from types import SimpleNamespace
from typing import Any

from polhode.models.spent import spent_on

# Versions whose C functions have the signatures stated here; of others the package itself is imported.
KNOWN = ("0.20.",)

_RESULT, _SIZE, _INT, _DOUBLE = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_double
_POINTER = ctypes.POINTER(ctypes.c_double)
# Of each function: what numba_c_api calls its address, what it returns, and its arguments.
_FUNCTIONS = {
    "c_get_size": ("get_size", _SIZE, (_RESULT,)),
    "c_get_status": ("get_status", ctypes.c_int32, (_RESULT,)),
    "c_get_steps": ("get_steps_taken", _SIZE, (_RESULT,)),
    "c_get_t_ptr": ("get_t", _POINTER, (_RESULT,)),
    "c_get_y_ptr": ("get_y", _POINTER, (_RESULT,)),
    "c_get_t_now": ("get_t_now", _DOUBLE, (_RESULT,)),
    "c_get_y_now": ("get_y_now_ptr", _POINTER, (_RESULT,)),
    "c_free": ("get_free", None, (_RESULT,)),
    "c_numba_cysolve_ivp": (
        "get_solve",
        _RESULT,
        (
            *(_RESULT, _DOUBLE, _DOUBLE, _RESULT, _SIZE),  # field, start, end, state
            *(_INT, _SIZE, _SIZE, _RESULT, _SIZE),  # method, expected size, extra outputs, parameters
            *(_SIZE, _SIZE, ctypes.c_bool, _RESULT, _SIZE),  # limits of steps and memory, dense output, times
            *(_RESULT, _RESULT, _SIZE),  # function before the field, events
            *(_RESULT, _SIZE, _RESULT, _SIZE),  # relative and absolute tolerances
            *(_DOUBLE, _DOUBLE, ctypes.c_bool),  # largest and first step, keep the solver
        ),
    ),
}


@cache
@spent_on("import")
def load_cyrk() -> Any:
    """The library's C functions, under the names that its own bridge to numba gives them."""
    if version("CyRK").startswith(KNOWN):
        with suppress(ImportError, AttributeError):
            return SimpleNamespace(**_functions())
    from CyRK.nb import numba_solver

    return numba_solver


def _functions() -> dict[str, Any]:
    _announce()
    from CyRK._cpu_check import check_cpu

    check_cpu()
    import CyRK.nb.numba_c_api as addresses

    return {
        name: ctypes.CFUNCTYPE(result, *arguments)(getattr(addresses, f"{source}_func_ptr")())
        for name, (source, result, arguments) in _FUNCTIONS.items()
    }


def _announce() -> None:
    """Enter the package where modules are found, so that its parts can be imported; it runs on the first use."""
    if "CyRK" in sys.modules:
        return
    spec = importlib.util.find_spec("CyRK")
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError("No module named 'CyRK'", name="CyRK")
    package, loader = importlib.util.module_from_spec(spec), spec.loader

    def complete(name: str) -> Any:
        vars(package).pop("__getattr__", None)
        loader.exec_module(package)
        return getattr(package, name)

    vars(package)["__getattr__"] = complete
    sys.modules["CyRK"] = package
