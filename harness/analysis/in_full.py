"""Runs of form `hybrid` that average nothing: full equations under another name.

Form `hybrid` averages only the segments in which that pays (`docs/second-order.md`, section 10). A
run without such a segment is no win of averaging, and pages must not count it as one. Nor does its row show
the tolerance of its solver: `hybrid` makes of the run's tolerance another one for the full equations.
"""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from polhode.models.catalogue import form as find_form
from polhode.models.hybrid.plan import ERROR_PER_TOLERANCE, foreseen
from polhode.models.scene import Scene

HYBRID = "hybrid"
# Two runs that agree in these columns to the last digit took the same steps.
_OF_STEPS = (
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

    That is so if it took the same steps as a run of a full form, or if the plan of `hybrid` for its
    scene averages no segment. A run of a scene that is not given has no plan.

    Parameters
    ----------
    runs
        A frame with a row for each run.
    scenes
        Scenes with the names that they have in the frame, where several differ by St.

    Returns
    -------
    Series
        A boolean for each row of the frame, with its index.
    """
    is_hybrid = runs["form"] == HYBRID
    in_full = _took_steps_of_full_runs(runs) | _planned_without_averaging(runs, scenes)
    return pd.Series(is_hybrid & in_full, dtype=bool)


def _took_steps_of_full_runs(runs: pd.DataFrame) -> pd.Series:
    """Whether each run agrees in `_OF_STEPS` with a run of a full form, itself among them."""
    averages = runs["form"].map(lambda name: find_form(name).averaged)
    successful = runs["slow_error"].notna()
    of_full_form = ~averages & (runs["form"] != HYBRID) & successful
    columns = [name for name in _OF_STEPS if name in runs]
    # Counts that a solver does not give are None in both runs, and equal: NaN would not be.
    values = runs[columns].astype(object)
    values = values.where(values.notna(), None)
    rows = pd.Series(list(values.itertuples(index=False, name=None)), index=runs.index)
    same_steps = rows.isin(list(set(rows[of_full_form])))
    return pd.Series(successful & same_steps, dtype=bool)


def _planned_without_averaging(
    runs: pd.DataFrame, scenes: Sequence[tuple[str, Scene]]
) -> pd.Series:
    """Whether each run is one of `hybrid` that is planned without an averaged segment."""
    scene_of = {(name, scene.stokes): scene for name, scene in scenes}
    # Plans are made once for each scene and tolerance: solvers share them.
    plans: dict[tuple[Any, ...], bool] = {}
    planned = []
    for form, name, stokes, tolerance in zip(
        runs["form"], runs["scene_name"], runs["stokes"], runs["tolerance"], strict=True
    ):
        if form != HYBRID or (name, stokes) not in scene_of:
            planned.append(False)
            continue
        case = (name, stokes, tolerance)
        if case not in plans:
            plans[case] = planned_in_full(scene_of[name, stokes], tolerance)
        planned.append(plans[case])
    return pd.Series(planned, index=runs.index, dtype=bool)


def planned_in_full(scene: Scene, tolerance: float) -> bool:
    """Whether a run of `hybrid` is planned without an averaged segment."""
    requested_error = ERROR_PER_TOLERANCE * tolerance
    segments = foreseen(scene, requested_error)
    # Averaged segments are of second order.
    return not any(segment.second_order for segment in segments)
