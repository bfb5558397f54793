"""Records as pandas frames."""

from collections.abc import Sequence
from typing import Any, cast

import pandas as pd

from polhode.harness.store import Record


def frame(records: Sequence[Record]) -> pd.DataFrame:
    """Records as a frame, one row each: nested results as columns `work.steps`, `scene.stokes`, and so on."""
    table = pd.json_normalize(list(records))
    return table.rename(columns={"scene.stokes": "stokes"}).convert_dtypes(dtype_backend="numpy_nullable")


def where(table: pd.DataFrame, condition: Any) -> pd.DataFrame:
    """Rows of a frame that meet a condition on its columns."""
    return cast("pd.DataFrame", table.loc[condition])
