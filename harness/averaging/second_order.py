"""Errors and cost of `averaged-second-order` against the full equations in long double, beyond the paper's cases.

`polhode accuracy --order 2` runs it, `reports/second-order` shows it, `docs/second-order.md` has the
mathematics. A "passage" is a run through resonances of polhode and precession, whose modes are pairs
(k₁, k₂); a "kick" is the jump of L that the form leaves out there.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import nan
from operator import attrgetter
from time import perf_counter
from typing import Any

import numpy as np

from polhode.harness.averaging.cases import AWAY, CROSSING, RESONANT, Subject
from polhode.harness.averaging.data import Cost, Passage, SecondOrderErrors, SecondOrderStudy
from polhode.harness.common.machine import here
from polhode.harness.common.progress import in_steps
from polhode.harness.references.errors import Errors, errors
from polhode.harness.references.extended import reference_runs
from polhode.models.catalogue import averaged_form, form as find_form, full_form
from polhode.models.form import FormNotValidError
from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.models.scenes import PROLATE, SPHEROID_START
from polhode.models.second_order.form import SecondOrder
from polhode.models.second_order.outline import outline
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import available_like, solver as find_solver
from polhode.solvers.solve import solve

# Output times of a run, of which the largest error counts. An estimate: fewer may miss it between two times.
SECOND_ORDER_SAMPLES = 2001
# Tolerances of the reference in long double, and of the looser run that shows its error: 1e-18 is
# near the last digit of long double. A hundredfold is an estimate, as in `reference.LONG_DOUBLE`: the two runs
# then differ by the looser one's error, which is larger than the tighter one's.
REFERENCE_TOLERANCES = (1e-18, 1e-16)
# Tolerance of averaged forms: the solver's error is then rounding, far below the form's own.
SECOND_ORDER_TOLERANCE = 1e-14
# Solver of averaged forms, but for passages, and of the full form as the reference of `costs`.
USUAL_SOLVER = "taylor"
# Solver of passages: within the width of a resonance the field's coefficients rise and fall (`field.regular`),
# which asks every solver for small steps. Steps of Taylor's method cost the most, for its series are of high
# order, and pay where they are long. A choice; which solver is faster there was not measured.
PASSAGE_SOLVER = "cyrk-vern8"
# Runs of a passage, of which the fastest counts. An estimate: more take longer and are disturbed less.
PASSAGE_REPEATS = 3
# Kicks below this share of the estimated error of L and E are not named. An estimate, by which tables name the
# few modes that matter.
_NAMED_KICK = 0.1
# With `quick`: cases of each kind, and St of each case. `orders` fits slopes, and takes one St more.
_QUICK_CASES = 1
_QUICK_POINTS = 2
# Parts of the study that may be measured alone.
SECOND_ORDER_PARTS = ("orders", "resonances", "cost")

# The cost of a spheroid's run against St. The question is an example, chosen once: its duration in slow time;
# the few output times; the St at which first order and the full equations are run too; the error of L and
# E over I_max that the full equations have to meet there.
COST_SLOW_TIME = 0.5
COST_SAMPLES = 11
COMPARED = 1e6
TARGET = 1e-6
# Powers of ten of St at which the second-order form is timed, `COMPARED` among them. A choice: the cost
# hardly depends on St, and six decades show it.
_EXPONENTS = tuple(range(3, 9))
# Tolerance of averaged forms, far below `TARGET`.
_COST_TOLERANCE = 1e-9
# Tolerance of the reference of these runs by Taylor's method in double precision: it is below an ulp.
_REFERENCE_TOLERANCE = 1e-16
# Tolerances of the full equations, of which the loosest that meets `TARGET` counts. A choice: from a hundredth
# of `TARGET` on, since errors grow along a run. A solver that meets it at none of them has no row.
FULL_TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
# Solvers of the full equations that compete with averaging. A choice: Taylor's method and two explicit
# Runge–Kutta methods of order 8.
_FULL_SOLVERS = ("taylor", "cyrk-vern8", "cyrk-dop853")
# Runs at different St take turns, so that slow moments of the machine meet all. Many runs of averaged
# forms are cheap; the full form takes far longer. Both numbers are estimates. `timed.json` holds the first
# alone; the page takes the second from here.
COST_REPEATS = 50  # Runs of averaged forms at each St, of which the fastest counts.
FULL_REPEATS = 3  # Runs of the full form, of which the fastest counts.
# Key by which the fastest of `TimedRun`s is found.
_SECONDS = attrgetter("seconds")


@dataclass(frozen=True)
class TimedRun:
    """Observables of a run, and its wall times in s: the integration, and with the observables."""

    observables: Observables
    integration: float
    seconds: float


def timed_run(
    scene: Scene, name: str, tolerance: float, samples: int, solver: str = USUAL_SOLVER
) -> TimedRun:
    """Run a form at `samples` equispaced times; raises RuntimeError if it does not reach its end.

    A solver of the same kind runs it if the solver's library is missing.
    """
    form = find_form(name)
    problem = form.problem(scene)
    solution = solve(
        problem, available_like(solver), tolerance, np.linspace(0.0, problem.end, samples)
    )
    if not solution.success:
        raise RuntimeError(f"form {name!r} ended with {solution.status}: {solution.message}")
    began = perf_counter()
    observables = form.observe(scene, solution.states)
    return TimedRun(observables, solution.seconds, solution.seconds + perf_counter() - began)


def reference_observables(
    scene: Scene, samples: int = SECOND_ORDER_SAMPLES
) -> tuple[Observables, Errors]:
    """Observables of the full form in long double, and what a hundredfold tolerance changes in them."""
    form = find_form(full_form(scene))
    problem = form.problem(scene)
    times = np.linspace(0.0, problem.end, samples)
    tight_tolerance, loose_tolerance = REFERENCE_TOLERANCES
    runs = reference_runs(
        problem, times, (("long double", tight_tolerance), ("long double", loose_tolerance))
    )
    tight, loose = (form.observe(scene, states) for states in runs)
    return tight, errors(scene.ellipsoid, loose, tight)


def _compared(case: Subject, scene: Scene, run: TimedRun) -> tuple[dict[str, Any], Errors]:
    """Cells of a run's row, for both kinds of tables, and the reference's uncertainty.

    The cells are the run's errors, the error of first order, and what the form states ahead of the run.
    """
    reference, uncertainty = reference_observables(scene)
    first = timed_run(
        scene, averaged_form(scene), SECOND_ORDER_TOLERANCE, SECOND_ORDER_SAMPLES
    ).observables
    error = errors(scene.ellipsoid, run.observables, reference)
    estimate = SecondOrder().estimate(scene)
    row = {
        "shape": case.axes,
        "start": case.name,
        "slow_time": case.slow_time,
        "stokes": scene.stokes,
        "slow": error.slow,
        "first_order_slow": errors(scene.ellipsoid, first, reference).slow,
        "orientation": _known(error.orientation),
        "estimated_orientation": estimate.orientation,
        "estimated_slow": estimate.slow,
    }
    return row, uncertainty


def measure_away(case: Subject, stokes: float) -> SecondOrderErrors:
    """Errors of first and second order, and the form's own estimate."""
    scene = case.scene(stokes)
    row, uncertainty = _compared(
        case,
        scene,
        timed_run(scene, SecondOrder.name, SECOND_ORDER_TOLERANCE, SECOND_ORDER_SAMPLES),
    )
    return SecondOrderErrors(
        **row,
        slow_uncertainty=uncertainty.slow,
        orientation_uncertainty=_known(uncertainty.orientation),
    )


