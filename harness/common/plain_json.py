"""JSON that every reader takes: numbers that it has no sign for are the words "Infinity", "-Infinity" and "NaN"."""

import hashlib
import json
from collections.abc import Callable
from math import inf, isfinite, nan
from typing import Any

WORDS = {"Infinity": inf, "-Infinity": -inf, "NaN": nan}


def dumps(value: Any) -> str:
    """One line of JSON, keys in order."""
    return json.dumps(_with(_word, value), sort_keys=True, allow_nan=False)


def loads(text: str) -> Any:
    """The value that `dumps` wrote, words turned into numbers again; raises ValueError if the text is no JSON."""
    return _with(_number, json.loads(text))


def digest(value: Any) -> str:
    """SHA-256 of a value's JSON, keys in order: the same for the same content."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _with(change: Callable[[Any], Any], value: Any) -> Any:
    """A value with all in it that is neither dictionary nor list changed."""
    if isinstance(value, dict):
        return {name: _with(change, each) for name, each in value.items()}
    return [_with(change, each) for each in value] if isinstance(value, list | tuple) else change(value)


def _word(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, float) and not isfinite(value) else value


def _number(value: Any) -> Any:
    return WORDS.get(value, value) if isinstance(value, str) else value
