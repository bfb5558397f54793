"""Size of a run, in solver steps: rotations, flow and damping times, by the steps that they cost.

Near a pole angles take many steps, a body that has settled takes few, and a solver that switches to
an implicit method takes fewer than one that cannot. Pilot runs of the form itself count them, by a
solver of each kind.
"""

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from math import exp, log, sqrt

import numpy as np

from polhode.harness.picking.laws import Load
from polhode.harness.picking.pilot import InPieces, Pilot, PilotFailedError, averages, follow
from polhode.harness.references.rotations import (
    EXPLICIT,
    HELD,
    Gauge,
    damping_times,
    following_time,
)
from polhode.models.catalogue import form as find_form, full_form
from polhode.models.form import Form
from polhode.models.problem import PlannedPiece
from polhode.models.scene import Scene
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.solve import solve

# The averaged form that has one set of equations for spheroids and another, far dearer one, for
# triaxial ellipsoids.
SECOND_ORDER = "averaged-second-order"
# Most steps that stability costs, over the usual ones.
MOST_STABILITY = 2.0
IMPLICIT = Gauge("cyrk-radau", 1e-6, 27.0, 2.6, 0.0, 13.0)
BOTH = Gauge("cyrk-lsoda", 1e-9, 36.0, 21.0, 7e-4, 8.5)
# Accuracy asks explicit methods for ever more steps as the tolerance falls, stability does not:
# runs so much looser and tighter than the gauge's tolerance separate the two, at the gauge's order.
LOOSER, TIGHTER, ORDER = 1e4, 1e-2, 8
# A solver that plans its steps over many periods shows its plans, which it makes at these shares of
# a run or near them, by so many steps, at times from this share of the run on.
PLANS, PLANNED, BEGINNING, ROWS = (0.0, 0.1, 0.4, 0.7, 1.0), 5000, 1e-6, 200


def gauge_of(solver: str) -> Gauge:
    """The gauge of a solver's kind."""
    method = find_solver(solver)
    return BOTH if method.switching else IMPLICIT if method.implicit else EXPLICIT


def load_of(form: Form, solver: str, pilot: Pilot, samples: int, tolerance: float) -> Load:
    """Load of a run of a form by a solver; raises PilotFailedError if the form's own pilot fails."""
    # Rotations, the flow's own time and damping times count by the steps that they cost, as against
    # the usual. Averaged forms know nothing of rotations, and count by their steps, as do solvers
    # that plan theirs over many periods.
    scene, damped, gauge = pilot.scene, pilot.damping_times, gauge_of(solver)
    if find_solver(solver).many_periods:
        # Steps within steps stand in the place of F.
        count, inner = _planned(form, pilot, solver, tolerance).tolist()
        return Load(count, inner, 0.0, samples)
    if isinstance(form, InPieces):
        return _in_pieces(form, solver, pilot, samples, tolerance)
    if form.averaged:
        held = damped if gauge is EXPLICIT else 0.0
        count = sum(steps(form, scene, gauge)) / gauge.per_rotation
        return Load(
            *_by_kind(count, form.name == SECOND_ORDER and scene.ellipsoid.kind == "triaxial"),
            held,
            samples,
        )
    turns = pilot.rotations
    following = following_time(scene)
    closed = form.problem(pilot.followed).parameters is None
    if closed or (gauge is EXPLICIT and pilot.stiff):
        return Load(turns, following, damped, samples)
    counted = pilot.followed if gauge is EXPLICIT else pilot.counted
    accuracy, stability = steps(form, counted, gauge)
    share = accuracy * scene.time / counted.time / gauge.usual(turns, following)
    damping = gauge.per_damping_time * damping_times(pilot.followed)
    held = stability / damping if gauge is EXPLICIT and damping > 0 else share
    return Load(share * turns, share * following, held * damped, samples)


