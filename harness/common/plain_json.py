"""JSON that every reader takes: numbers that it has no sign for are the words "Infinity", "-Infinity" and "NaN".

`loads` turns them into numbers again, as `float` does; bare ones, as Python writes them by itself, are read as well.
"""

import json
from math import inf, isfinite, nan
from typing import Any

WORDS = {"Infinity": inf, "-Infinity": -inf, "NaN": nan}


def dumps(value: Any) -> str:
    """One line of JSON, keys in order."""
    return json.dumps(_plain(value), sort_keys=True, allow_nan=False)


def loads(text: str) -> Any:
    """The value that `dumps` wrote.

    Raises
    ------
    ValueError
        If the text is no JSON.
    """
    return _numbers(json.loads(text))


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not isfinite(value):
        return "NaN" if value != value else "Infinity" if value > 0 else "-Infinity"
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, list | tuple) else value


def _numbers(value: Any) -> Any:
    if isinstance(value, str):
        return WORDS.get(value, value)
    if isinstance(value, dict):
        return {name: _numbers(each) for name, each in value.items()}
    return [_numbers(each) for each in value] if isinstance(value, list) else value
