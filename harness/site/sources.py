"""What there is to show: records of studies, accuracy, laws and the paper's items, wherever they lie."""

import csv
import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import frame, where
from polhode.harness.averaging.data import ERRORS, Absent, AveragingErrors, read_data
from polhode.harness.common.store import DamagedStoreError, Record, Store, read_export
from polhode.harness.paper import store as paper_store
from polhode.harness.paper.catalogue import sections
from polhode.harness.paper.item import Data
from polhode.models.scene import Scene
from polhode.models.scene_file import parse_scene

RECORDS, STORE, RUNS = "records", "store", "runs"
NEEDED = ("scene_name", "form", "solver", "tolerance", "status")
PREDICTED = ("scene", "form", "solver", "tolerance", "seconds", "seconds_at_usual_pace", "seconds_predicted")
PREDICTED += ("slow_error", "slow_error_predicted", "slow_error_high")
# Folders of `reports` that hold something else than a study.
NO_STUDY = ("site", "paper", "accuracy", "pick")


@dataclass(frozen=True)
class StudyRecords:
    """All runs of one study.

    Parameters
    ----------
    name : str
        Its folder, with the file's name where that holds several studies.
    records : tuple of dict
    """

    name: str
    records: tuple[Record, ...]

    @cached_property
    def table(self) -> pd.DataFrame:
        """Records as a frame."""
        return frame(self.records)

    def groups(self) -> list[tuple[str, float, pd.DataFrame]]:
        """Scene, St and runs, by scene in the order of the records and by growing St."""
        found = []
        for scene in dict.fromkeys(self.table["scene_name"]):
            own = where(self.table, self.table["scene_name"] == scene)
            numbers = sorted(set(own["stokes"].astype(float)))
            found += [(str(scene), stokes, where(own, own["stokes"] == stokes)) for stokes in numbers]
        return found

    def days(self) -> list[str]:
        """Days on which runs were measured, as far as the records tell, in order."""
        return sorted({str(record["date"])[:10] for record in self.records if record.get("date")})

    def scenes(self) -> dict[str, Scene]:
        """Scenes by their contents as JSON."""
        contents = {json.dumps(record["scene"], sort_keys=True) for record in self.records if "scene" in record}
        return {content: parse_scene(json.loads(content)) for content in sorted(contents)}


@dataclass(frozen=True)
class Sources:
    """Everything found in a folder of reports.

    Parameters
    ----------
    folder : Path
    studies : dict
        By name.
    accuracy : tuple of AveragingErrors
    absent : tuple of Absent
        Where the averaged forms have no errors.
    predictions : tuple of dict
        Runs on scenes held out, each with what the laws said of it before.
    unreadable : tuple of str
        Files that are there but cannot be read, with the reason.
    """

    folder: Path
    studies: dict[str, StudyRecords]
    accuracy: tuple[AveragingErrors, ...]
    absent: tuple[Absent, ...]
    predictions: tuple[Record, ...]
    unreadable: tuple[str, ...]

    @cached_property
    def paper(self) -> dict[str, Data]:
        """Data of the paper's items that are there, by item; those that other code left behind are not."""
        found = {}
        for section in sections():
            for item in section.items:
                content = paper_store.judged(self.folder / "paper" / section.name, item)
                if content is not None:
                    found[item.name] = content[0]
        return found


def measured(studies: Iterable[StudyRecords]) -> str:
    """On which day, or from when to when, runs were measured; empty where no record tells."""
    days = sorted({day for study in studies for day in study.days()})
    if not days:
        return ""
    return f"on {days[0]}" if len(days) == 1 else f"from {days[0]} to {days[-1]}"


def read_sources(folder: Path) -> Sources:
    """Read what there is; what is not there, or cannot be read, is no error."""
    studies, unreadable = {}, []
    for path in _files(folder):
        name = path.parent.name if path.stem in (RECORDS, STORE, RUNS) else f"{path.parent.name}/{path.stem}"
        try:
            records = _complete(_records(path))
        except (ValueError, OSError, DamagedStoreError) as error:
            unreadable.append(f"{path}: {error}")
            continue
        if records:
            studies[name] = StudyRecords(name, records)
    errors: list[AveragingErrors] = []
    absent: list[Absent] = []
    predictions: list[Record] = []
    try:
        if (folder / "accuracy" / ERRORS).is_file():
            errors, absent = read_data(folder / "accuracy")
    except ValueError as error:
        unreadable.append(str(error))
    try:
        predictions = _predictions(folder / "pick" / "runs.csv")
    except (ValueError, OSError) as error:
        unreadable.append(f"{folder / 'pick' / 'runs.csv'}: {error}")
    return Sources(folder, studies, tuple(errors), tuple(absent), tuple(predictions), tuple(unreadable))


def _files(folder: Path) -> list[Path]:
    """One file per study: exported records; where there are none, the table of runs; where there is none, the store."""
    found = []
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if not path.is_dir() or path.name in NO_STUDY:
            continue
        exported, store = sorted(path.glob("*.jsonl")), path / f"{STORE}.sqlite"
        table = path / f"{RUNS}.csv"
        found += exported or ([table] if table.is_file() else [store] if store.is_file() else [])
    return found


def _records(path: Path) -> list[Record]:
    if path.suffix == ".jsonl":
        return read_export(path)
    if path.suffix == ".csv":
        with path.open(newline="", encoding="utf-8") as file:
            return [{name: _value(text) for name, text in row.items()} for row in csv.DictReader(file)]
    with Store(path) as store:
        return store.records()


def _value(text: str) -> Any:
    """What a CSV file's text stands for."""
    if text in ("", "<NA>"):
        return None
    try:
        return float(text)
    except ValueError:
        return text


def _complete(records: list[Record]) -> tuple[Record, ...]:
    for record in records:
        for name in NEEDED:
            if name not in record:
                raise ValueError(f"a record without {name!r}, expected those of `polhode bench`")
    return tuple(records)


def _predictions(path: Path) -> list[Record]:
    rows = _records(path) if path.is_file() else []
    for row in rows:
        for name in PREDICTED:
            if name not in row:
                raise ValueError(f"a row without {name!r}, expected those of `polhode validate`")
    return rows
