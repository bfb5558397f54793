"""SUNDIALS' C libraries, which the wheels of scikit-sundae and sundials4py bring: found at run time, called by name."""

import ctypes
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from polhode.models.libraries import version_of
from polhode.models.once import once
from polhode.models.problem import Problem
from polhode.models.spent import spent_on
from polhode.solvers.compile import parameter_array
from polhode.solvers.contract import Status

# Return values (cvode.h, ida.h; both libraries share these), without their prefix.
TOO_MUCH_WORK = -1
_TOO_MUCH_ACCURACY = -2
_ERROR_FAILURE = -3
_CONVERGENCE_FAILURE = -4
_ILLEGAL_INPUT = -22
FAILURES = {
    TOO_MUCH_WORK: (Status.STEP_LIMIT, "too many steps"),
    _TOO_MUCH_ACCURACY: (
        Status.TOLERANCE_UNATTAINABLE,
        "could not satisfy the demanded accuracy",
    ),
    _ERROR_FAILURE: (Status.STEP_UNDERFLOW, "error tests failed too many times"),
    _CONVERGENCE_FAILURE: (Status.STEP_UNDERFLOW, "convergence tests failed too many times"),
    _ILLEGAL_INPUT: (Status.CRASHED, "illegal input"),
}
# The version whose functions are called here.
MAJOR = 7
# Types of functions' results that are no code, which is negative where they fail.
_MAKERS = ("N_VMake_Serial", "SUNDenseMatrix", "SUNLinSol_Dense", "CVodeCreate", "IDACreate")
_SILENT = ("N_VSetArrayPointer", "N_VDestroy", "SUNMatDestroy", "CVodeFree", "IDAFree")


class Sundials:
    """The functions of CVODE or of IDA, and those that both libraries hold."""

    def __init__(self, prefix: str, file: Path) -> None:
        self.prefix = prefix
        self._functions = ctypes.CDLL(str(file))
        for names, result in ((_MAKERS, ctypes.c_void_p), (_SILENT, None)):
            for name in names:
                if hasattr(self._functions, name):
                    getattr(self._functions, name).restype = result

    # Floats go as doubles; whole numbers are counts, or addresses of the library's objects.
    def __call__(self, name: str, *arguments: float) -> int:
        """Call a function, the library's own as ``SetStopTime``; RuntimeError if it fails."""
        converted = [
            ctypes.c_double(x) if isinstance(x, float) else ctypes.c_int64(x) for x in arguments
        ]
        code = self.function(name)(*converted) or 0
        if code < 0:
            raise RuntimeError(f"{self.prefix}, {name}: code {code}")
        return code

    def function(self, name: str) -> Any:
        """A function as ctypes has it."""
        shared = name.startswith(("SUN", "N_V"))
        return getattr(self._functions, name if shared else self.prefix + name)

    def knows(self, name: str) -> bool:
        """Whether the library exports a function of this whole name."""
        return hasattr(self._functions, name)

    def __getitem__(self, name: str) -> str:
        """A function's address as LLVM's language has it."""
        return f"inttoptr (i64 {ctypes.cast(self.function(name), ctypes.c_void_p).value} to ptr)"


@once()
@spent_on("import")
def load_sundials(prefix: str) -> Sundials | None:
    """The library whose functions begin with `prefix`, ``CVode`` or ``IDA``; None if it is not found or unknown."""
    for file in _files(f"sundials_{prefix.lower()}[-.]*"):
        try:
            library = Sundials(prefix, file)
            library.function("Create")
            major = _major_version(library)
        except (OSError, AttributeError):
            continue
        if major == MAJOR:
            return library
    return None


def _major_version(library: Sundials) -> int:
    """The library's own word; sundials4py leaves that function out, and has the version of its SUNDIALS."""
    if not library.knows("SUNDIALSGetVersionNumber"):
        return int((version_of("sundials4py") or "0").partition(".")[0])
    # It writes major and minor version, patch, and a label such as "-dev.1", for which 40 bytes are ample.
    numbers = (ctypes.c_int * 3)()
    label = ctypes.create_string_buffer(40)
    size = ctypes.sizeof(ctypes.c_int)
    places = [ctypes.addressof(numbers) + size * i for i in range(3)]
    library("SUNDIALSGetVersionNumber", *places, ctypes.addressof(label), len(label))
    major, _, _ = numbers
    return major


def posed(problem: Problem, implicit: bool) -> tuple[np.ndarray, np.ndarray]:
    """Masses and parameters of the equations: by the mass form if they are implicit and there is one.

    Masses have shape (d,), or (d, d) of a user's full mass matrix.
    """
    form = problem.mass_form if implicit else None
    mass = np.array(form.mass) if form else np.ones(problem.dimension)
    return mass, np.array(form.parameters) if form else parameter_array(problem)


def _files(pattern: str) -> list[Path]:
    """Files that may hold a library: those beside scikit-sundae, then the extension module of sundials4py."""
    sundae = find_spec("sksundae")
    packages = (
        [Path(place) for place in (sundae.submodule_search_locations or ())] if sundae else []
    )
    # Folders of the C libraries in its wheels: for Linux and Windows, and for macOS.
    folders = [
        folder
        for package in packages
        for folder in (package.parent / "scikit_sundae.libs", package / ".dylibs")
    ]
    files = sorted(file for folder in folders for file in folder.glob(f"*{pattern}"))
    # Its wheels, for Python 3.12 and later, link CVODES and IDAS into the one module that it is.
    module = find_spec("sundials4py")
    if module and module.has_location:
        files.append(Path(str(module.origin)))
    return files
