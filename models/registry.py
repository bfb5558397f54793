"""Catalogues of classes by name, imported on use; a class outside one is named "module:class"."""

import os
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from typing import Generic, TypeVar
from weakref import WeakSet

from polhode.models.spent import spent_on

T = TypeVar("T")
# The next two are estimates. They decide no more than whether a message ends with a guess.
#
# Least letters of a word that is looked for as a part of names: a shorter one is a part of too many.
_SHORTEST_PART = 3
# Least likeness of a word to the name it means, from 0 to 1 as `difflib` counts it.
_ALIKE = 0.7


def hint(word: str, names: Iterable[str]) -> str:
    """Which of the names a mistyped word is likely to mean, in brackets; empty if none is near."""
    meant = near(word, names)
    return f" (did you mean {meant!r}?)" if meant else ""


def near(word: str, names: Iterable[str]) -> str | None:
    """The name that a mistyped word is nearest to, or the only one that it is a part of; None if none is near."""
    names = list(names)
    containing = [name for name in names if len(word) >= _SHORTEST_PART and word.lower() in name]
    if len(containing) == 1:
        return containing[0]
    alike = get_close_matches(word.lower(), names, n=1, cutoff=_ALIKE)
    return alike[0] if alike else None


class Question(UserWarning):
    """A warning of something that is legal, but looks like a mistake."""


class NotFoundError(ValueError):
    """No class of a kind goes by a name; `expected` says what would have done, `advice` what may be meant."""

    def __init__(self, kind: str, name: str, expected: str, advice: str = "") -> None:
        super().__init__(kind, name, expected, advice)
        self.kind = kind
        self.name = name
        self.expected = expected
        self.advice = advice

    def __str__(self) -> str:
        """The message: what was got and what expected."""
        return f"{self.kind}: got {self.name!r}{self.advice}, expected {self.expected}"


class Catalogue(dict[str, str], Generic[T]):
    """Names of the classes of one kind and where they are, "module:class"; `base`, likewise, is what they derive from.

    Their modules and libraries are imported by `find` alone.
    """

    def __init__(self, kind: str, base: str, targets: Mapping[str, str]) -> None:
        super().__init__(targets)
        for name, target in plug_ins(kind + "s").items():
            self.setdefault(name, target)
        self.kind = kind
        self.base = base
        self._made: dict[str, T] = {}
        # Classes whose objects were found complete.
        self._checked: WeakSet[type] = WeakSet()

    def find(self, name: str | T) -> T:
        """The instance of a catalogue name, or of a "module:class" outside, or the object that is one already.

        A NotFoundError says that there is none, or what its class lacks of the contract. Errors of
        importing a catalogue entry are raised as they are.
        """
        if not isinstance(name, str):
            if type(name) not in self._checked:
                self._object(name)
                self._checked.add(type(name))
            return name
        if name not in self._made:
            self._made[name] = self._class(name)()
        return self._made[name]

    def name_of(self, thing: str | T | None) -> str | None:
        """The catalogue name of an object, ``"module:class"`` of another class' one, names and None as they are."""
        if thing is None or isinstance(thing, str):
            return thing
        target = f"{type(thing).__module__}:{type(thing).__qualname__}"
        # Under this name the object is found again, even if its class is one within a function.
        self._made[target] = thing
        return next((name for name, place in self.items() if place == target), target)

    def _class(self, name: str) -> type[T]:
        """The class of a catalogue name, or of a "module:class"."""
        target = self.get(name, name)
        if ":" not in target.strip(":") or target.startswith("."):
            raise NotFoundError(self.kind, name, f"one of {', '.join(self)}", hint(name, self))
        try:
            named = imported(target)
        except (ImportError, AttributeError) as error:
            if name in self:
                raise
            place = (
                "; is its folder on PYTHONPATH?" if isinstance(error, ModuleNotFoundError) else ""
            )
            raise NotFoundError(
                self.kind, name, f"an importable module:class ({error}){place}"
            ) from None
        if not (isinstance(named, type) and issubclass(named, imported(self.base))):
            raise NotFoundError(self.kind, name, f"a class derived from {self.base}")
        return self._complete(named)

    def _object(self, given: T) -> None:
        """Raise NotFoundError unless this is an object of a complete class of the kind."""
        base = imported(self.base)
        if isinstance(given, type) and issubclass(given, base):
            raise NotFoundError(
                self.kind, given.__name__, f"an object, not the class: {given.__name__}()"
            )
        if not isinstance(given, base):
            raise NotFoundError(
                self.kind, repr(given), f"a name, or an object of a class derived from {self.base}"
            )
        self._complete(type(given))

    def _complete(self, cls: type) -> type[T]:
        """The class, unless it lacks attributes or methods that every class of the kind must have."""
        missing = [name for name in cls.required if not hasattr(cls, name)]  # pyright: ignore
        missing += sorted(cls.__abstractmethods__)  # pyright: ignore
        if missing:
            raise NotFoundError(self.kind, cls.__name__, f"a class that has {', '.join(missing)}")
        return cls


@spent_on("import")
def imported(target: str):
    """The object that a "module:attribute" names."""
    module, _, attribute = target.partition(":")
    return getattr(import_module(module), attribute)


def plug_ins(kind: str) -> dict[str, str]:
    """Entry points of installed packages in the group "polhode.KIND": name → "module:attribute"."""
    # Usually no package declares any, which is found out without the 0.05 s of `importlib.metadata`.
    if not _declared():
        return {}
    from importlib.metadata import entry_points

    return {point.name: point.value for point in entry_points(group=f"polhode.{kind}")}


@cache
def _declared() -> bool:
    """Whether an installed package declares an entry point of polhode's."""
    for folder in sys.path:
        with suppress(OSError), os.scandir(folder or ".") as entries:
            for entry in entries:
                if entry.name.endswith((".dist-info", ".egg-info")):
                    with (
                        suppress(OSError),
                        open(os.path.join(entry.path, "entry_points.txt"), "rb") as file,
                    ):
                        if b"[polhode." in file.read():
                            return True
    return False
