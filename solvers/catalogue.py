"""The catalogue of solvers: one line each; modules and libraries are imported on use."""

import tomllib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from polhode.models.registry import Catalogue

if TYPE_CHECKING:
    from polhode.solvers.contract import Solver

SOLVERS: "Catalogue[Solver]" = Catalogue(
    "solver",
    "polhode.solvers.contract:Solver",
    {
        "taylor": "polhode.solvers.taylor:Taylor",
        "dop853": "polhode.solvers.scipy_ivp:Dop853",
        "rk45": "polhode.solvers.scipy_ivp:Rk45",
        "radau": "polhode.solvers.scipy_ivp:Radau",
        "bdf": "polhode.solvers.scipy_ivp:Bdf",
        "lsoda": "polhode.solvers.scipy_ivp:Lsoda",
        "cvode-adams": "polhode.solvers.sundials.methods:CvodeAdams",
        "cvode-bdf": "polhode.solvers.sundials.methods:CvodeBdf",
        "ida": "polhode.solvers.sundials.methods:Ida",
        "cyrk-vern8": "polhode.solvers.cyrk:Vern8",
        "cyrk-vern7": "polhode.solvers.cyrk:Vern7",
        "cyrk-dop853": "polhode.solvers.cyrk:Dop853",
        "cyrk-tsit5": "polhode.solvers.cyrk:Tsit5",
        "cyrk-lsoda": "polhode.solvers.cyrk:Lsoda",
        "cyrk-bdf": "polhode.solvers.cyrk:Bdf",
        "cyrk-radau": "polhode.solvers.cyrk:Radau",
        "splitting": "polhode.solvers.parts.splitting:Splitting",
        "splitting-extended": "polhode.solvers.parts.splitting:SplittingExtended",
        "stroboscopic": "polhode.solvers.parts.stroboscopic:Stroboscopic",
        "exact": "polhode.solvers.exact:Exact",
    },
)
solver = SOLVERS.find
Base = TypeVar("Base", bound="Solver")


def methods(base: "type[Base]") -> "list[type[Base]]":
    """Classes of the methods of a library, which differ by the traits that `methods.toml` gives them."""
    tables = _tables()[base.__name__]
    return [type(name, (base,), _traits(base, **table)) for name, table in tables.items()]  # pyright: ignore


@cache
def _tables() -> dict[str, dict[str, dict[str, Any]]]:
    return tomllib.loads(Path(__file__).with_name("methods.toml").read_text(encoding="utf-8"))


def _traits(base: type, doc: str, **traits: Any) -> dict[str, Any]:
    own = {name: tuple(value) if isinstance(value, list) else value for name, value in traits.items()}
    return {"__doc__": doc, "__module__": base.__module__, **own}
