"""Reading TOML files whose contents somebody checks: one clear line for what is wrong with them."""

import tomllib
from collections.abc import Callable
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, TypeVar

Made = TypeVar("Made")


def read_toml(source: Path | Traversable, parse: Callable[[dict[str, Any]], Made], where: str | None = None) -> Made:
    """Read a TOML file and make of its contents what `parse` makes of them.

    Parameters
    ----------
    source : Path or Traversable
    parse : callable
        Raises ValueError, in one line, if it does not like the contents.
    where : str, optional
        What messages call the file; its path by default.

    Raises
    ------
    ValueError
        In one line: the file, and what is wrong.
    OSError
        If the file cannot be read.
    """
    where = where or str(source)
    try:
        contents = tomllib.loads(source.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{where}: expected a TOML file: {error}") from None
    try:
        return parse(contents)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
