"""Libraries that polhode works without: whether one is installed, its version, and a line on how to install it.

A library is given by the name that it is imported by, but for `version_of`, which takes pip's name.
"""

import sys
from functools import cache
from importlib.util import find_spec
from threading import RLock

# Held while a library is imported that others import too. The parts of SciPy import each other, and two
# threads that begin with different parts may wait for each other's, which Python ends with an error.
IMPORTS = RLock()
# Words that tell pip what to install, if not the library's import name: the package's own name, or the
# extra of polhode (`pyproject.toml`) that brings the library. Extras are quoted, as shells read brackets;
# `how_to_install` knows them by the quotes.
_PACKAGES = {
    "CyRK": "cyrk",
    "PIL": "'polhode[figures]'",
    "distributed": "'polhode[dask]'",
    "furo": "'polhode[site]'",
    "latex2mathml": "'polhode[site]'",
    "matplotlib": "'polhode[figures]'",
    "myst_parser": "'polhode[site]'",
    "pyarrow": "'polhode[data]'",
    "sksundae": "scikit-sundae",
    "sphinx": "'polhode[site]'",
    "xarray": "'polhode[data]'",
}
# Libraries whose absence is told in a line: solvers, tables and extras need them. The others that pip installs
# (click, Jinja2, NumPy, pydantic, tqdm, Beautiful Soup) are not among them: no part of polhode is made to run
# without these.
KNOWN_LIBRARIES = frozenset({*_PACKAGES, "heyoka", "llvmlite", "numba", "pandas", "scipy"})


class MissingLibraryError(ImportError):
    """A library is needed that is not installed; the message names it, what for, and how to install it."""


@cache
def installed(library: str) -> bool:
    """Whether a library can be imported; "scipy.special" is a part of one.

    It is looked for once, so that what is installed later counts in the next process. The search imports
    nothing but the whole that a part belongs to.
    """
    # A library that is loaded needs no search, which reads folders.
    if sys.modules.get(library) is not None:
        return True
    try:
        return find_spec(library) is not None
    except ModuleNotFoundError:
        # A part cannot be found where the whole is missing.
        return False


def how_to_install(library: str) -> str:
    """The line that says that a library is missing and what installs it."""
    package = _PACKAGES.get(library, library)
    name = library if package.startswith("'") else package
    return f"{name} is not installed: pip install {package}"


def need(purpose: str, *libraries: str) -> None:
    """Raise MissingLibraryError for the first of the libraries that is missing; `purpose` is what needs them.

    The purpose, such as a command's name, begins the message.
    """
    for library in libraries:
        if not installed(library):
            raise MissingLibraryError(f"{purpose}: {how_to_install(library)}", name=library)


def missing_library(error: BaseException) -> str | None:
    """The library whose absence an exception tells, the cause of another one too; None if it tells none.

    Only `KNOWN_LIBRARIES` are told. A library that is installed but cannot be imported is not absent.
    """
    cause: BaseException | None = error
    while cause is not None:
        library = (cause.name or "").partition(".")[0] if isinstance(cause, ImportError) else ""
        if library in KNOWN_LIBRARIES and not installed(library):
            return library
        cause = cause.__cause__ or cause.__context__
    return None


@cache
def version_of(package: str) -> str | None:
    """Version of an installed package, by its name for pip; None if it is not installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return None
