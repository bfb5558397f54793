"""Which errors a reference is good enough to know: one definition, for tables, figures and the regime map."""

from typing import cast

import pandas as pd

# An error is known if it exceeds this many times the reference's uncertainty: that then changes it by a
# tenth at most. A choice.
KNOWN = 10.0


def least_known(uncertainty: float | None) -> float:
    """The least error that a reference knows; NaN, above which nothing lies, where its uncertainty is unknown."""
    return float("nan") if uncertainty is None else KNOWN * uncertainty


def uncertainty_of(error: str) -> str:
    """Name of the column that holds the uncertainty of an error: `slow_uncertainty` of `slow_error`."""
    return error.replace("_error", "_uncertainty")


def known(runs: pd.DataFrame, error: str) -> pd.Series:
    """Which errors of a frame of records, in a column such as "slow_error", lie above the least one known.

    NA where there is no error; False where there is one, and no uncertainty to compare it with.
    """
    errors = runs[error].astype("Float64")
    uncertainties = pd.Series(runs.get(uncertainty_of(error), pd.NA), runs.index, dtype="Float64")
    above = (errors > KNOWN * uncertainties).fillna(value=False)
    return cast("pd.Series", above.where(errors.notna()))
