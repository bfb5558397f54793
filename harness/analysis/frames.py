"""Records as pandas frames.

A record is what the store holds of a run, as nested dictionaries (`polhode.harness.studies.case`).
A frame has a row for each record, and a column for each value, named by its keys with dots between. Values
that a record lacks are missing: `pandas.NA`, or NaN in a column of lists. Lists are left as they are.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd

from polhode.harness.common.files import write_file
from polhode.harness.common.store import Record

# Columns of `runs.csv`, in its order: what a reader of its page looks for. Errors are the largest along the run;
# errors of L and E are over I_max, errors of the orientation in rad.
RUN_COLUMNS = [
    "scene_name",
    "stokes",
    "form",
    "solver",
    "tolerance",
    "status",  # value of `polhode.solvers.contract.Status`
    "slow_error",  # of L and E, against the full equations
    "orientation_error",  # against the full equations
    "model_slow_error",  # of L and E, of the form's exact solution; 0 for a full form
    "slow_uncertainty",  # of the reference's L and E
    "orientation_uncertainty",  # of the reference's orientation
    "seconds",  # of the fastest warm run
    "seconds_spread",  # of the slowest one, less the fastest one's
    "work.rhs_calls",
    "work.steps",
    "sentinel_seconds",  # of a fixed piece of arithmetic beside the runs (`polhode.harness.common.timing`)
    "date",
    "scene.time",  # in inverse shear rates
    "scene.shape.semi_axes",
]
# The column that frames call "stokes", since nearly all that is done with them asks for it.
_STOKES = "scene.stokes"
# Columns that every record of a run of a scene has; `of_runs` refuses records without them.
NEEDED = ("scene_name", "stokes", "form", "solver", "tolerance", "status")
# Columns of errors and times, which most failed runs lack. A frame of all columns has them, empty, even where
# every run failed.
_OF_SUCCESSES = (
    "slow_error",
    "orientation_error",
    "slow_uncertainty",
    "orientation_uncertainty",
    "seconds",
)
# Six significant digits of numbers in `runs.csv`: times and errors are known to fewer. St and durations are
# rounded as well; `records.jsonl.gz` has all their digits.
_CSV_NUMBER = "%.6g"
# pandas before 3.1 reads a number to its last bit only if it is told to. Later ones warn of being told.
_PANDAS = tuple(map(int, pd.__version__.split(".")[:2]))
_EXACT = {"float_precision": "round_trip"} if _PANDAS < (3, 1) else {}


def read_csv(source: Any, **options: Any) -> pd.DataFrame:
    """`pandas.read_csv`, with each number as it was written, under every version of pandas."""
    return pd.read_csv(source, **_EXACT, **options)


def frame(records: Iterable[Record], columns: Collection[str] = ()) -> pd.DataFrame:
    """Records as a frame, one row each, with pandas' nullable types.

    With `columns` the frame has only these, as far as records have them, and takes less memory. Columns of
    `_OF_SUCCESSES` among them are there even if no record has them.
    """
    if columns:
        records = (_picked(record, columns) for record in records)
    table = pd.json_normalize(list(records)).rename(columns={_STOKES: "stokes"})
    # pandas before 3 casts infinite numbers to integers while it looks for integers.
    with np.errstate(invalid="ignore"):
        table = table.convert_dtypes(dtype_backend="numpy_nullable")
    for name in _OF_SUCCESSES:
        if name not in table and (name in columns or not columns):
            table[name] = pd.array([pd.NA] * len(table), dtype="Float64")
    return table


def of_runs(table: pd.DataFrame, path: Path) -> pd.DataFrame:
    """The frame of a file's records, as it is; ValueError if there are none, or some of another kind."""
    if not len(table):
        raise ValueError(f"{path}: got no records, expected at least one")
    complete = table.dropna(axis="columns").columns
    lacking = [name for name in NEEDED if name not in complete]
    if lacking:
        raise ValueError(
            f"{path}: got a record without {lacking[0]!r}, expected those of `polhode bench`"
        )
    return table


def frame_of(kind: type, rows: Sequence[Any]) -> Any:
    """Rows, objects of the dataclass `kind`, as a frame; it has the columns even if there are no rows."""
    return pd.DataFrame(rows, columns=pd.Index([field.name for field in fields(kind)]))


def _picked(record: Record, columns: Collection[str]) -> Record:
    """The values of a record that go into these columns, by their keys with dots between.

    `pandas.json_normalize` leaves such keys as they are.
    """
    picked = {}
    for name in columns:
        path = _STOKES if name == "stokes" else name
        value: Any = record
        for part in path.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        if value is not None:
            picked[path] = value
    return picked


def where(table: pd.DataFrame, condition: Any) -> pd.DataFrame:
    """Rows of a frame that meet a condition on its columns; type checkers take them for a frame too."""
    return cast("pd.DataFrame", table.loc[condition])


def rows_of(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Rows of a frame as dictionaries, None where there is nothing."""
    rows: Any = table.astype(object).where(table.notna(), None).to_dict("records")
    return rows


def by_scene(table: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Names of the scenes, each with its runs, in the order of the records.

    A single scene has the name "": pages then do not name it.
    """
    if "scene_name" not in table or len(set(table["scene_name"])) < 2:
        return [("", table)]
    return [(str(name), runs) for name, runs in table.groupby("scene_name", sort=False)]


def by_stokes(table: pd.DataFrame) -> list[tuple[float, pd.DataFrame]]:
    """Each St, in growing order, and its rows."""
    # To type checkers a group's key may be anything; by way of its digits it is a float, unchanged.
    return [(float(str(stokes)), runs) for stokes, runs in table.groupby("stokes")]


def write_runs(table: pd.DataFrame, folder: Path) -> None:
    """Write every run as a line of `runs.csv`, with the columns of `RUN_COLUMNS` that the frame has."""
    runs = table[[column for column in RUN_COLUMNS if column in table]]
    write_file(folder / "runs.csv", runs.to_csv(index=False, float_format=_CSV_NUMBER), summed=True)
