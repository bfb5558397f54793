"""Objects by their catalogue names, or as "module:class" from outside the catalogue."""

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from importlib import import_module
from typing import TypeVar

T = TypeVar("T")


def hint(word: str, names: Iterable[str]) -> str:
    """Which of the names a mistyped word is likely to mean, in brackets; empty if none is near."""
    near = get_close_matches(word.lower(), list(names), n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


def load(kind: str, name: str, catalogue: Mapping[str, str], base: type[T]) -> T:
    """Instance of the class that a name stands for.

    Parameters
    ----------
    kind : str
        What it is, for messages.
    name : str
        A catalogue name, or ``"module:class"``.
    catalogue : mapping
        Name to ``"module:class"``.
    base : type
        What the class must derive from.

    Raises
    ------
    ValueError
        If there is no class of that name, or one of another kind.
    """
    target = catalogue.get(name, name)
    module, _, attribute = target.partition(":")
    if not (module and attribute):
        raise ValueError(f"{kind}: got {name!r}, expected one of {', '.join(catalogue)}{hint(name, catalogue)}")
    try:
        found = getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        if name in catalogue:
            raise
        place = "; is its folder on PYTHONPATH?" if isinstance(error, ModuleNotFoundError) else ""
        raise ValueError(f"{kind}: got {name!r}, expected an importable module:class ({error}){place}") from None
    if not (isinstance(found, type) and issubclass(found, base)):
        raise ValueError(f"{kind}: got {name!r}, expected a class derived from {base.__module__}:{base.__qualname__}")
    return found()
