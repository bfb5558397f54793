"""A short digest of the code that decides results: data that name another one were measured by other code.

The digest is of `models`, `solvers` and `harness` as Python, TOML and JSON are read: comments, docstrings, line breaks
and other formatting do not count. `harness/pages` and `harness/site` only show results, and do not count either.
"""

import ast
import json
import tomllib
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from polhode.models.files import cached
from polhode.models.once import once

# A clone, or the folder of the installed package: in both, the three folders stand beside each other.
_ROOT = Path(__file__).resolve().parents[2]
_FOLDERS = ("harness", "models", "solvers")
# Results are shown there, not made.
_SHOWING = ("harness/pages/", "harness/site/")
# Files of words that are shown.
_WORDS = ("models/files/our_words.toml", "solvers/statuses.toml")
# Python, data, fitted factors that `solve` and `pick` use, and LLVM's code.
_SUFFIXES = (".py", ".toml", ".json", ".ll")
# Hexadecimal digits; two of a million states of the code agree with a chance of 0.002.
_DIGITS = 12
# Changes whenever the same files get another digest.
_VERSION = 1


# By one thread alone: Python 3.11 parses in several at once with a SystemError.
@once()
def code_digest() -> str:
    """Twelve hexadecimal digits of the SHA-256 of today's code.

    Parsing takes a second, so the digest is cached on disk; the key is the SHA-256 of the files' bytes. The cache
    holds doubles, and the 48 bits of the digest fit into one.
    """
    total = sha256()
    for name, path in _files(_ROOT):
        total.update(name.encode() + path.read_bytes())
    key = f"code digest {_VERSION} {total.hexdigest()}"
    numbers = cached.load(key)
    if numbers is not None:
        return f"{int(numbers[0]):0{_DIGITS}x}"
    digest = digest_of(_ROOT)
    cached.save(key, np.array([float(int(digest, 16))]))
    return digest


def _files(root: Path) -> list[tuple[str, Path]]:
    """Names and paths of the files that count, in the order of their names."""
    files: list[tuple[str, Path]] = []
    for folder in _FOLDERS:
        for path in (root / folder).rglob("*"):
            name = path.relative_to(root).as_posix()
            if path.suffix in _SUFFIXES and not name.startswith(_SHOWING) and name not in _WORDS:
                files.append((name, path))
    return sorted(files)


def digest_of(root: Path) -> str:
    """The digest of the code under a folder that holds `harness`, `models` and `solvers`.

    All versions of Python give the same. `ast.dump` does not: which empty fields it writes differs from version to
    version. `_append_tree` leaves out all of them.
    """
    total = sha256()
    for name, path in _files(root):
        total.update(f"{name}\n{_content(path)}\n".encode())
    return total.hexdigest()[:_DIGITS]


def _content(path: Path) -> str:
    """The contents of a file without comments, docstrings and formatting."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        parts: list[str] = []
        _append_tree(ast.parse(text), parts)
        return " ".join(parts)
    if path.suffix == ".toml":
        return ascii(tomllib.loads(text))
    if path.suffix == ".json":
        return ascii(json.loads(text))
    return text


def _append_tree(node: object, parts: list[str]) -> None:
    """Append the parts of a syntax tree in their order, without positions, empty fields and docstrings."""
    if isinstance(node, list):
        parts.append("[")
        for item in node:
            if not _does_nothing(item):
                _append_tree(item, parts)
        parts.append("]")
    elif isinstance(node, ast.AST):
        parts.append(f"{type(node).__name__}(")
        for field in node._fields:
            value: Any = getattr(node, field, None)
            if isinstance(node, ast.JoinedStr):
                # Python 3.12.1 ends some f-strings with an empty text.
                value = [part for part in value if not _is_text(part) or part.value]
            if value is not None and value != []:
                parts.append(field)
                _append_tree(value, parts)
        parts.append(")")
    else:
        # Which characters `repr` escapes depends on Python's version of Unicode.
        parts.append(ascii(node))


def _does_nothing(node: object) -> bool:
    """Whether a statement is a string alone, such as a docstring."""
    return isinstance(node, ast.Expr) and _is_text(node.value)


def _is_text(node: ast.expr) -> bool:
    """Whether an expression is a string that stands in the source."""
    return isinstance(node, ast.Constant) and isinstance(node.value, str)
