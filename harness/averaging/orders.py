"""How accurate the averaged forms are: what was measured of them, and what it says about orders in 1/St."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isnan, log10

import numpy as np

from polhode.harness.common.text import in_two_digits
from polhode.models.rotation import Triple

VARIABLES = ("Lx", "Ly", "Lz", "E")
TARGETS = (1e-1, 1e-2, 1e-3, 1e-4)
# The law c/St^order is fitted from this St on, where it has set in, to at least so many St.
FITTED_FROM = 300.0
LEAST_POINTS = 4
# Runs of a case belong together if none ends before this share of the longest one: a shorter run errs less.
SAME_HORIZON = 0.99
# Where the paper says that the averaged equations are good.
GOOD_FROM = {"spheroid": 1e2, "ellipsoid": 1e3}
# The paper's averaged equations, by family of shapes.
FIRST_ORDER = {"spheroid": "averaged-spheroid", "ellipsoid": "averaged"}


@dataclass(frozen=True)
class Measured:
    """Errors of one averaged form at one St; maxima along the run, over I_max.

    Parameters
    ----------
    subject, family, form : str
    semi_axes : tuple of 3 float
    stokes : float
    until : float
        Slow time to which the form follows the case: second-order averaging stops short of L² = 2EI₂.
    model : tuple of 4 float
        Of the form's exact solution against the certified full one, in L_x, L_y, L_z, E.
    solver : tuple of 4 float
        Of the form solved as a user would (`polhode.harness.averaging.measure`) against the form's exact solution.
    uncertainty : float
        Of the full reference.
    pieces : int
        Pieces of the reference's certificate.
    """

    subject: str
    family: str
    form: str
    semi_axes: Triple
    stokes: float
    until: float
    model: tuple[float, ...]
    solver: tuple[float, ...]
    uncertainty: float
    pieces: int

    @property
    def model_error(self) -> float:
        """Largest of the four: the slow error."""
        return max(self.model)

    @property
    def solver_error(self) -> float:
        """Largest of the four."""
        return max(self.solver)


@dataclass(frozen=True)
class Absent:
    """A case that an averaged form has no errors for at one St, and why.

    Parameters
    ----------
    subject, family, form : str
    stokes : float
    reason : str
    """

    subject: str
    family: str
    form: str
    stokes: float
    reason: str


@dataclass(frozen=True)
class Law:
    """Model error of one form in one case as c St^(-order), and the St that it needs.

    Parameters
    ----------
    subject, family, form : str
    stokes, error : tuple of float
        What was measured, St increasing.
    until : tuple of float
        Slow time to which each run went; order and needed St rest on those of the longest horizon alone.
    """

    subject: str
    family: str
    form: str
    stokes: tuple[float, ...]
    error: tuple[float, ...]
    until: tuple[float, ...]

    @property
    def horizon(self) -> float:
        """Slow time up to which order and needed St hold."""
        return max(self.until)

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
    def fit(self) -> tuple[float, float, float]:
        """log₁₀ c, the order, and the half width of the order's 95 % interval, by least squares.

        NaN where fewer than `LEAST_POINTS` St were measured: with one degree of freedom an interval says nothing.
        """
        from scipy.stats import t

        x, y = np.log10(self.fitted)
        if len(x) < LEAST_POINTS:
            return float("nan"), float("nan"), float("nan")
        slope, constant = np.polyfit(x, y, 1)
        rest = y - (constant + slope * x)
        width = np.sqrt(np.sum(rest**2) / (len(x) - 2) / np.sum((x - x.mean()) ** 2))
        return float(constant), float(-slope), float(t.ppf(0.975, len(x) - 2) * width)

    @property
    def order(self) -> float:
        """Fitted order in 1/St."""
        return self.fit[1]

    @property
    def order_interval(self) -> tuple[float, float]:
        """95 % confidence interval of the order."""
        _, order, width = self.fit
        return order - width, order + width

    def needed(self, target: float) -> tuple[float, str]:
        """Smallest St from which on the error stays below `target`, and where that comes from.

        Returns
        -------
        float
            St.
        str
            "measured": between two measured St, by interpolation of logarithms; "at most": already at the smallest St
            measured; "extrapolated": beyond the largest one, by the fitted law.
        """
        stokes, error = self.alike
        above = np.flatnonzero(error > target)
        if not len(above):
            return float(stokes[0]), "at most"
        i = above[-1]
        if i + 1 == len(stokes):
            constant, order, _ = self.fit
            return 10 ** ((constant - log10(target)) / order), "extrapolated"
        x, y = np.log10(stokes[i : i + 2]), np.log10(error[i : i + 2])
        return float(10 ** np.interp(-log10(target), -y, x)), "measured"


def laws(rows: Sequence[Measured], variable: str | None = None) -> list[Law]:
    """The model error's law of each case and form: of the slow error, or of one of `VARIABLES`.

    St at which the error lies within ten uncertainties of the reference is left out.
    """
    groups: dict[tuple[str, str, str], list[Measured]] = {}
    for row in rows:
        groups.setdefault((row.subject, row.family, row.form), []).append(row)
    found = []
    for key, unordered in groups.items():
        group = sorted(unordered, key=lambda row: row.stokes)
        points = [
            (row.stokes, row.model_error if variable is None else row.model[VARIABLES.index(variable)], row.until)
            for row in group
        ]
        known = [point for point, row in zip(points, group, strict=True) if point[1] > 10 * row.uncertainty]
        if known:
            found.append(Law(*key, *(tuple(column) for column in zip(*known, strict=True))))
    return found


def statements(rows: Sequence[Measured]) -> list[str]:
    """What a reader may conclude: how good the paper's "good from St ≈ 100" is, and which orders hold."""
    own = laws(rows)
    first = [law for law in own if first_order(law.form)]
    second = [law for law in own if not first_order(law.form)]
    found = [_good(rows, first, family, stokes) for family, stokes in GOOD_FROM.items()]
    found += [_promise("First order", first, 1), _slower(rows)]
    for family, title in (("spheroid", "spheroids"), ("ellipsoid", "ellipsoids, no farther than L² = 2EI₂")):
        found.append(_promise(f"Second order, {title}", [law for law in second if law.family == family], 2))
    return [sentence for sentence in found if sentence]


