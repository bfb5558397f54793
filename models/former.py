"""Names of the version before, which work for one more version and say by what they are replaced."""

import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

Class = TypeVar("Class", bound=type)


def warn(former: str, name: str, stacklevel: int = 3) -> None:
    """Warn that a name has changed, by default at the line of the caller's caller; level 1 is this function."""
    text = f"{former} is now {name}; the former name goes with the next version"
    warnings.warn(text, DeprecationWarning, stacklevel)


class Former:
    """An attribute or method by its former name: ``pieces = Former("segments")`` in a class."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.former = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.former = name

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        """Value of the attribute by its present name, after a warning."""
        if instance is None:
            return self
        kind = type(instance).__name__
        warn(f"{kind}.{self.former}", f"{kind}.{self.name}")
        return getattr(instance, self.name)


def takes_former(**names: str) -> Callable[[Class], Class]:
    """Let a class be made with keywords by their former names: former name to present name."""

    def decorate(cls: Class) -> Class:
        init = cls.__init__

        @wraps(init)
        def with_former(self: Any, *args: Any, **keywords: Any) -> None:
            # A value by the former name counts before one by the present name: `dataclasses.replace` adds all
            # fields that its caller does not name, by their present names.
            for former in names.keys() & keywords.keys():
                warn(f"{former}= of {cls.__name__}", f"{names[former]}=")
                keywords[names[former]] = keywords.pop(former)
            init(self, *args, **keywords)

        cls.__init__ = with_former
        return cls

    return decorate


def rename_former(cls: type, **names: str) -> None:
    """Take over what a derived class sets by former names: for ``__init_subclass__`` of its base."""
    for former, name in names.items():
        if former in vars(cls):
            # The third caller up is the class statement, behind this function and `__init_subclass__`.
            warn(f"{cls.__name__}.{former}", name, stacklevel=4)
            setattr(cls, name, vars(cls)[former])


def former_object(module: str, former: str, names: dict[str, str]) -> str:
    """Present name of an object of a module, after a warning: for ``__getattr__`` of the module."""
    if former not in names:
        raise AttributeError(f"module {module!r} has no attribute {former!r}")
    # The third caller up is the user's line, behind this function and the module's `__getattr__`.
    warn(f"{module}.{former}", names[former], stacklevel=4)
    return names[former]
