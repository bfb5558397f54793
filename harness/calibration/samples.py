"""Measured runs in the laws' terms: what they are fitted to."""

from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf

from polhode.harness.common.store import Record
from polhode.harness.common.timing import Pace
from polhode.harness.picking.laws import EPS, Load, Sensitivity
from polhode.harness.picking.load import held_back, load_of
from polhode.harness.picking.pilot import PilotFailedError, form_sensitivity, over_whole_run, pilot
from polhode.models.catalogue import form as find_form
from polhode.models.files.scene_file import parse_scene
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Status

# An error of this share of what is measured, or more, bears no law.
SANE = 0.1
# An error of this share of the tolerance is as good as none: how much smaller it is would only pull
# the law off.
LUCKY = 1e-3
# An uncertainty of more eps than this is that of a reference in double precision, below which
# nothing is known.
UNKNOWN = 1e4


@dataclass(frozen=True)
class Sample:
    """One measured run, in the laws' terms; sensitivity and error of each want that is known."""

    scene: str
    tolerance: float
    load: Load
    seconds: float
    errors: dict[str, tuple[Sensitivity, float]]


def sample_of(record: Record, pace: Pace) -> Sample | None:
    """A record in the laws' terms, at one pace; None for a run that failed, or whose pilot did."""
    if record["status"] != Status.REACHED_END or "seconds" not in record:
        return None
    form, solver = find_form(record["form"]), record["solver"]
    known: dict[str, tuple[Sensitivity, float]] = {}
    try:
        found = pilot(parse_scene(record["scene"]))
        load = load_of(form, solver, found, record["samples"], record["tolerance"])
    except PilotFailedError:
        return None
    with suppress(PilotFailedError):
        if not held_back(form, solver, found):
            pairs = form_sensitivity(form, found, solver).items()
            known = {
                want: (at, error)
                for want, at in pairs
                if (error := _error(record, want, at)) is not None
            }
    if not over_whole_run(form, solver):
        load = replace(load, steps=record.get("work", {}).get("steps"))
    return Sample(record["scene_name"], record["tolerance"], load, pace.seconds(record), known)


def _error(record: Record, want: str, at: Sensitivity) -> float | None:
    """A run's error, as far as it bears a law."""
    error = record.get(f"solver_{want}_error")
    if error is None or not error < SANE * at.largest or at.error == inf:
        return None
    uncertainty = record.get(f"solver_{want}_uncertainty", record.get(f"{want}_uncertainty")) or 0.0
    if error < uncertainty > UNKNOWN * EPS * at.largest:
        return None
    # Below the reference's uncertainty, below rounding, and far below a tolerance that means
    # something all are alike.
    lucky = 0.0 if find_solver(record["solver"]).closed_form else LUCKY * record["tolerance"]
    return max(error, uncertainty, EPS * at.largest / 10, lucky)