def _good(rows: Sequence[Measured], first: Sequence[Law], family: str, stokes: float) -> str:
    """What the measured errors make of the paper's "good from St ≈ 100 (spheroid), ≈ 1000 (ellipsoid)"."""
    there = [row for row in rows if row.family == family and row.stokes == stokes and first_order(row.form)]
    if not there:
        return ""
    best, worst = (pick(there, key=lambda row: row.model_error) for pick in (min, max))
    needed = [law.needed(1e-2)[0] for law in first if law.family == family]
    needed = sorted(number for number in needed if not isnan(number))
    if needed:
        met = f"an error of 1 % is met from St ≈ {in_two_digits(needed[0])} to {in_two_digits(needed[-1])} on"
    else:
        met = "an error of 1 % is met at none of the St measured"
    return (
        f'The paper\'s "good from St ≈ {stokes:g} for the {family}" means, at that St, a slow error between '
        f"{best.model_error:.2g} ({best.subject}) and {worst.model_error:.2g} ({worst.subject}); {met}, depending on "
        "the case."
    )


def _promise(title: str, own: Sequence[Law], promised: int) -> str:
    """How the fitted orders compare with the order that averaging promises."""
    known = [law for law in own if not isnan(law.order)]
    few = len(own) - len(known)
    if not known:
        return f"{title}: too few St for an order." if few else ""
    orders = sorted(law.order for law in known)
    missed = [law for law in known if not _rounded(law)[0] <= promised <= _rounded(law)[1]]
    where = " and ".join(f"{law.subject} ({'{:.2f} to {:.2f}'.format(*_rounded(law))})" for law in missed)
    return (
        f"{title}: the slow error falls like 1/St^p, p fitted between {orders[0]:.2f} and {orders[-1]:.2f}. Averaging "
        f"promises p = {promised}, which lies in the 95 % interval of p in {len(known) - len(missed)} of {len(known)} "
        "cases"
        + (f", not in {where}" if missed else "")
        + (f". In {few} more there are fewer than {LEAST_POINTS} St to fit." if few else ".")
    )


def _slower(rows: Sequence[Measured]) -> str:
    """In which single variables first order falls more slowly than it promises."""
    slower = [
        f"{name} of {law.subject} ({law.order:.2f})"
        for name in VARIABLES
        for law in laws(rows, name)
        if first_order(law.form) and _rounded(law)[1] < 1
    ]
    if not slower:
        return ""
    return (
        "In single variables first order falls more slowly than 1/St, the whole interval of p lying below 1: "
        + ", ".join(slower)
        + ". The paper allows for that where the motion passes transient resonances."
    )


def _rounded(law: Law) -> tuple[float, float]:
    """The order's interval in the two decimals that are shown."""
    low, high = law.order_interval
    return round(low, 2), round(high, 2)


def first_order(form: str) -> bool:
    """Whether an averaged form is one of the paper's."""
    return form in FIRST_ORDER.values()
