"""Which equations, and which solver, for a massive ellipsoid tumbling in shear flow.

The names that users type, imported on first use::

    import polhode

    solution = polhode.solve("paper")
    print(polhode.pick("paper", 1e-6, "slow"))
"""

from importlib import import_module
from pkgutil import extend_path
from typing import TYPE_CHECKING, Any

# An installed polhode keeps its parts elsewhere than beside this file.
__path__ = extend_path(__path__, __name__)

if TYPE_CHECKING:
    from polhode.harness.api import pick, solve
    from polhode.harness.ivp import solve_ivp
    from polhode.harness.solution import SceneSolution
    from polhode.harness.work_precision import WorkPrecision
    from polhode.models.flow import Flow
    from polhode.models.problem import Problem
    from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
    from polhode.models.shape import Ellipsoid

    __version__: str

__all__ = [
    "BodyStart",
    "Ellipsoid",
    "EulerStart",
    "Flow",
    "Problem",
    "Scene",
    "SceneSolution",
    "SlowStart",
    "WorkPrecision",
]
__all__ += ["__version__", "pick", "solve", "solve_ivp"]

# Modules that define the names, imported when a name is first used.
_HOMES = {"pick": "harness.api", "solve": "harness.api", "solve_ivp": "harness.ivp"}
_HOMES |= {"SceneSolution": "harness.solution", "WorkPrecision": "harness.work_precision"}
_HOMES |= {"Ellipsoid": "models.shape", "Problem": "models.problem"}
_HOMES |= {"Flow": "models.flow"}
_HOMES |= dict.fromkeys(("BodyStart", "EulerStart", "Scene", "SlowStart"), "models.scene")


def _followed(problem: "Problem", tolerance: float, points: int) -> Any:
    """The solver by which models look along a run; its modules are imported when it is first called."""
    from polhode.solvers.following import followed

    return followed(problem, tolerance, points)


def _join() -> None:
    """Give the models the solver by which they look along a run."""
    # Models look along a run by a solver, and import none: here both are known.
    from polhode.models import path_solver

    path_solver.use(_followed)


_join()


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("polhode")
        except PackageNotFoundError:
            # A checkout that is not installed.
            import tomllib
            from pathlib import Path

            project = Path(__file__).resolve().parents[1] / "pyproject.toml"
            return tomllib.loads(project.read_text(encoding="utf-8"))["project"]["version"]
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(f"polhode.{_HOMES[name]}"), name)
    except ModuleNotFoundError as error:
        from polhode.models.libraries import MissingLibraryError, how_to_install, missing_library

        if library := missing_library(error):
            text = f"{name}: {how_to_install(library)}"
            raise MissingLibraryError(text, name=library) from None
        raise


def __dir__() -> list[str]:
    return sorted(__all__)
