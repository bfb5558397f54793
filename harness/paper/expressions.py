"""Expressions in the sections' files, which belong to this package: what they may name, and texts with them."""

from collections.abc import Mapping
from types import ModuleType
from typing import Any

from polhode.harness.common.text import Wording
from polhode.harness.paper import drawing, planes, runs, tables
from polhode.models import scenes

# Modules whose names all expressions may use.
SHARED = (scenes, drawing, tables, runs, planes)


def names_of(*modules: ModuleType) -> dict[str, Any]:
    """The names of the shared modules and of others."""
    return {name: value for module in (*SHARED, *modules) for name, value in vars(module).items()}


def evaluated(expression: Any, names: dict[str, Any]) -> Any:
    """The value of an expression; what is none is its own value."""
    return eval(expression, names) if isinstance(expression, str) else expression


class _Words(Wording):
    """Fields of texts are expressions, which end at the first : or ! outside brackets."""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> tuple[Any, str]:
        return evaluated(field_name, kwargs), field_name


def worded(text: str, names: Mapping[str, Any]) -> str:
    """A text with its fields."""
    return _Words().vformat(text, (), names)
