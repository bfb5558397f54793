"""The records of all studies in a folder of reports."""

from collections.abc import Collection
from pathlib import Path

import pandas as pd

from polhode.harness.analysis.frames import frame
from polhode.harness.common.files import open_file
from polhode.harness.common.store import Store, read_export

NEEDED = ("scene_name", "form", "solver", "tolerance", "status")
# Folders of `reports` that hold something else than a study.
NO_STUDY = ("site", "paper", "accuracy", "pick", "problems")


def read_studies(folder: Path, columns: Collection[str]) -> tuple[dict[str, pd.DataFrame], list[str]]:
    """Runs of each study by the name of its folder, and the files that cannot be read, with the reason.

    A folder that holds several studies adds the file's name. Memory holds no more of a record than these columns.
    """
    studies, unreadable = {}, []
    for path in _files(folder):
        name = path.parent.name if path.stem in ("records", "store", "runs") else f"{path.parent.name}/{path.stem}"
        try:
            table = _table(path, {*NEEDED, *columns})
            lacking = [column for column in NEEDED if column not in table]
            if len(table) and lacking:
                raise ValueError(f"a record without {lacking[0]!r}, expected those of `polhode bench`")
        except (ValueError, OSError) as error:
            unreadable.append(f"{path}: {error}")
            continue
        if len(table):
            studies[name] = table
    return studies, unreadable


def _files(folder: Path) -> list[Path]:
    """One file per study: exported records; where there are none, the table of runs; where there is none, the store."""
    found = []
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if not path.is_dir() or path.name in NO_STUDY:
            continue
        exported = sorted(path.glob("*.jsonl"))
        single = [file for file in (path / "runs.csv", path / "store.sqlite") if file.is_file()]
        found += exported or single[:1]
    return found


def _table(path: Path, columns: Collection[str]) -> pd.DataFrame:
    if path.suffix == ".csv":
        with open_file(path) as file:
            return pd.read_csv(file, dtype_backend="numpy_nullable")
    if path.suffix == ".jsonl":
        return frame(read_export(path), columns)
    with Store(path) as store:
        return frame(store, columns)
