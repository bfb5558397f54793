"""How accurate the averaged forms are: their model error in each slow variable, for the paper's cases, as St grows."""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from math import log10, pi
from multiprocessing import get_context

import numpy as np
from tqdm import tqdm

from polhode.harness.errors import Errors, errors
from polhode.harness.reference import ReferenceFailedError, reference
from polhode.models.catalogue import FORMS
from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.rotation import Triple, matrix_from_quaternion, quaternion_from_euler
from polhode.models.scene import BodyStart, EulerStart, Scene, Start
from polhode.models.scenes import NEAR_POLE_START, PAPER_ELLIPSOID, PAPER_START, PROLATE, SPHEROID_START
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

VARIABLES = ("Lx", "Ly", "Lz", "E")
TARGETS = (1e-1, 1e-2, 1e-3, 1e-4)
SLOW_TIME = 0.5
SAMPLES = 501
STOKES = (1e2, 10**2.5, 1e3, 10**3.5, 1e4, 1e5)
# Long double runs over T = 5e5 take half a minute: only cases in the first group are taken so far.
LARGEST_STOKES = 1e6
QUICK_STOKES = (1e2, 10**2.5, 1e3)
# What a user would integrate an averaged form with; its error is the column of the solver error.
SOLVER, TOLERANCE = "taylor", 1e-9
# The law c/St^order is fitted from this St on, where it has set in.
FITTED_FROM = 300.0
# Fitted orders below this are named: averaging promises 1.
SLOW_ORDER = 0.8
# Where the paper says that the averaged equations are good.
GOOD_FROM = {"spheroid": 1e2, "ellipsoid": 1e3}


@dataclass(frozen=True)
class Subject:
    """A case of the paper: everything but St.

    Parameters
    ----------
    name : str
    family : {"spheroid", "ellipsoid"}
    ellipsoid : Ellipsoid
    start : Start
    far : bool
        Whether to follow it up to `LARGEST_STOKES`.
    """

    name: str
    family: str
    ellipsoid: Ellipsoid
    start: Start
    far: bool = False

    def scene(self, stokes: float) -> Scene:
        """The case at one St, over `SLOW_TIME`."""
        return Scene(self.ellipsoid, stokes, self.start, SLOW_TIME * stokes)


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
        Of the form solved by `SOLVER` at `TOLERANCE` against the form's exact solution.
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
class Law:
    """Model error of one form in one case as c St^(-order), and the St that it needs.

    Parameters
    ----------
    subject, family, form : str
    stokes, error : tuple of float
        What was measured, St increasing.
    """

    subject: str
    family: str
    form: str
    stokes: tuple[float, ...]
    error: tuple[float, ...]

    @cached_property
    def fit(self) -> tuple[float, float, float]:
        """log₁₀ c, the order, and the half width of the order's 95 % interval, by least squares above `FITTED_FROM`.

        NaN where fewer than three St were measured there.
        """
        from scipy.stats import t

        x, y = np.log10(self.stokes), np.log10(self.error)
        late = x >= log10(FITTED_FROM)
        x, y = x[late], y[late]
        if len(x) < 3:
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
        above = [i for i, error in enumerate(self.error) if error > target]
        if not above:
            return self.stokes[0], "at most"
        i = above[-1]
        if i + 1 == len(self.stokes):
            constant, order, _ = self.fit
            return 10 ** ((constant - log10(target)) / order), "extrapolated"
        x, y = np.log10(self.stokes[i : i + 2]), np.log10(self.error[i : i + 2])
        return float(10 ** np.interp(-log10(target), -y, x)), "measured"


def aligned_with_vorticity(ellipsoid: Ellipsoid, theta: float, psi: float, momentum: float) -> BodyStart:
    """Start with φ = 0 and L = momentum · I_max ẑ: the phase planes' starts (`fig:SI1005550`, spheroid figures)."""
    quaternion = quaternion_from_euler((theta, 0.0, psi))
    vertical = matrix_from_quaternion(np.array(quaternion))[:, 2].tolist()
    size = momentum * max(ellipsoid.inertia)
    w1, w2, w3 = (size * z / i for z, i in zip(vertical, ellipsoid.inertia, strict=True))
    return BodyStart(quaternion, (w1, w2, w3))


def subjects() -> Iterator[Subject]:
    """The paper's cases: its two starts of each shape, and one start of each phase plane."""
    saddle = EulerStart((1.57, 0.0, pi / 2), (0.0, -0.61, 0.0003))
    yield Subject("spheroid κ = 2", "spheroid", Ellipsoid(PROLATE), SPHEROID_START, far=True)
    yield Subject("spheroid κ = 2, near the saddle", "spheroid", Ellipsoid(PROLATE), NEAR_POLE_START)
    yield Subject("ellipsoid (1, 0.8, 0.5)", "ellipsoid", Ellipsoid(PAPER_ELLIPSOID), PAPER_START, far=True)
    yield Subject("ellipsoid (1, 0.8, 0.5), near the saddle", "ellipsoid", Ellipsoid(PAPER_ELLIPSOID), saddle)
    for kappa in (2.0, 3.33, 0.5, 0.3):
        shape = Ellipsoid((1.0, 1.0, kappa))
        start = aligned_with_vorticity(shape, pi / 4, 0.0, -1.0)
        yield Subject(f"phase plane κ = {kappa:g}", "spheroid", shape, start)
    for b in (0.55, 0.75, 0.95):
        for c in (0.5, 0.3):
            shape = Ellipsoid((1.0, b, c))
            start = aligned_with_vorticity(shape, pi / 4, pi / 2, -1.0)
            yield Subject(f"phase plane (1, {b:g}, {c:g})", "ellipsoid", shape, start)


