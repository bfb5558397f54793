"""Records as pandas frames."""

from collections.abc import Sequence
from typing import Any, cast

import pandas as pd

from polhode.harness.common.store import Record
from polhode.harness.references.uncertainty import known


def frame(records: Sequence[Record]) -> pd.DataFrame:
    """Records as a frame, one row each: nested results as columns `work.steps`, `scene.stokes`, and so on.

    Columns `slow_known` and `orientation_known` tell which errors lie above what the reference can tell
    (`polhode.harness.references.uncertainty.known`); NA where there is no error.
    """
    table = pd.json_normalize(list(records)).rename(columns={"scene.stokes": "stokes"})
    table = table.convert_dtypes(dtype_backend="numpy_nullable")
    for want in ("slow", "orientation"):
        if f"{want}_error" in table:
            table[f"{want}_known"] = known(table, f"{want}_error")
    return table


def where(table: pd.DataFrame, condition: Any) -> pd.DataFrame:
    """Rows of a frame that meet a condition on its columns."""
    return cast("pd.DataFrame", table.loc[condition])


def by_stokes(table: pd.DataFrame) -> list[tuple[float, pd.DataFrame]]:
    """Each St, in growing order, and its rows."""
    return [(float(str(stokes)), runs) for stokes, runs in table.groupby("stokes")]
