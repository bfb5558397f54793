"""Which file a mistyped path means."""

from contextlib import suppress
from glob import escape
from itertools import chain
from pathlib import Path

from polhode.models.registry import hint


def file_hint(word: str) -> str:
    """Which file of the same ending a mistyped path is likely to mean, in brackets; empty if none is near."""
    path = Path(word)
    pattern = f"*{escape(path.suffix)}"
    # A path may be too long for the system, or hold a zero byte.
    with suppress(OSError, ValueError):
        if not path.suffix:
            return ""
        if path.parent.is_dir():
            files = path.parent.glob(pattern)
        else:
            above = path.parent.parent
            files = chain(above.glob(pattern), above.glob(f"*/{pattern}"))
        # A link to nothing has the name, and is no file.
        return hint(word, [str(file) for file in files if file.is_file()])
    return ""
