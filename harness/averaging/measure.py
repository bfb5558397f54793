"""How far the averaged forms are from the full ones: runs of the paper's cases, measured as St grows."""

import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from math import pi
from multiprocessing import get_context

import numpy as np
from tqdm import tqdm

from polhode.harness.averaging.orders import FIRST_ORDER, Absent, Measured, first_order
from polhode.harness.picking.unfit_reasons import why_unreached
from polhode.harness.references.errors import Errors, errors
from polhode.harness.references.reference import ReferenceFailedError, reference
from polhode.models.catalogue import FORMS
from polhode.models.catalogue import form as find_form
from polhode.models.form import Form, FormNotValidError
from polhode.models.rotation import matrix_from_quaternion, quaternion_from_euler
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.scenes import NEAR_POLE_START, PAPER_ELLIPSOID, PAPER_START, PROLATE, SPHEROID_START
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

SLOW_TIME = 0.5
SAMPLES = 501
STOKES = (1e2, 10**2.5, 1e3, 10**3.5, 1e4, 1e5)
# Long double runs over T = 5e5 take half a minute: only cases in the first group are taken so far.
LARGEST_STOKES = 1e6
QUICK_STOKES = (1e2, 10**2.5, 1e3)
# What a user would integrate an averaged form with; its error is the column of the solver error.
SOLVER, TOLERANCE = "taylor", 1e-9

UNCERTIFIED = "its own exact solution is not certified"

Outcome = tuple[list[Measured], list[Absent]]


@dataclass(frozen=True)
class Subject:
    """A case of the paper: everything but St.

    Parameters
    ----------
    name : str
    family : {"spheroid", "ellipsoid"}
    ellipsoid : Ellipsoid
    start : EulerStart or BodyStart
    far : bool
        Whether to follow it up to `LARGEST_STOKES`.
    """

    name: str
    family: str
    ellipsoid: Ellipsoid
    start: EulerStart | BodyStart
    far: bool = False

    def scene(self, stokes: float) -> Scene:
        """The case at one St, over `SLOW_TIME`."""
        return Scene(self.ellipsoid, stokes, self.start, SLOW_TIME * stokes)


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


def measure(subject: Subject, stokes: float) -> Outcome:
    """Errors of the averaged forms meant for a case's shape at one St, as far as each follows it.

    A form that refuses the case, or whose own exact solution is not certified, is absent with its reason.

    Raises
    ------
    ReferenceFailedError
        If there is no certified reference of the full solution.
    """
    whole = subject.scene(stokes)
    rows: list[Measured] = []
    absent: list[Absent] = []
    for form in forms(subject.family):
        head = subject.name, subject.family, form.name
        try:
            until = form.reach(whole)
        except FormNotValidError as refusal:
            absent.append(Absent(*head, stokes, f"refused: {why_unreached(form, whole, refusal)}"))
            continue
        scene = replace(whole, time=until * stokes)
        full = reference(scene, "quaternion", SAMPLES)
        try:
            exact = reference(scene, form, SAMPLES)
        except ReferenceFailedError as failure:
            absent.append(Absent(*head, stokes, f"{UNCERTIFIED}: {failure}"))
            continue
        solution = solve(form.problem(scene), SOLVER, TOLERANCE, exact.times)
        if not solution.success:
            raise ReferenceFailedError(f"{subject.name}, St = {stokes:g}: {form.name} ended with {solution.status}")
        model: Errors = errors(scene.ellipsoid, exact.observables, full.observables)
        own = errors(scene.ellipsoid, form.observe(scene, solution.states), exact.observables)
        rows.append(
            Measured(
                *head,
                scene.ellipsoid.semi_axes,
                stokes,
                until,
                model.slow_each,
                own.slow_each,
                full.slow_uncertainty,
                full.certificate.pieces,
            )
        )
    return rows, absent


def forms(family: str) -> list[Form]:
    """The averaged forms for a family of shapes: its own of first order, and all others."""
    averaged = [form for form in map(find_form, FORMS) if form.averaged]
    return [form for form in averaged if not first_order(form.name) or form.name == FIRST_ORDER[family]]


def measure_all(*, quick: bool = False, quiet: bool = False, workers: int | None = None) -> Outcome:
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
    absent: list[Absent] = []
    with ProcessPoolExecutor(workers or os.cpu_count(), mp_context=get_context("spawn")) as pool:
        outcomes = pool.map(measure, *zip(*tasks, strict=True))
        for found, missing in tqdm(
            outcomes, total=len(tasks), disable=quiet, unit="reference", desc="accuracy", leave=False
        ):
            rows += found
            absent += missing
    order = {subject.name: i for i, subject in enumerate(cases)}

    def place(row: Measured | Absent) -> tuple[int, str, float]:
        return order[row.subject], row.form, row.stokes

    return sorted(rows, key=place), sorted(absent, key=place)
