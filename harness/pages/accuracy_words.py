"""What the words of the page of the averaged forms' accuracy mean."""

from collections.abc import Sequence

from polhode.harness.averaging.measure import SAMPLES, SOLVER, TOLERANCE
from polhode.harness.averaging.orders import FITTED_FROM, LEAST_POINTS, SAME_HORIZON, Measured
from polhode.harness.common.text import scientific, short


def definitions(rows: Sequence[Measured]) -> list[str]:
    """What the columns of the errors mean, as items of a list."""
    uncertainty = max(row.uncertainty for row in rows)
    return [
        f"- Errors are maxima over {SAMPLES} equispaced samples, from the start to the slow time t₂ = t/St in the "
        "column *to t₂*, divided by the largest moment of inertia. The *slow error* is the largest of the four.",
        "- First order is the paper's: `averaged` for triaxial ellipsoids, `averaged-spheroid` for spheroids. Second "
        "order, `averaged-second-order`, follows a triaxial ellipsoid to just short of L² = 2EI₂ alone: its errors are "
        "those of a shorter run, and not to be held against first order's over the whole one.",
        "- *Model*: the averaged equations' exact solution against the full equations', *model* without a variable "
        f"being the slow error. *Solver*: the averaged equations by `{SOLVER}` at tolerance {short(TOLERANCE)} against "
        "their exact solution, slow error.",
        f"- Every full solution is a certified reference: confirmed on at least {min(row.pieces for row in rows)} "
        "pieces by another form and method. *Reference* is its uncertainty, over the largest moment of inertia, at "
        f"most {scientific(uncertainty)}.",
    ]


def fits() -> list[str]:
    """How orders and needed St come about."""
    return [
        "The model error is taken as c/St^order and fitted by least squares on logarithms, from St = "
        f"{FITTED_FROM:g} on; *order* and its interval are the slow error's. *St fitted* counts the points; fewer "
        f"than {LEAST_POINTS} give no order. Orders hold for the horizon *to t₂*: runs that end before "
        f"{100 * SAME_HORIZON:g} % of it, as second order's do at small St, are left out of this table, because "
        "shorter runs err less.",
        "",
        "*St for* 0.1, 0.01, …: the St from which on the slow error (model) stays below that, interpolated between "
        "measured St. `<`: already at the smallest St of the row, below which the form refuses or nothing was "
        "measured. `~`: beyond the largest St, by the fitted law.",
    ]
