"""TOML files with checked keys: what is wrong with one, in one line."""

import reprlib
import tomllib
from collections.abc import Callable
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from polhode.models.registry import hint, near

Made = TypeVar("Made")
Model = TypeVar("Model", bound=BaseModel)
# Most bytes of a file. An estimate: a track of 20,000 gradients, of some 200 bytes each, fits in; a
# longer one is refused. A larger file is none that somebody wrote, and might never end.
_MAX_BYTES = 4_000_000


def read_toml(
    source: Path | Traversable, parse: Callable[[dict[str, Any]], Made], where: str | None = None
) -> Made:
    """Read a TOML file and make of its contents what `parse` makes of them; messages call it `where`, or by its path.

    A ValueError says in one line the file and what is wrong, as `parse` does; an OSError that it
    cannot be read.
    """
    where = where or str(source)
    try:
        with source.open("rb") as file:
            content = file.read(_MAX_BYTES + 1)
        if len(content) > _MAX_BYTES:
            raise ValueError(f"got more than {_MAX_BYTES} bytes")
        # With or without the mark that some editors begin a file with.
        contents = tomllib.loads(content.decode("utf-8-sig"))
    except RecursionError:
        raise ValueError(f"{where}: expected a TOML file: nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{where}: expected a TOML file: {error}") from None
    try:
        return parse(contents)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def checked(model: type[Model], contents: dict[str, Any]) -> Model:
    """The contents of a file as a `model`; raises ValueError, in one line: the key, the value and what was expected."""
    try:
        return model.model_validate(contents)
    except ValidationError as error:
        raise ValueError(_first_complaint(error, model)) from None


def _first_complaint(error: ValidationError, model: type[BaseModel]) -> str:
    """The plainest complaint about the contents of a `model` in one line, and how many more there are."""
    # An unknown key comes first, for it may be the misspelt name of one that is missing.
    complaints = sorted(
        error.errors(include_url=False),
        key=lambda complaint: complaint["type"] != "extra_forbidden",
    )
    first = complaints[0]
    # A complaint of a validator about the whole model has no place.
    *above, last = first["loc"] or ("",)
    where = "".join(
        f"[{part}]" if isinstance(part, int) else f".{part}" for part in (*above, last)
    ).lstrip(".")
    expected = first["msg"].removeprefix("Value error, ")
    if first["type"] == "missing":
        text = f"{where}: missing, expected a value"
    elif first["type"] == "extra_forbidden":
        keys = _keys(model, above)
        meant = near(str(last), keys)
        # The key that it means is not missing besides.
        meant_key = ("missing", (*above, meant))
        complaints = [
            complaint
            for complaint in complaints
            if (complaint["type"], complaint["loc"]) != meant_key
        ]
        text = f"{where}: unknown key, expected one of {', '.join(keys)}{_advice(model, above, str(last), keys)}"
    elif expected.startswith("got "):
        # A message of our own validators, which says already what was got.
        text = f"{where}: {expected}" if where else expected
    else:
        text = f"{where}: got {reprlib.repr(first['input'])}, {_in_our_words(expected)}"
    more = len(complaints) - 1
    return text + (f" (and {more} more)" if more else "")


def _advice(model: type[BaseModel], above: list[int | str], key: str, keys: list[str]) -> str:
    """A guess at what an unknown key means: one of another table, or a misspelt one."""
    if above and key in model.model_fields:
        return f" ({key} belongs above the first [table], not under [{above[0]}])"
    for name, field in model.model_fields.items():
        table = field.annotation
        if (
            isinstance(table, type)
            and issubclass(table, BaseModel)
            and [name] != above
            and key in table.model_fields
        ):
            return f" ({key} belongs under [{name}])"
    return hint(key, keys)


def _keys(model: Any, path: list[int | str]) -> list[str]:
    """Keys that the table at a path, of keys and places in lists, inside a model may have."""
    # A field of several tables, or one that may be absent, has its model as the first argument of its
    # type: of list[Model], Model | None, and of both.
    for part in path:
        if isinstance(part, str):
            model = model.model_fields[part].annotation
        while not hasattr(model, "model_fields"):
            model = get_args(model)[0]
    return list(model.model_fields)


# Our words by the beginnings of pydantic's messages.
_OUR_WORDS = tomllib.loads(Path(__file__).with_name("our_words.toml").read_text(encoding="utf-8"))


def _in_our_words(message: str) -> str:
    """A message of pydantic's by the beginnings that `our_words.toml` translates; others as they are."""
    # Whoever wrote the file knows nothing of validation and of Python's classes.
    message = message.replace(" after validation", "").split(" or instance of")[0]
    translated = (
        ours + message.removeprefix(theirs)
        for theirs, ours in _OUR_WORDS.items()
        if message.startswith(theirs)
    )
    return next(translated, message)
