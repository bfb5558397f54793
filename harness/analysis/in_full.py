"""Runs of `hybrid` that average nothing: they are runs of the full form, at a tolerance of their own.

Form `hybrid` averages only segments where that pays (`docs/second-order.md`, section 10). A run
without such a segment is no win of averaging, and pages must not count it as one.
"""

from collections.abc import Sequence

import pandas as pd

from polhode.models.catalogue import form as find_form
from polhode.models.hybrid.plan import ERROR_PER_TOLERANCE, foreseen
from polhode.models.scene import Scene

HYBRID = "hybrid"
# Columns that two runs with the same steps share to the last digit, even at unequal tolerances.
_SHARED = (
    "scene_name",
    "stokes",
    "solver",
    "slow_error",
    "orientation_error",
    "work.steps",
    "work.rhs_calls",
)


def ran_in_full(runs: pd.DataFrame, scenes: Sequence[tuple[str, Scene]] = ()) -> pd.Series:
    """Whether each run is one of `hybrid` that averages nothing.

    It has the errors and the counts of work of a run of a full form; or its plan for the scene of
    this name and St averages no segment.
    """
    hybrid = runs["form"] == HYBRID
    full = runs["form"].map(lambda name: not find_form(name).averaged) & ~hybrid
    successful = runs["slow_error"].notna()
    shared = [name for name in _SHARED if name in runs]
    # Counts that a solver does not give are equal where both lack them.
    values = runs[shared].astype(object)
    keys = pd.Series(
        list(values.where(values.notna(), None).itertuples(index=False, name=None)),
        index=runs.index,
    )
    identical = successful & keys.isin(list(set(keys[full & successful])))
    by_name = {(name, scene.stokes): scene for name, scene in scenes}
    cases = list(zip(runs["scene_name"], runs["stokes"], runs["tolerance"], strict=True))
    plans = {
        (name, stokes, tolerance): planned_in_full(by_name[name, stokes], tolerance)
        for name, stokes, tolerance in {
            case for case, is_hybrid in zip(cases, hybrid, strict=True) if is_hybrid
        }
        if (name, stokes) in by_name
    }
    planned = pd.Series([plans.get(case, False) for case in cases], index=runs.index, dtype=bool)
    return pd.Series(hybrid & (identical | planned), dtype=bool)


def planned_in_full(scene: Scene, tolerance: float) -> bool:
    """Whether a run of `hybrid` is planned without an averaged segment."""
    segments = foreseen(scene, ERROR_PER_TOLERANCE * tolerance)
    return not any(segment.second_order for segment in segments)
