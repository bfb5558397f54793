"""Runs through resonances of polhode and precession, treated by partial averaging, measured."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import nan

from polhode.harness.averaging.cases import (
    BACKWARD,
    SAMPLES,
    TILTED,
    TOLERANCE,
    Case,
    Timed,
    fastest,
    timed_run,
    true_observables,
)
from polhode.harness.picking.unfit_reasons import why_unreached
from polhode.harness.references.errors import errors
from polhode.models.form import FormNotValidError
from polhode.models.scene import BodyStart, Scene
from polhode.models.second_order.form import SecondOrder
from polhode.models.second_order.run import prepared

# What integrates these runs, whose resonances want many small steps; the fastest of so many runs is told.
SOLVER, REPEATS = "cyrk-vern8", 3

CASES = tuple(
    Case(axes, BodyStart(TILTED, spin), slow_time, (4.0, 5.0, 6.0))
    for axes, spin, slow_time in (
        ((1.0, 0.8, 0.5), (0.6, 0.5, 0.5), 0.1),
        ((1.0, 0.6, 0.4), (0.5, -0.4, -1.2), 0.05),
        ((1.0, 0.6, 0.4), (1.5, 0.6, 0.4), 0.03),
        ((1.0, 0.9, 0.3), (1.0, 0.6, 0.6), 0.03),
        ((1.0, 0.8, 0.5), (1.2, 0.5, 0.2), 0.1),
    )
)
# Runs that meet L² = 2EI₂.
CROSSING = tuple(
    Case(axes, start, 0.1, (4.0, 5.0, 6.0))
    for axes, start in (
        ((1.0, 0.8, 0.5), BACKWARD),
        ((1.0, 0.8, 0.5), BodyStart(TILTED, (0.8, 0.5, 0.3))),
        ((1.0, 0.6, 0.4), BodyStart(TILTED, (1.5, 0.6, 0.4))),
    )
)


@dataclass(frozen=True)
class ResonantRow:
    """One resonant run: errors over `SAMPLES` equispaced samples, slow ones and the kick over I_max.

    Parameters
    ----------
    modes : str
        Modes treated, the strongest first, as (k₁, k₂).
    kick : float
        What the strongest of those that are met is predicted to give L, were it left out.
    integration, seconds : float
        Wall time in s of the integrator alone, and with the observables at all samples.
    refused : str
        Why the form does not follow the run; empty if it does.
    """

    shape: str
    start: str
    slow_time: float
    stokes: float
    modes: str
    kick: float
    slow: float
    estimated_slow: float
    first_order_slow: float
    orientation: float
    estimated_orientation: float
    integration: float
    seconds: float
    refused: str


def measure(case: Case, stokes: float) -> ResonantRow:
    """One row, against the full form in long double."""
    scene, form = case.scene(stokes), SecondOrder()
    try:
        estimate, run = form.estimate(scene), prepared(scene)
    except FormNotValidError as refusal:
        return _refused(case, stokes, refusal.condition)
    true, _ = true_observables(scene)
    found = _timed(scene)
    first = timed_run(scene, "averaged", TOLERANCE, SAMPLES).observables
    error = errors(scene.ellipsoid, found.observables, true)
    return ResonantRow(
        *case.names,
        case.slow_time,
        stokes,
        " ".join(f"({each.mask.k1}, {each.mask.k2})" for each in run.treated),
        max((each.kick for each in run.treated if each.met), default=nan),
        error.slow,
        estimate.slow,
        errors(scene.ellipsoid, first, true).slow,
        nan if error.orientation is None else error.orientation,
        estimate.orientation,
        found.integration,
        found.seconds,
        "",
    )


def measure_crossing(case: Case, stokes: float) -> ResonantRow:
    """One row over as much of a run as the form follows."""
    scene, form = case.scene(stokes), SecondOrder()
    try:
        reach = form.reach(scene)
    except FormNotValidError as refusal:
        return _refused(case, stokes, why_unreached(form, scene, refusal))
    return measure(replace(case, slow_time=reach), stokes)


def timed_anew(cases: Sequence[Case], rows: Sequence[ResonantRow]) -> Iterator[ResonantRow]:
    """The same rows with their times measured anew; errors and refusals stay as they are."""
    known = {case.names: case for case in cases}
    for row in rows:
        if row.refused:
            yield row
            continue
        case = replace(known[row.shape, row.start], slow_time=row.slow_time)
        run = _timed(case.scene(row.stokes))
        yield replace(row, integration=run.integration, seconds=run.seconds)


def _timed(scene: Scene) -> Timed:
    return fastest(REPEATS, scene, SecondOrder.name, TOLERANCE, SAMPLES, SOLVER)


def _refused(case: Case, stokes: float, reason: str) -> ResonantRow:
    return ResonantRow(*case.names, case.slow_time, stokes, "", nan, nan, nan, nan, nan, nan, nan, nan, reason)
