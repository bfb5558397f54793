"""What to run for a scene when the user does not say."""

from math import isfinite
from typing import NamedTuple

from polhode.models.catalogue import form as find_form
from polhode.models.scene import Scene
from polhode.models.simplest import simplest

# Taylor's slow error stays below this many tolerances on every scene of the bench.
SAFETY = 100.0
LOOSEST, TIGHTEST = 1e-3, 1e-15


class Choice(NamedTuple):
    """A form, a solver and a tolerance, as `polhode solve` accepts them."""

    form: str
    solver: str
    tolerance: float


def choose(
    scene: Scene, form: str | None, solver: str | None, tolerance: float | None, error: float, want: str
) -> Choice:
    """Fill in what the user left open.

    Raises
    ------
    ValueError
        If the error or the tolerance is not a finite positive number.
    """
    for name, value in (("error", error), ("tolerance", tolerance)):
        if value is not None and not (isfinite(value) and value > 0):
            raise ValueError(f"{name}: got {value!r}, expected a finite positive number")
    form = form or simplest(scene, want)[0]
    closed = find_form(form).problem(scene).closed_form is not None
    solver = solver or ("exact" if closed else "taylor")
    return Choice(form, solver, tolerance or min(LOOSEST, max(TIGHTEST, error / SAFETY)))
