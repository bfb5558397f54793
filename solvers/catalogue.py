"""The catalogue of solvers: modules and libraries are imported on use."""

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from polhode.models.registry import Catalogue

if TYPE_CHECKING:
    from polhode.solvers.contract import Solver

# By module of `polhode.solvers` and name of the class: the class attributes ("traits").
_TEXT = Path(__file__).with_name("methods.toml").read_text(encoding="utf-8")
_METHODS: dict[str, dict[str, dict[str, Any]]] = tomllib.loads(_TEXT)
SOLVERS: "Catalogue[Solver]" = Catalogue(
    "solver",
    "polhode.solvers.contract:Solver",
    {
        "taylor": "polhode.solvers.taylor:Taylor",
        **{
            traits["name"]: f"polhode.solvers.{module}:{kind}"
            for module, kinds in _METHODS.items()
            for kind, traits in kinds.items()
        },
        "splitting": "polhode.solvers.parts.splitting:Splitting",
        "splitting-extended": "polhode.solvers.parts.splitting:SplittingExtended",
        "stroboscopic": "polhode.solvers.parts.stroboscopic:Stroboscopic",
        "exact": "polhode.solvers.exact:Exact",
    },
)
# The solver of a name, or of a "module:class" outside; raises `registry.NotFoundError` for another.
solver = SOLVERS.find
Base = TypeVar("Base", bound="Solver")

# Solvers that stand in for one whose library is missing, the quickest first.
_EXPLICIT = ("cyrk-vern8", "taylor", "cyrk-dop853", "dop853")
_IMPLICIT = ("cyrk-radau", "cvode-bdf", "radau")


def first_available(*names: str) -> str:
    """The first of the solvers that can run here; the very first if none can, whose run says why."""
    return next((name for name in names if solver(name).available), names[0])


def available_like(name: str) -> str:
    """A solver, or where its library is missing one of the same kind, explicit or implicit, that can run here."""
    return first_available(name, *(_IMPLICIT if solver(name).implicit else _EXPLICIT))


def methods(base: "type[Base]") -> "list[type[Base]]":
    """Classes of the methods of a library, which differ by the traits that `methods.toml` gives them.

    The library's module calls it with its base class, and gives the classes their names.
    """

    def made(kind: str, doc: str, **traits: Any) -> Any:
        attributes: dict[str, Any] = {"__doc__": doc, "__module__": base.__module__}
        for name, value in traits.items():
            attributes[name] = tuple(value) if isinstance(value, list) else value
        return type(kind, (base,), attributes)

    tables = _METHODS[base.__module__.removeprefix("polhode.solvers.")]
    return [made(kind, **table) for kind, table in tables.items()]
