"""Errors of the averaged forms in the paper's cases, as St grows, against certified references."""

import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import cast

from polhode.harness.averaging.cases import FIRST_LOOK_STOKES, Subject, paper_cases
from polhode.harness.averaging.data import Absent, AveragingErrors, Each, PaperStudy
from polhode.harness.common.machine import here
from polhode.harness.common.progress import Steps
from polhode.harness.references.errors import errors
from polhode.harness.references.reference import ReferenceFailedError, reference
from polhode.models.catalogue import averaged_form, form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.second_order.form import SecondOrder
from polhode.solvers.catalogue import available_like
from polhode.solvers.solve import solve

FORM_SAMPLES = 501  # Output times of a run.
# Solver and tolerance that a user would take for an averaged form; they make the solver error.
FORM_SOLVER = "taylor"
FORM_TOLERANCE = 1e-9


def measure(subject: Subject, stokes: float) -> tuple[list[AveragingErrors], list[Absent]]:
    """Errors of first and second order in a case at one St, as far as each form follows it.

    A form that refuses the case, or whose own exact solution is not certified, is absent with its
    reason. Raises ReferenceFailedError if there is no certified reference of the full solution.
    """
    whole = subject.scene(stokes)
    rows = list[AveragingErrors]()
    absent = list[Absent]()
    for name in (averaged_form(whole), SecondOrder.name):
        form = find_form(name)
        head = (subject.name, subject.family, name)
        try:
            until = form.reach(whole)
        except FormNotValidError as refusal:
            absent.append(Absent(*head, stokes, f"refused: {refusal.condition}"))
            continue
        scene = replace(whole, time=until * stokes)
        full = reference(scene, "quaternion", FORM_SAMPLES)
        try:
            exact = reference(scene, form, FORM_SAMPLES)
        except ReferenceFailedError as failure:
            absent.append(
                Absent(*head, stokes, f"its own exact solution is not certified: {failure}")
            )
            continue
        solution = solve(
            form.problem(scene), available_like(FORM_SOLVER), FORM_TOLERANCE, exact.times
        )
        if not solution.success:
            raise ReferenceFailedError(
                f"{subject.name}, St = {stokes:g}: {name} ended with {solution.status}"
            )
        model = errors(scene.ellipsoid, exact.observables, full.observables).slow_each
        solver_error = errors(
            scene.ellipsoid, form.observe(scene, solution.states), exact.observables
        ).slow_each
        about = full.slow_uncertainty, full.certificate.segments
        both_errors = cast("Each", model), cast("Each", solver_error)
        rows.append(AveragingErrors(*head, subject.semi_axes, stokes, until, *both_errors, *about))
    return rows, absent


def measure_all(*, quick: bool = False, quiet: bool = False) -> PaperStudy:
    """Measure all cases over all St, the longest runs first, on as many processes as there are cores."""
    cases = paper_cases()
    tasks = []
    for case in cases:
        tasks += [
            (case, stokes) for stokes in case.stokes if stokes <= FIRST_LOOK_STOKES or not quick
        ]
    tasks.sort(key=lambda task: -task[1])
    rows = list[AveragingErrors]()
    absent = list[Absent]()
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        results = pool.map(measure, *zip(*tasks, strict=True))
        shown = Steps("accuracy", len(tasks), "references", quiet)
        for measured, missing in shown.over(results):
            rows += measured
            absent += missing
    order = [case.name for case in cases]

    def place(row: AveragingErrors | Absent) -> tuple[int, str, float]:
        return order.index(row.subject), row.form, row.stokes

    return PaperStudy(sorted(rows, key=place), sorted(absent, key=place), {"errors": here()})
