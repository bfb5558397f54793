"""What a reference can tell: one definition of a known error, for tables, figures and the regime map."""

from typing import cast

import pandas as pd

# An error closer to the reference's uncertainty than this factor is not known.
KNOWN = 10.0
BRACKETS = f"Errors in brackets lie within {KNOWN:g} times the uncertainty of the reference, which cannot tell them."


def least_known(uncertainty: float | None) -> float:
    """The error down to which a reference can tell; NaN, above which nothing lies, where the uncertainty is unknown."""
    return float("nan") if uncertainty is None else KNOWN * uncertainty


def uncertainty_of(error: str) -> str:
    """Name of the column that holds the uncertainty of an error: `slow_uncertainty` of `slow_error`."""
    return error.replace("_error", "_uncertainty")


def known(runs: pd.DataFrame, error: str) -> pd.Series:
    """Which errors of a frame of records lie above what their references can tell.

    Parameters
    ----------
    runs : DataFrame
    error : str
        Column of the errors, as "slow_error".

    Returns
    -------
    Series of boolean
        NA where there is no error; False where there is one, and no uncertainty to compare it with.
    """
    errors = runs[error].astype("Float64")
    column = uncertainty_of(error)
    uncertainties = runs[column].astype("Float64") if column in runs else pd.Series(pd.NA, runs.index, dtype="Float64")
    told = (errors > KNOWN * uncertainties).fillna(value=False)
    return cast("pd.Series", told.where(errors.notna()))