def measure_passage(case: Subject, stokes: float, whole: bool = True) -> Passage:
    """The row of a run through resonances; without `whole`, of as much of it as the form follows.

    The row of a run that the form refuses, or that fails, has the reason alone.
    """
    scene = case.scene(stokes)
    form = SecondOrder()
    try:
        if not whole:
            case = replace(case, slow_time=form.reach(scene))
            scene = case.scene(stokes)
        run_once = partial(
            timed_run,
            scene,
            form.name,
            SECOND_ORDER_TOLERANCE,
            SECOND_ORDER_SAMPLES,
            PASSAGE_SOLVER,
        )
        fastest = min((run_once() for _ in range(PASSAGE_REPEATS)), key=_SECONDS)
    except (FormNotValidError, RuntimeError) as refusal:
        reason = refusal.condition if isinstance(refusal, FormNotValidError) else str(refusal)
        return Passage(case.axes, case.name, case.slow_time, stokes, refused=reason)
    row, _ = _compared(case, scene, fastest)
    least_kick = _NAMED_KICK * row["estimated_slow"]
    strong = [kick for kick in outline(scene).kicks if kick.size > least_kick]
    # A mode may be met several times, and is named once, where it is met first.
    distinct = dict.fromkeys(kick.mode for kick in strong)
    modes = " ".join(f"({k1:.0f}, {k2:.0f})" for k1, k2 in distinct)
    kick = max((kick.size for kick in strong), default=nan)
    return Passage(
        **row, modes=modes, kick=kick, integration=fastest.integration, seconds=fastest.seconds
    )


