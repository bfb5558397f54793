"""What became of runs on hard cases: reached, inaccurate, of unknown error, stopped or failed, with the reason."""

from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from polhode.harness.common.store import Record
from polhode.harness.common.text import duration, scientific
from polhode.harness.references.errors import magnitude
from polhode.models.files.scene_file import parse_scene
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.contract import Status

# A run that reached its end but is further off the exact solution of its own form, in units of I_max or of the slow
# variables at the start if those are larger, has no digits to trust.
INACCURATE = 1e-3
KINDS = ("reached", "inaccurate", "unknown", "stopped", "failed")

Ending = tuple[str, str]
"""One of `KINDS`, and the reason in words."""


def limits(records: Iterable[Record]) -> dict[str, float]:
    """Slow error over I_max beyond which a run counts as inaccurate, by scene."""
    found: dict[str, float] = {}
    for record in records:
        if record["scene_name"] not in found:
            scene = parse_scene(record["scene"])
            found[record["scene_name"]] = INACCURATE * max(1.0, magnitude(scene.ellipsoid, scene.initial))
    return found


def outcome(run: dict[Any, Any], allowed: float = INACCURATE) -> Ending:
    """How a run ended, from its record as a row of `frames.frame`; `allowed` is one of `limits`."""
    status = str(run["status"])
    if status != Status.REACHED_END:
        meaning = Status(status).meaning if status in set(Status) else ""
        kind = "stopped" if status in (Status.TIME_LIMIT, Status.STEP_LIMIT) else "failed"
        return kind, f"{status.replace('_', ' ')}: {_known(run.get('message')) or meaning}"
    error, seconds = _known(run.get("solver_slow_error")), _known(run.get("seconds"))
    took = f"{duration(seconds)}, " if seconds is not None else ""
    if error is None:
        failure = _known(run.get("reference_failed"))
        return "unknown", f"reached the end, but {failure or 'there is no certified reference'}"
    model = _known(run.get("model_slow_error")) or 0.0
    off = f"; the form itself is off by {scientific(model)}" if model > 0 else ""
    return ("reached" if error <= allowed else "inaccurate"), f"{took}solver error {scientific(error)}{off}"


def endings(table: pd.DataFrame, allowed: Mapping[str, float]) -> list[dict[str, Any]]:
    """How every run ended: scene, St, duration, tolerance, form, solver, outcome and reason."""
    found = []
    for run in table.to_dict("records"):
        row = {"scene": str(run["scene_name"]), "St": float(run["stokes"]), "time": _known(run.get("scene.time"))}
        row |= {"tolerance": float(run["tolerance"]), "form": str(run["form"]), "solver": str(run["solver"])}
        kind, reason = outcome(run, allowed[row["scene"]])
        found.append({**row, "outcome": kind, "reason": reason})
    return found


def columns(table: pd.DataFrame) -> list[str]:
    """Solvers in the order of the catalogue, others last."""
    found = set(table["solver"])
    return [name for name in SOLVERS if name in found] + sorted(found - set(SOLVERS))


def _known(value: Any) -> Any:
    return None if value is None or value is pd.NA or value != value else value
