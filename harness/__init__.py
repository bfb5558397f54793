"""Harness: what users see (`api`, `cli`, `work_precision`) on top of its rooms; imports models and solvers."""

from typing import Any

if __name__ != "polhode.harness":
    raise ImportError(f"this package is imported as 'polhode.harness', not as {__name__!r}")

_FACE = ("SceneSolution", "WorkPrecision", "pick", "solve")


def __getattr__(name: str) -> Any:
    """The names that lived here before `polhode` had them."""
    if name not in _FACE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import polhode

    return getattr(polhode, name)
