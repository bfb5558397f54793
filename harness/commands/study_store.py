"""The store that a measuring command runs into: fresh or resumed, and what to say when it cannot go on."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from polhode.harness.cli import BadInput, RunFailed, bad_input

if TYPE_CHECKING:
    from polhode.harness.common.store import Store


def open_store(folder: Path, resume: bool) -> "Store":
    """Open FOLDER/store.sqlite, made with its folder; a run that starts afresh moves the last one's aside.

    Raises
    ------
    BadInput
        If the folder cannot be made, or the file is no store.
    """
    from polhode.harness.common.store import DamagedStoreError, Store

    with bad_input():
        folder.mkdir(parents=True, exist_ok=True)
        if not resume:
            _start_afresh(folder)
        try:
            return Store(folder / "store.sqlite")
        except DamagedStoreError as error:
            raise BadInput(f"{error}, expected one of an earlier run or none") from None


@contextmanager
def running_into(store: "Store") -> Iterator[None]:
    """Close the store in any case; say how to go on after Ctrl-C, and what is wrong with a damaged store."""
    from polhode.harness.common.store import DamagedStoreError

    with store:
        try:
            yield
        except KeyboardInterrupt:
            raise RunFailed(f"interrupted: finished cases are in {store.path}, --resume goes on") from None
        except DamagedStoreError as error:
            raise RunFailed(str(error)) from None


def _start_afresh(folder: Path) -> None:
    """Keep the last run's store, with what SQLite has put beside it, under another name."""
    for ending in ("", "-wal", "-shm"):
        (folder / f"previous.sqlite{ending}").unlink(missing_ok=True)
        if (folder / f"store.sqlite{ending}").exists():
            (folder / f"store.sqlite{ending}").rename(folder / f"previous.sqlite{ending}")