def costs(exponents: Sequence[int] = _EXPONENTS, compared: float = COMPARED) -> Iterator[Cost]:
    """Cost of the second-order form at each power of ten of St; of first order and the full form at one of them."""
    # The scene at the St where forms are compared is the only one that has a reference.
    compared_scene = _spheroid(compared)
    full = full_form(compared_scene)
    first = averaged_form(compared_scene)
    second = SecondOrder.name
    reference = timed_run(compared_scene, full, _REFERENCE_TOLERANCE, COST_SAMPLES).observables
    averaged_by = available_like(USUAL_SOLVER)

    def cost(scene: Scene, name: str, solver: str, tolerance: float, run: TimedRun) -> Cost:
        """The row of a run; its error is known at `compared` alone."""
        slow = nan
        if scene == compared_scene:
            slow = errors(scene.ellipsoid, run.observables, reference).slow
        return Cost(
            form=name,
            solver=solver,
            tolerance=tolerance,
            stokes=scene.stokes,
            samples=COST_SAMPLES,
            integration=run.integration,
            seconds=run.seconds,
            slow=slow,
        )

    scenes = [_spheroid(10.0**exponent) for exponent in exponents]
    run_second = partial(timed_run, name=second, tolerance=_COST_TOLERANCE, samples=COST_SAMPLES)
    # Runs in rounds over all St; then, for each St, the fastest of its runs.
    rounds = [[*map(run_second, scenes)] for _ in range(COST_REPEATS)]
    for scene, *runs in zip(scenes, *rounds, strict=True):
        yield cost(scene, second, averaged_by, _COST_TOLERANCE, min(runs, key=_SECONDS))
    run_first = partial(timed_run, compared_scene, first, _COST_TOLERANCE, COST_SAMPLES)
    fastest = min((run_first() for _ in range(COST_REPEATS)), key=_SECONDS)
    yield cost(compared_scene, first, averaged_by, _COST_TOLERANCE, fastest)
    for solver in _FULL_SOLVERS:
        if not find_solver(solver).available:
            continue
        # The loosest tolerance that meets `TARGET` counts; a solver that never meets it has no row.
        for tolerance in FULL_TOLERANCES:
            run_full = partial(timed_run, compared_scene, full, tolerance, COST_SAMPLES, solver)
            runs = [run_full()]
            if cost(compared_scene, full, solver, tolerance, runs[0]).slow <= TARGET:
                runs += [run_full() for _ in range(FULL_REPEATS - 1)]
                yield cost(compared_scene, full, solver, tolerance, min(runs, key=_SECONDS))
                break


def measure_study(
    old: SecondOrderStudy | None = None, part: str = "", *, quick: bool = False, quiet: bool = False
) -> SecondOrderStudy:
    """All that the study asks, or one of `SECOND_ORDER_PARTS` anew.

    Parameters
    ----------
    old : SecondOrderStudy, optional
        An earlier study, whose other parts are kept.
    part : str
        One of `SECOND_ORDER_PARTS`; empty for all.
    quick : bool
        Measure one case of each kind, and no cost.
    quiet : bool
        Show no progress.
    """
    study = old or SecondOrderStudy([], [], [], [], {})
    # None means all.
    cases = _QUICK_CASES if quick else None
    points = _QUICK_POINTS if quick else None
    order_points = _QUICK_POINTS + 1 if quick else None
    if part in ("", "orders"):
        orders = _rows("orders", AWAY[:cases], quiet, measure_away, order_points)
        study = replace(study, orders=orders, timed={**study.timed, "orders": here()})
    if part in ("", "resonances"):
        resonances = _rows("resonances", RESONANT[:cases], quiet, measure_passage, points)
        crossings = _rows(
            "crossings", CROSSING[:cases], quiet, partial(measure_passage, whole=False), points
        )
        timed = {**study.timed, "passages": here(repeats=PASSAGE_REPEATS)}
        study = replace(study, resonances=resonances, crossings=crossings, timed=timed)
    if part in ("", "cost") and not quick:
        cost = list(in_steps(costs(), "cost", "rows", quiet))
        study = replace(study, cost=cost, timed={**study.timed, "cost": here(repeats=COST_REPEATS)})
    return study


def _rows(
    title: str,
    cases: Sequence[Subject],
    quiet: bool,
    take: Callable[[Subject, float], Any],
    points: int | None,
) -> list[Any]:
    """Rows that `take` makes of the cases at their first `points` St, all if None."""
    tasks = []
    for case in cases:
        tasks += [(case, stokes) for stokes in case.stokes[:points]]
    return [take(*task) for task in in_steps(tasks, title, "runs", quiet)]


def _known(value: float | None) -> float:
    """The value, as tables have it: NaN in place of None."""
    return nan if value is None else value


def _spheroid(stokes: float) -> Scene:
    """The prolate spheroid on which costs are measured, at one St."""
    return Scene(Ellipsoid(PROLATE), stokes, SPHEROID_START, COST_SLOW_TIME * stokes)
