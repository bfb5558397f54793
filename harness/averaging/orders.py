"""Orders in 1/St that follow from the measured errors, and the St that an error needs."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import log10, nan

import numpy as np

from polhode.harness.averaging.data import VARIABLES, AveragingErrors, SecondOrderErrors
from polhode.harness.common.fits import power_law
from polhode.models.second_order.form import SecondOrder

NEEDED_ERRORS = (1e-1, 1e-2, 1e-3, 1e-4)  # Errors whose least St the page gives.
# The law c/St^order is fitted from this St on, as it has set in there.
FITTED_FROM = 300.0
LEAST_POINTS = 4  # St of a fit, at least.
# Runs of a case belong together if none ends before this share of the longest one: a shorter run
# errs less.
SAME_HORIZON = 0.99
# Slopes are fitted to errors between these two.
LARGEST_FITTED_ERROR = 1e-2
LEAST_RESOLVED = 100.0  # Times the reference's uncertainty.


@dataclass(frozen=True)
class Law:
    """Model error of one form in one case as c St^(-order), and the St that it needs.

    Order and needed St rest on the runs of the longest horizon, the slow time `until`, alone.
    """

    subject: str
    family: str
    form: str
    stokes: tuple[float, ...]
    error: tuple[float, ...]
    until: tuple[float, ...]

    horizon = property(
        lambda law: max(law.until), doc="Slow time up to which order and needed St hold."
    )

    @property
    def alike(self) -> tuple[np.ndarray, np.ndarray]:
        """St and errors of the runs that share the longest horizon."""
        same = np.array(self.until) >= SAME_HORIZON * self.horizon
        return np.array(self.stokes)[same], np.array(self.error)[same]

    @property
    def fitted(self) -> tuple[np.ndarray, np.ndarray]:
        """St and errors that the order is fitted to: of `alike`, those above `FITTED_FROM`."""
        stokes, error = self.alike
        return stokes[stokes >= FITTED_FROM], error[stokes >= FITTED_FROM]

    @cached_property
    def fit(self) -> tuple[float, tuple[float, float]]:
        """The order, and its 95 % interval."""
        # NaN where fewer than `LEAST_POINTS` St were measured: with one degree of freedom an
        # interval says nothing.
        stokes, error = self.fitted
        if len(stokes) < LEAST_POINTS:
            return nan, (nan, nan)
        exponent, (low, high), _ = power_law(stokes, error)
        return -exponent, (-high, -low)

    order = property(lambda law: law.fit[0], doc="Fitted order in 1/St.")
    order_interval = property(lambda law: law.fit[1], doc="95 % confidence interval of the order.")
    shown = property(
        lambda law: [round(end, 2) for end in law.order_interval],
        doc="It in the two decimals shown.",
    )

    def needed(self, target: float) -> tuple[float, str]:
        """Smallest St from which on the error stays below `target`, and where that comes from.

        "measured": between two measured St, by interpolation of logarithms; "at most": already at
        the smallest St measured; "extrapolated": beyond the largest one, from its error on, by the
        fitted order.
        """
        stokes, error = self.alike
        above = np.flatnonzero(error > target)
        if not len(above):
            return float(stokes[0]), "at most"
        i = above[-1]
        if i + 1 == len(stokes):
            further = (error[-1] / target) ** (1 / self.order) if self.order > 0 else nan
            return float(stokes[-1] * further), "extrapolated"
        x = np.log10(stokes[i : i + 2])
        y = np.log10(error[i : i + 2])
        return float(10 ** np.interp(-log10(target), -y, x)), "measured"


@dataclass(frozen=True)
class Slope:
    """Fitted exponents of St, with the numbers of points that they rest on."""

    shape: str
    start: str
    slow: float
    slow_points: int
    orientation: float
    orientation_points: int


def laws(rows: Sequence[AveragingErrors], variable: str | None = None) -> list[Law]:
    """The model error's law of each case and form: of the slow error, or of one of `VARIABLES`."""
    # St at which the error lies within ten uncertainties of the reference is left out.
    groups = defaultdict(list)
    for row in sorted(rows, key=lambda row: row.stokes):
        error = row.model_error if variable is None else row.model[VARIABLES.index(variable)]
        if error > 10 * row.uncertainty:
            groups[row.subject, row.family, row.form].append((row.stokes, error, row.until))
    order = dict.fromkeys((row.subject, row.family, row.form) for row in rows)
    return [Law(*key, *zip(*groups[key], strict=True)) for key in order if key in groups]


def first_order(form: str) -> bool:
    """Whether an averaged form is one of the paper's."""
    return form != SecondOrder.name


def slopes(rows: Sequence[SecondOrderErrors]) -> list[Slope]:
    """Fitted exponents of St, one pair for each case; the orientation's over the top two decades."""
    fitted = []
    for case in dict.fromkeys((row.shape, row.start) for row in rows):
        case_rows = [row for row in rows if (row.shape, row.start) == case]
        top = max(row.stokes for row in case_rows)
        slow = [
            (r.stokes, r.slow)
            for r in case_rows
            if LEAST_RESOLVED * r.slow_uncertainty < r.slow < LARGEST_FITTED_ERROR
        ]
        turned = [(r.stokes, r.orientation) for r in case_rows if r.stokes >= 0.99e-2 * top]
        fitted.append(Slope(*case, _exponent(slow), len(slow), _exponent(turned), len(turned)))
    return fitted


def _exponent(points: Sequence[tuple[float, float]]) -> float:
    return power_law(*np.transpose(points))[0] if len(points) > 1 else nan
