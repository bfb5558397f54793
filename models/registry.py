"""Objects by their catalogue names, or as "module:class" from outside the catalogue."""

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from importlib import import_module
from typing import TypeVar

T = TypeVar("T")
# A shorter word is a part of too much; less alike (`difflib`), a word is another one.
SHORTEST_PART, ALIKE = 3, 0.7


def hint(word: str, names: Iterable[str]) -> str:
    """Which of the names a mistyped word is likely to mean, in brackets; empty if none is near."""
    meant = near(word, names)
    return f" (did you mean {meant!r}?)" if meant else ""


def near(word: str, names: Iterable[str]) -> str | None:
    """The name that a mistyped word is nearest to, or the only one that it is a part of; None if none is near."""
    known = list(names)
    whole = [name for name in known if len(word) >= SHORTEST_PART and word.lower() in name]
    found = whole if len(whole) == 1 else get_close_matches(word.lower(), known, n=1, cutoff=ALIKE)
    return found[0] if found else None


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
