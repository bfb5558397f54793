"""As if libraries were not installed: with this folder on PYTHONPATH, `WITHOUT` names modules and packages to hide.

Imports, `find_spec` and `importlib.metadata` then answer as they do where the libraries are absent.
With `NARROW` set, NumPy's long double is double, as on a Mac.
"""

import os
import sys
from collections.abc import Iterable
from importlib.machinery import ModuleSpec, PathFinder
from typing import Any

# Names of modules and packages, as `WITHOUT` gives them with commas between.
HIDDEN = frozenset(filter(None, os.environ.get("WITHOUT", "").split(",")))


class Hiding(PathFinder):
    """Finds what is on the path, but for what is hidden: "scipy.special" hides that part of SciPy alone."""

    @classmethod
    def find_spec(cls, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """None of a hidden module, as of one that is not there."""
        return None if fullname in HIDDEN else super().find_spec(fullname, path, target)

    @classmethod
    def find_distributions(cls, *args: Any, **kwargs: Any) -> Iterable[Any]:
        """Installed packages without the hidden ones."""
        packages = super().find_distributions(*args, **kwargs)
        return (package for package in packages if package.metadata["Name"].lower() not in HIDDEN)


if HIDDEN:
    sys.meta_path[sys.meta_path.index(PathFinder)] = Hiding
if os.environ.get("NARROW"):
    import numpy as np

    np.longdouble = np.float64
    np.clongdouble = np.complex128