def _in_pieces(form: InPieces, solver: str, pilot: Pilot, samples: int, tolerance: float) -> Load:
    """Load of a form of several pieces, as it plans them for this very scene."""
    scene = pilot.scene
    pieces, averaged, logarithm, turned, followed = 0, 0.0, 0.0, 0.0, 0.0
    for each in planned(form, pilot, tolerance):
        length = (each.end - each.begin) / scene.time
        if each.tolerance is None:
            pieces, averaged = pieces + 1, averaged + length
        else:
            angle = pilot.share_of(each)
            # The windows' tolerance is the mean of their own ones, in logarithms, by the angles
            # turned in them.
            turned, followed, logarithm = (
                turned + angle,
                followed + length,
                logarithm + angle * log(each.tolerance),
            )
    own, triaxial = (
        exp(logarithm / turned) if turned else tolerance,
        scene.ellipsoid.kind == "triaxial",
    )
    full, gauge = (
        load_of(find_form(full_form(scene)), solver, pilot, samples, own),
        gauge_of(solver),
    )
    count = (
        turned * full.rotations + followed * full.following * gauge.per_time / gauge.per_rotation
    )
    seen = (pieces, averaged * samples) if triaxial else (0, 0.0)
    return Load(
        *_by_kind(count, triaxial), followed * full.damping_times, samples, pieces, *seen, own
    )


def _by_kind(count: float, triaxial: bool) -> tuple[float, float]:
    """Steps in the place of N or, of a triaxial ellipsoid, of F: a form that takes both has two sets of equations."""
    return (0.0, count) if triaxial else (count, 0.0)


def held_back(form: Form, solver: str, pilot: Pilot) -> bool:
    """Whether stability sets so many of a solver's steps that its error does not follow its tolerance."""
    method = find_solver(solver)
    if method.implicit or method.closed_form:
        return False
    if pilot.stiff:
        return True
    free = method.order_by_tolerance or method.many_periods or averages(form)
    if free or form.problem(pilot.followed).parameters is None:
        return False
    accuracy, stability = steps(form, pilot.followed, EXPLICIT)
    return stability > HELD * (accuracy + stability)


@lru_cache(maxsize=256)
def planned(form: InPieces, pilot: Pilot, tolerance: float) -> tuple[PlannedPiece, ...]:
    """Pieces that a form plans for a scene, the way that the pilot has gone."""
    return form.plan(pilot.scene, tolerance, pilot.start_at)


@lru_cache(maxsize=256)
def steps(form: Form, scene: Scene, gauge: Gauge) -> tuple[float, float]:
    """Steps of a form's pilot run: those that accuracy asks for, and those that stability does."""

    def count(tolerance: float) -> float:
        return float(follow(form, scene, tolerance, gauge.solver).work.steps or 0)

    if gauge is not EXPLICIT:
        return count(gauge.tolerance), 0.0
    loose, tight = count(gauge.tolerance * LOOSER), count(gauge.tolerance * TIGHTER)
    few, many = LOOSER ** (-1 / ORDER), TIGHTER ** (-1 / ORDER)
    asked = max(0.0, (tight - loose) / (many - few))
    most = 0.0 if form.averaged else MOST_STABILITY * gauge.per_damping_time * damping_times(scene)
    stability = min(max(0.0, loose - asked * few), most)
    return sqrt((loose - stability) * (tight - stability) / (few * many)), stability


def _planned(form: Form, pilot: Pilot, solver: str, tolerance: float) -> np.ndarray:
    """Steps by a solver that plans them over many periods, those of its checks included, and those within its steps."""
    scene, count, per_turn = pilot.scene, np.zeros(2), np.zeros(2)
    # Where it plans anew its first ones are counted: between them they grow like the angle turned.
    for share, until in pairwise(PLANS):
        start = pilot.start_at(share * scene.time) if share else scene.start
        if start:
            rest = replace(scene, start=start, time=(1 - share) * scene.time)
            taken, checks, reached = _beginning(form, rest, solver, tolerance)
            count[0] += checks
            if not share and reached == 1:
                return count + taken
            per_turn = np.array(taken) / (
                pilot.turned(share + reached * (1 - share)) - pilot.turned(share)
            )
        count += per_turn * (pilot.turned(until) - pilot.turned(share))
    return count


@lru_cache(maxsize=256)
def _beginning(
    form: Form, scene: Scene, solver: str, tolerance: float
) -> tuple[tuple[int, int], int, float]:
    """Steps of a solver in the beginning of a run and those within them, checks, and what share of its time that is."""
    problem = form.problem(scene)
    times = np.append(0.0, np.geomspace(BEGINNING * problem.end, problem.end, ROWS))
    run = solve(problem, solver, tolerance, times, max_steps=PLANNED)
    if not run.work.steps or len(run.times) < 2:
        raise PilotFailedError(f"pilot: {form.name!r} by {solver!r} ended with {run.status.value}")
    return (
        (run.work.steps, run.work.inner or 0),
        run.work.rejected or 0,
        float(run.times[-1] / problem.end),
    )
