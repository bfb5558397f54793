"""What to run for a scene where the user leaves something open: what `pick` puts first among what is left."""

from math import isfinite
from typing import NamedTuple

from polhode.models.catalogue import form as find_form
from polhode.models.scene import Scene
from polhode.models.simplest import simplest

# Where `pick` knows no law for what the user insists on: errors stay below so many tolerances on ordinary scenes.
SAFETY = 100.0
LOOSEST, TIGHTEST = 1e-3, 1e-15


class Choice(NamedTuple):
    """A form, a solver and a tolerance, as `polhode solve` accepts them."""

    form: str
    solver: str
    tolerance: float


def choose(
    scene: Scene,
    form: str | None,
    solver: str | None,
    tolerance: float | None,
    error: float,
    want: str,
    samples: int = 201,
) -> Choice:
    """Fill in what the user left open.

    With form, solver and tolerance given nothing is left open. Else the first row of `pick` that agrees with what is
    given; where there is none, the simplest form, Taylor's method and a hundredth of the error.

    Raises
    ------
    NotAttainableError
        If nothing is given and no run meets the error.
    ValueError
        If the error or the tolerance is not a finite positive number.
    """
    for name, value in (("error", error), ("tolerance", tolerance)):
        if value is not None and not (isfinite(value) and value > 0):
            raise ValueError(f"{name}: got {value!r}, expected a finite positive number")
    if form and solver and tolerance:
        return Choice(form, solver, tolerance)
    from polhode.harness.pick import NotAttainableError, pick

    try:
        rows = pick(scene, error, want, samples).ranking
    except NotAttainableError:
        if not (form or solver or tolerance):
            raise
        rows = ()
    for row in rows:
        if form in (None, row.form) and solver in (None, row.solver):
            return Choice(row.form, row.solver, tolerance or row.tolerance)
    form = form or simplest(scene, "slow")[0]
    closed = find_form(form).problem(scene).closed_form is not None
    return Choice(
        form,
        solver or ("exact" if closed else "taylor"),
        tolerance or min(LOOSEST, max(TIGHTEST, error / SAFETY)),
    )
