"""Harness: references, errors, timing, studies, cost laws, pick, and the command line.

What most people need is here by name, imported on first use::

    from polhode.harness import solve, pick, WorkPrecision
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if __name__ != "polhode.harness":
    raise ImportError(f"this package is imported as 'polhode.harness', not as {__name__!r}")

if TYPE_CHECKING:
    from polhode.harness.api import SceneSolution, pick, solve
    from polhode.harness.work_precision import WorkPrecision

__all__ = ["SceneSolution", "WorkPrecision", "pick", "solve"]

_HOMES = {
    "solve": "polhode.harness.api",
    "pick": "polhode.harness.api",
    "SceneSolution": "polhode.harness.api",
    "WorkPrecision": "polhode.harness.work_precision",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Package(ModuleType):
    """The package itself; importing its module `pick` does not hide the function of that name."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
