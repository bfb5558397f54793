"""What to run for a scene where the user leaves something open: what `pick` puts first among what is left."""

from contextlib import suppress
from math import isinf
from typing import NamedTuple

from polhode.harness import DEFAULT_SAMPLES
from polhode.harness.common.text import duration, short
from polhode.harness.picking.candidate import LOOSEST, TIGHTEST
from polhode.harness.picking.ranking import NotAttainableError, check_asked, first_way, pick
from polhode.harness.picking.recommendation import Recommendation, outside_of_fit
from polhode.models.catalogue import form as find_form, full_form
from polhode.models.scene import Scene
from polhode.models.shape import require_numbers
from polhode.solvers.catalogue import SOLVERS, solver as find_solver

# Where `pick` knows no law for what the user insists on: errors stay below so many tolerances on
# ordinary scenes.
SAFETY = 100.0
# Seconds of a run that nobody expects unasked.
PATIENCE = 30.0
# Tolerances worth asking for: a tighter one is lost in the rounding of double precision, a looser
# one holds nothing.
LEAST_TOLERANCE, LARGEST_TOLERANCE = 1e-16, 1.0


class Chosen(NamedTuple):
    """A form, a solver and a tolerance, as `polhode solve` accepts them."""

    form: str
    solver: str
    tolerance: float
    note: str = ""  # that the error asked for will not be met, or may not be
    long: str = ""  # that the run will be long


def choose(
    scene: Scene,
    form: str | None,
    solver: str | None,
    tolerance: float | None,
    error: float,
    want: str,
    samples: int = DEFAULT_SAMPLES,
) -> Chosen:
    """Fill in what the user left open.

    With form, solver and tolerance given nothing is left open. Else what `pick` puts first of all
    that agrees with what is given, which it tries even where other ways are quicker; where there is
    none, the simplest form, the first solver that takes it and a hundredth of the error. Raises
    NotAttainableError if nothing is given and no run meets the error, ValueError if a number is out
    of range or the orientation is wanted of a form that gives none.
    """
    check_asked(error, want)
    error = float(error)
    if tolerance is not None:
        check_tolerance(tolerance)
    if form and want == "orientation" and find_form(form).orientation_of(scene) == "none":
        got = f"got 'orientation' for form {form!r}, which gives none"
        raise ValueError(f"want: {got}, expected 'slow' or another form")
    if form and solver and tolerance:
        return Chosen(form, solver, tolerance)
    row, found, refusal = None, None, ""
    with suppress(NotAttainableError):
        row = first_way(scene, error, want, samples, form, solver)
    if row is None:
        try:
            found = pick(scene, error, want, samples)
        except NotAttainableError as not_attainable:
            if not (form or solver or tolerance):
                raise
            refusal = not_attainable.reason
        rows = found.ranking if found else ()
        row = next(
            (each for each in rows if form in (None, each.form) and solver in (None, each.solver)),
            None,
        )
    if row:
        seconds, long = row.seconds.predicted, ""
        if seconds > PATIENCE:
            # Of scenes unlike those that its laws were fitted to a time may be anything.
            time = "long" if outside_of_fit(scene) else f"about {duration(seconds)}"
            long = f"it is expected to take {time}; Ctrl-C keeps what is finished"
        return Chosen(row.form, row.solver, tolerance or row.tolerance, long=long)
    form = form or simplest(scene)
    if not solver:
        # The closed form where there is one, else the first solver that can be run and takes the
        # problem.
        problem = find_form(form).problem(scene)
        able = [
            name
            for name in SOLVERS
            if find_solver(name).available and find_solver(name).takes(problem)
        ]
        solver = "exact" if problem.closed_form is not None else (able or [*SOLVERS])[0]
    if tolerance:
        return Chosen(form, solver, tolerance)
    unknown = f"{form} by {solver} runs all the same, but the error {short(error)} is {refusal}"
    note = _note(found, form, solver, error) if found else unknown
    return Chosen(form, solver, min(LOOSEST, max(TIGHTEST, error / SAFETY)), note)


def simplest(scene: Scene) -> str:
    """The full form of the fewest equations that takes a scene."""
    name = "euler-top" if isinf(scene.stokes) else full_form(scene)
    if name in ("quaternion", "spheroid-axis") and find_form("tumbling").takes(scene):
        name = "tumbling"
    find_form(name).check(scene)
    return name


def check_tolerance(tolerance: float) -> None:
    """Raise ValueError for a tolerance that is of no use in double precision."""
    require_numbers("tolerance", tolerance)
    if not LEAST_TOLERANCE <= tolerance <= LARGEST_TOLERANCE:
        expected = f"a number from {LEAST_TOLERANCE:g}, the rounding of double precision, to {LARGEST_TOLERANCE:g}"
        raise ValueError(f"tolerance: got {tolerance}, expected {expected}")


def _note(found: Recommendation, form: str, solver: str, error: float) -> str:
    """Why a method that `pick` does not rank may miss the error, and what would not."""
    reasons = {(each.form, each.solver): each.reason for each in found.excluded}
    best = f"{found.ranking[0].form} by {found.ranking[0].solver}"
    if (form, solver) not in reasons:
        return f"`pick` does not know whether {form} by {solver} meets the error {short(error)}; {best} is expected to"
    return f"{form} by {solver} is not expected to meet the error {short(error)}: {reasons[form, solver]}; {best} is"
