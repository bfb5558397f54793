"""Runs through resonances of polhode and precession, treated by partial averaging, measured."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import nan

from polhode.harness.errors import errors
from polhode.harness.second_order_cases import BACKWARD, SAMPLES, TILTED, TOLERANCE, Case, timed_run, true_observables
from polhode.harness.text import duration, markdown, scientific
from polhode.models.form import FormNotValidError
from polhode.models.scene import BodyStart
from polhode.models.second_order import SecondOrder
from polhode.models.second_order_run import prepared

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
    seconds : float
        Wall time of the integration and the observables.
    refused : str
        Why the form does not describe the run; empty if it does.
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
    seconds: float
    refused: str


def measure(case: Case, stokes: float) -> ResonantRow:
    """One row, against the full form in long double."""
    scene, form = case.scene(stokes), SecondOrder()
    head = (*case.names, case.slow_time, stokes)
    try:
        estimate, run = form.estimate(scene), prepared(scene)
    except FormNotValidError as refusal:
        return ResonantRow(*head, "", nan, nan, nan, nan, nan, nan, nan, str(refusal))
    true, _ = true_observables(scene)
    found, seconds = timed_run(scene, form.name, TOLERANCE, SAMPLES, "cyrk-vern8")
    first, _ = timed_run(scene, "averaged", TOLERANCE, SAMPLES)
    error = errors(scene.ellipsoid, found, true)
    return ResonantRow(
        *head,
        " ".join(f"({each.mask.k1}, {each.mask.k2})" for each in run.treated),
        max((each.kick for each in run.treated if each.met), default=nan),
        error.slow,
        estimate.slow,
        errors(scene.ellipsoid, first, true).slow,
        nan if error.orientation is None else error.orientation,
        estimate.orientation,
        seconds,
        "",
    )


def measure_crossing(case: Case, stokes: float) -> ResonantRow:
    """One row over as much of a run as the form follows."""
    scene = case.scene(stokes)
    try:
        reach = SecondOrder().reach(scene)
    except FormNotValidError as refusal:
        return ResonantRow(*case.names, case.slow_time, stokes, "", nan, nan, nan, nan, nan, nan, nan, str(refusal))
    return measure(replace(case, slow_time=reach), stokes)


def section(rows: Sequence[ResonantRow], crossing: Sequence[ResonantRow]) -> str:
    """The report's part on resonances and on the way to L² = 2EI₂, as Markdown."""
    return "\n".join(
        (
            "## Through resonances\n",
            "Starts that meet k₁ν₁ + k₂ν₂ = 0. The kick is what the strongest mode would give L, were it left out; "
            "first order leaves it out, too. Time: integration by `cyrk-vern8` to "
            f"{TOLERANCE:g} and {SAMPLES} observables.\n",
            *_table(rows),
            "## Up to L² = 2EI₂\n",
            "Starts that meet it, followed to the t₂ that `reach` gives.\n",
            *_table(crossing),
        )
    )


def _table(rows: Sequence[ResonantRow]) -> list[str]:
    table = markdown(
        ("axes", "start", "t₂", "St", "modes treated", "kick predicted", "slow", "estimated", "first order", "gain",
         "orientation", "estimated", "time"),
        [
            (
                row.shape, row.start, f"{row.slow_time:.3g}", f"{row.stokes:.2g}", row.modes,
                *map(scientific, (row.kick, row.slow, row.estimated_slow, row.first_order_slow)),
                f"{row.first_order_slow / row.slow:.0f}",
                *map(scientific, (row.orientation, row.estimated_orientation)),
                duration(row.seconds),
            )
            for row in rows if not row.refused
        ],
        right=(2, 3, *range(5, 13)),
    )  # fmt: skip
    refused = [f"- {row.shape}, {row.start}, St = {row.stokes:.2g}: {row.refused}" for row in rows if row.refused]
    return [table, *(["Refused:\n", *refused, ""] if refused else [])]