def measure(subject: Subject, stokes: float) -> list[Measured]:
    """Errors of every averaged form that is valid for a case at one St, as far as it follows it.

    A form whose own exact solution is not certified gives no row.

    Raises
    ------
    ReferenceFailedError
        If there is no certified reference of the full solution.
    """
    whole = subject.scene(stokes)
    rows = []
    for name in FORMS:
        form = find_form(name)
        if not form.averaged:
            continue
        try:
            until = form.reach(whole)
        except FormNotValidError:
            continue
        scene = replace(whole, time=until * stokes)
        full = reference(scene, "quaternion", SAMPLES)
        try:
            exact = reference(scene, form, SAMPLES)
        except ReferenceFailedError:
            continue
        solution = solve(form.problem(scene), SOLVER, TOLERANCE, exact.times)
        if not solution.success:
            raise ReferenceFailedError(f"{subject.name}, St = {stokes:g}: {name} ended with {solution.status}")
        model: Errors = errors(scene.ellipsoid, exact.observables, full.observables)
        own = errors(scene.ellipsoid, form.observe(scene, solution.states), exact.observables)
        rows.append(
            Measured(
                subject.name,
                subject.family,
                name,
                scene.ellipsoid.semi_axes,
                stokes,
                until,
                model.slow_each,
                own.slow_each,
                full.slow_uncertainty,
                full.certificate.pieces,
            )
        )
    return rows


def measure_all(*, quick: bool = False, quiet: bool = False, workers: int | None = None) -> list[Measured]:
    """Measure all cases over all St, the longest runs first, on as many processes as there are cores.

    Parameters
    ----------
    quick : bool
        Small St alone: a look.
    quiet : bool
        No progress on stderr.
    workers : int, optional
        Number of processes.
    """
    numbers = QUICK_STOKES if quick else STOKES
    cases = list(subjects())
    tasks = [(subject, stokes) for subject in cases for stokes in numbers]
    tasks += [] if quick else [(subject, LARGEST_STOKES) for subject in cases if subject.far]
    tasks.sort(key=lambda task: -task[1])
    rows: list[Measured] = []
    with ProcessPoolExecutor(workers or os.cpu_count(), mp_context=get_context("spawn")) as pool:
        outcomes = pool.map(measure, *zip(*tasks, strict=True))
        for measured in tqdm(outcomes, total=len(tasks), disable=quiet, unit="reference", desc="accuracy", leave=False):
            rows += measured
    order = {subject.name: i for i, subject in enumerate(cases)}
    return sorted(rows, key=lambda row: (order[row.subject], row.form, row.stokes))


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
        pairs = [
            (row.stokes, row.model_error if variable is None else row.model[VARIABLES.index(variable)]) for row in group
        ]
        known = [pair for pair, row in zip(pairs, group, strict=True) if pair[1] > 10 * row.uncertainty]
        if known:
            found.append(Law(*key, *(tuple(column) for column in zip(*known, strict=True))))
    return found


def statements(rows: Sequence[Measured]) -> list[str]:
    """What the measured errors make of the paper's "good from St ≈ 100 (spheroid), ≈ 1000 (ellipsoid)"."""
    sentences = []
    for family, stokes in GOOD_FROM.items():
        there = [row for row in rows if row.family == family and row.stokes == stokes and first_order(row.form)]
        own = [law for law in laws(rows) if law.family == family and first_order(law.form)]
        if not there:
            continue
        worst, best = max(there, key=lambda row: row.model_error), min(there, key=lambda row: row.model_error)
        needed = sorted(law.needed(1e-2)[0] for law in own)
        sentences.append(
            f'"Good from St ≈ {stokes:g} for the {family}" means a slow error, along the whole run and over I_max, '
            f"between {best.model_error:.2g} ({best.subject}) and {worst.model_error:.2g} ({worst.subject}) at that "
            f"St; 1 % is met from St ≈ {needed[0]:.0f} to {needed[-1]:.0f} on, depending on the case."
        )
    slower = [
        f"{law.order:.2f} in {name} ({law.subject})"
        for name in VARIABLES
        for law in laws(rows, name)
        if first_order(law.form) and law.order < SLOW_ORDER
    ]
    if slower:
        sentences.append(
            "The error does not always fall like 1/St: the fitted order is "
            + ", ".join(slower)
            + ". The paper allows for that where the motion passes transient resonances."
        )
    return sentences


def first_order(form: str) -> bool:
    """Whether an averaged form is one of the paper's."""
    return form in ("averaged", "averaged-spheroid")
