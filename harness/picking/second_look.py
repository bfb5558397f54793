"""The error of a run that has just ended, from a second look at it that costs less.

A short run is looked at by a tighter one: their difference is the error. A long one by what fits
into `SHARE` of its time: another method that is cheaper at a tighter tolerance, a tighter run over
the beginning, or a looser one, whose error is larger by the ratio of the tolerances, more or less.
Averaged forms add the error of averaging, from pilots.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import inf, pi
from time import perf_counter
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.interval import Interval
from polhode.harness.common.text import percent
from polhode.harness.picking.laws import EPS
from polhode.harness.picking.model_error import model_errors, own_estimate
from polhode.harness.picking.pilot import SATURATED, PilotFailedError, pilot
from polhode.harness.picking.refusals import UnfitError
from polhode.harness.picking.stated_error import STATED_OVER, TIGHTEST, RunError, said_by_pieces
from polhode.harness.references.errors import (
    body_angular_velocity,
    magnitude,
    orientation_difference,
)
from polhode.harness.references.rotations import damping_times, is_stiff
from polhode.models.catalogue import form as find_form, full_form, reference_form
from polhode.models.flow import torque
from polhode.models.form import Form, FormNotValidError
from polhode.models.observables import Observables, completed
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.models.spent import SPENT
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import UNLIMITED, Solver
from polhode.solvers.solve import Solution, solve

Estimates = dict[str, Interval | None]
# Of two runs the largest differences, slow and of the orientation, and what the phase makes of the
# former.
Apart = tuple[float, float | None, float]
# A look takes no longer than this, in seconds, or than this share of the run.
LEAST, SHARE = 5e-3, 0.6
# Tolerances of a look over the run's; what a tighter run of a method of low and of high order costs
# at most, in runs.
TIGHTER, TENTH, LOOSER, DEARER, DEARER_HIGH = 1e-2, 0.1, 1e2, 2.5, 1.8
# Steps a rotation that methods take at a tolerance, about, their order, and seconds of a step.
# Splitting is cheap up to so many damping times in a rotation, and so tight a tolerance; Taylor's
# method errs by less than its tolerance.
VERNER, SPLITTING = (10.0, 1e-9, 8, 4e-7), (3.0, 1e-6, 6, 1e-7)
WEAK, SPLIT_TIGHTEST, TIGHTER_THAN_TAYLOR = 0.1, 1e-12, 1e-4
# Seconds of a step of compiled solvers, implicit and switching ones; shares of the limit that a
# look is planned to take, and after which it is stopped, so that time is left for what compares.
IMPLICIT_STEP, SWITCHING_STEP, PLANNED, STOPPED = 3e-6, 8e-7, 0.8, 0.9
# The loosest tolerance of a look; no method's errors follow its steps more closely than by this
# power. Below the last tolerance Radau takes too many steps to look, and LSODA errs by more;
# explicit methods look no looser than at it.
LOOSEST, ORDER, LOW_ORDER = 1e-2, 8, 1e-6
# Upper ends over the middle: of a tighter look, of a looser one, and of a looser one by an implicit
# method, whose errors follow its tolerance less closely; of a tighter look at the beginning of a
# run.
CERTAIN, SCALED, LOOSELY, BEGUN = 1.5, 6.0, 20.0, 5.0
# Output times that a look compares, at most, and of forms whose states cost more to observe than to
# follow.
MOST_TIMES, FEW_TIMES = 501, 51
# Rounding along a run, in eps of what is measured, and how it grows with the rotations
# (`laws.ErrorLaw`).
ROUNDING, GROWTH = 2.0, {"slow": 0.7, "orientation": 1.7}


class Look(NamedTuple):
    """A second run: by which solver, at which tolerance, its error over that of the run, and its share of the time.

    Of one that may be `poorer` than the run their difference bounds the error from above alone.
    """

    solver: Solver
    tolerance: float
    larger: float
    certainty: float
    share: float = 1.0
    poorer: bool = False


def run_error(
    scene: Scene, form: Form, method: Solver, found: Solution, observables: Observables
) -> RunError:
    """Estimate the error of a run that has ended; an estimate that fails is none, with the reason."""
    if not found.success:
        return RunError(None, None, "the run did not reach its end")
    began, before = perf_counter(), SPENT["compilation"]
    largest = float(np.max(np.abs(observables.angular_momentum[:, 2]))) / max(
        scene.ellipsoid.inertia
    )
    try:
        with np.errstate(all="ignore"):
            if method.wears and any(each.averaged for each in found.stages):
                own, note = _stated(scene, form, found, observables)
            else:
                own, note = _solver_error(scene, form, method, found, observables)
            if form.averaged:
                model, how = own_estimate(form, scene), "as the form says itself"
                if not model:
                    model, how = model_errors(form, pilot(scene)), "by trial runs"
                note = f"{note}; averaging {how}"
                own = {
                    want: each.plus(off) if each and (off := model[want]) else None
                    for want, each in own.items()
                }
        axis = scene.ellipsoid.symmetry_axis is not None
        stated = RunError(own["slow"], own["orientation"], note, largest_lz=largest, axis=axis)
    except (UnfitError, PilotFailedError, FormNotValidError) as failure:
        stated = RunError(None, None, str(failure))
    return replace(stated, seconds=perf_counter() - began - (SPENT["compilation"] - before))


def _stated(
    scene: Scene, form: Form, found: Solution, observables: Observables
) -> tuple[Estimates, str]:
    """Errors of a run of several pieces as these state them: bounds, that most of them keep to by far."""
    own = _estimates(scene, form, observables, (0.0, 0.0, 0.0), Look(found.method, 1.0, 0.0, 1.0))
    for want, bound in said_by_pieces(found).items():
        if rounding := own[want]:
            own[want] = rounding.plus(Interval(bound / STATED_OVER, 0.0, bound))
    return own, "what its pieces state"


def _solver_error(
    scene: Scene, form: Form, method: Solver, found: Solution, observables: Observables
) -> tuple[Estimates, str]:
    if method.closed_form:
        own = _estimates(scene, form, observables, (0.0, 0.0, 0.0), Look(method, 1.0, 0.0, 1.0))
        return own, "closed form: rounding"
    limit = max(LEAST, SHARE * found.seconds)
    ends = perf_counter() + limit - SPENT["compilation"]
    averaged = any(each.averaged for each in found.stages)
    in_full = bool(found.stages) and not averaged
    if in_full:
        form, found = _in_one(scene, found)
    stride = -(
        -len(found.times) // (FEW_TIMES if averaged or hasattr(form, "estimate") else MOST_TIMES)
    )
    rows = np.append(np.arange(0, len(found.times) - 1, stride), len(found.times) - 1)
    turns = 0.0 if form.averaged else _rotations(scene, observables)
    why = "no second run came to its end in the time allowed"
    # A second run in pieces enters as many, and takes as long; where none is far tighter than full
    # pieces, these state an error of their own.
    dear = (averaged and found.seconds > limit) or (
        in_full and found.settings.tolerance * TIGHTER < TIGHTEST
    )
    for each in () if dear else _looks(scene, form, method, found, turns, PLANNED * limit):
        equations, problem = _takes(form, scene, found.problem, each)
        seen = rows[: max(2, int(each.share * len(rows)))]
        times = found.times[seen] * (problem.end / found.problem.end)
        # Counted in steps as well: what these stop is the same on a busy machine.
        known = (
            each.solver is method
            and each.larger > 1
            and SHARE * found.seconds > LEAST
            and found.work.steps
        )
        step = found.seconds / known if known and _compiled(method) else _step(each.solver)
        most = max(100, int(STOPPED * limit / step)) if step else UNLIMITED
        run = solve(
            problem, each.solver, each.tolerance, times, max_seconds=STOPPED * limit, max_steps=most
        )
        look = _believed(each, found, run) if problem is found.problem else each
        why = "second runs took the very same steps" if run.success else why
        if run.success and look.larger != 1:
            here = observables[seen]
            own = _estimates(
                scene,
                form,
                here,
                _apart(scene, look, here, equations.observe(scene, run.states)),
                look,
            )
            # Rounding alone: the look took the very same steps.
            if look.share < 1 and (slow := own["slow"]) and slow.high > 2 * BEGUN * slow.predicted:
                break
            # Pieces that both runs average differ by nothing.
            if found.stages and (look.larger > 1 or any(each.averaged for each in run.stages)):
                bounds = said_by_pieces(found)
                own = {
                    want: each and replace(each, high=max(each.high, bounds[want]))
                    for want, each in own.items()
                }
            note = f"a second run by {look.solver.name} at {look.tolerance:.0e}"
            return own, note + (f" over the first {percent(look.share)}" if look.share < 1 else "")
        if (limit := ends - perf_counter() + SPENT["compilation"]) <= 0:
            break
    if found.stages:
        return _stated(scene, form, found, observables)
    raise PilotFailedError(why)


def _looks(
    scene: Scene, form: Form, method: Solver, found: Solution, turns: float, limit: float
) -> Iterator[Look]:
    """Second runs worth trying, the most telling one first."""
    tolerance, taylor = found.settings.tolerance, method.order_by_tolerance
    damping, many = damping_times(scene), method.many_periods
    implicit = "cyrk-radau" if tolerance >= LOW_ORDER else "cyrk-lsoda"
    held = is_stiff(scene, turns)
    other = find_solver(implicit if held else "cyrk-vern8")
    affordable = 0.0 if other.implicit else _affordable(VERNER, turns, limit)
    explicit = _compiled(method) and not method.implicit
    # Of solvers over many periods their own tighter runs are far cheaper than those of any other.
    own = explicit or many or method.name == other.name
    high = (explicit or many) and not method.low_order
    usual = (found.work.steps or inf) * _step(method) if _compiled(method) else found.seconds
    short = own and usual * (DEARER_HIGH if high else DEARER) <= limit
    # Spheroids that damping hardly slows. Errors of stroboscopic averaging do not follow its
    # tolerance closely, and looser steps in long double are as many.
    splits = (
        0 < damping < WEAK * turns
        and scene.ellipsoid.symmetry_axis is not None
        and method.name != "splitting"
    )
    if splits and (many or not short) and (own or affordable > tolerance * TIGHTER):
        split = max(SPLIT_TIGHTEST, _affordable(SPLITTING, turns, limit))
        if split < tolerance * TENTH:
            other, affordable, own, short = find_solver("splitting"), split, False, False
    elif form.angles and not (held or short) and affordable < tolerance * TENTH:
        own = False
    tighter = max(TIGHTEST, tolerance * TIGHTER)
    if short and tighter < tolerance:
        yield Look(method, tighter, tighter / tolerance, CERTAIN)
    elif not own or (explicit and held and not short):
        sharper = TIGHTER_THAN_TAYLOR if taylor else TIGHTER / 10 if other.switching else TIGHTER
        sharp = max(
            TIGHTEST, affordable, min(tolerance * sharper, 1.0 if other.implicit else LOW_ORDER)
        )
        if taylor or sharp < tolerance:
            poorer = taylor and sharp > tolerance * sharper
            yield Look(other, min(LOOSEST, sharp), 0.0, CERTAIN, poorer=poorer)
    # Of a high order even a hundredfold tolerance hardly saves half of the steps.
    saves = explicit and high and SHARE * min(usual, found.seconds) > LEAST
    looser = min(LOOSEST, tolerance * ((SHARE * PLANNED) ** -VERNER[2] if saves else LOOSER))
    few = method.name == "splitting" or (
        saves and looser / tolerance < (SHARE * STOPPED) ** -VERNER[2]
    )
    if few and not short and tighter < tolerance:
        tighter = min(tolerance * TENTH, LOW_ORDER if many else 1.0)
        yield Look(method, tighter, TENTH, BEGUN, limit / (usual * DEARER_HIGH))
    elif looser > tolerance and not taylor:
        yield Look(
            method, looser, looser / tolerance, LOOSELY if method.implicit or many else SCALED
        )


def _affordable(pace: tuple[float, float, int, float], turns: float, limit: float) -> float:
    """Tightest tolerance at which so many rotations are done in so many seconds."""
    per_rotation, tolerance, order, step = pace
    return tolerance * (per_rotation * turns * step / limit) ** order


def _step(method: Solver) -> float:
    """Seconds of a step, about; 0 where they differ widely."""
    if not _compiled(method):
        return SPLITTING[-1] if method.name == "splitting" else 0.0
    return SWITCHING_STEP if method.switching else IMPLICIT_STEP if method.implicit else VERNER[-1]


def _compiled(method: Solver) -> bool:
    """Whether a step takes about `_step`: one by Taylor's method and one of a plan over many periods do not."""
    return method.backends == ("compiled",) and not (
        method.many_periods or method.order_by_tolerance
    )


def _in_one(scene: Scene, found: Solution) -> tuple[Form, Solution]:
    """A run in pieces that took no averaged one, as one of the full equations at the loosest tolerance of these."""
    form = find_form(reference_form(scene))
    problem = form.problem(scene)
    settings = replace(found.settings, tolerance=max(each.tolerance for each in found.stages))
    times = found.times * (problem.end / found.problem.end)
    return form, replace(found, problem=problem, settings=settings, times=times)


def _believed(look: Look, found: Solution, run: Solution) -> Look:
    """The look, whose error differs from the run's as far as their steps allow; `larger` is 1 if they are the same."""
    steps, others, inner = found.work.steps, run.work.steps, found.work.inner
    if not (look.larger and steps and others) or look.share < 1 or (inner and inner > steps):
        return look
    least, most = sorted((1.0, look.larger))
    return look._replace(larger=min(most, max(least, (steps / others) ** ORDER)))


def _takes(form: Form, scene: Scene, problem: Problem, look: Look) -> tuple[Form, Problem]:
    """The run's own problem, or that of a form that gives the same, where the look's solver does not take it."""
    # Equations of angles are dearer.
    if not (form.angles and look.larger < 1) and look.solver.takes(problem):
        return form, problem
    form = find_form(full_form(scene))
    return form, form.problem(scene)


def _apart(scene: Scene, look: Look, here: Observables, there: Observables) -> Apart:
    slow = float(np.max(np.abs(here.slow - there.slow))) / max(scene.ellipsoid.inertia)
    angle = orientation_difference(scene.ellipsoid, here.rotation, there.rotation)
    lost = 0 if angle is None or look.larger <= 1 else int(np.argmax(angle > SATURATED * pi))
    if angle is None or not lost:
        return slow, None if angle is None else float(np.max(angle)), 0.0
    # The error of the run's own phase, which grows as that of the look did.
    last = len(angle) - 1
    phase = look.certainty / look.larger * angle[lost] * (last / lost) ** GROWTH["orientation"]
    swayed = min(1.0, phase) * _sway(scene, here[min(lost, last // 2) :: 1 + last // 100])
    return slow, float(np.max(angle)), min(slow, swayed)


def _sway(scene: Scene, observables: Observables) -> float:
    """Change of L and E over I_max with the phase, per rad, about: the range of their rates over the body's own."""
    rotation = completed(scene.ellipsoid, observables.rotation)
    assert rotation is not None
    spin = body_angular_velocity(scene.ellipsoid, observables, rotation)
    body = torque(scene.ellipsoid, rotation, spin)
    rates = np.column_stack([np.einsum("nij,ni->nj", rotation, body), np.sum(body * spin, axis=1)])
    speed = np.mean(np.linalg.norm(spin, axis=1))
    return float(
        np.max(np.ptp(rates, axis=0)) * scene.torque_factor / (max(scene.ellipsoid.inertia) * speed)
    )


def _estimates(
    scene: Scene, form: Form, observables: Observables, apart: Apart, look: Look
) -> Estimates:
    """Errors of the run from its distance to a look, and rounding."""
    largest = magnitude(scene.ellipsoid, observables)
    turns = 0.0 if form.averaged else _rotations(scene, observables)
    found: Estimates = dict.fromkeys(GROWTH)
    for want, near, size in zip(GROWTH, apart[:2], (largest, pi), strict=True):
        if near is None:
            continue
        # L and E sway with the phase, whose error grows faster.
        distance = near / look.share ** GROWTH["orientation"]
        rounding = ROUNDING * EPS * size * (1 + turns) ** GROWTH[want]
        # Of a looser look that lost the motion nothing follows but that the run may have lost it
        # too.
        lost = look.larger > 1 and distance > SATURATED * size
        middle = distance if lost else distance / abs(1 - look.larger)
        certainty = 2.0 if lost else look.certainty
        # No two orientations are further apart than π.
        most = pi if want == "orientation" else inf
        low = 0.0 if lost or look.poorer else middle / certainty
        found[want] = Interval(middle, low, min(most, certainty * middle + rounding))
    # Where a looser look lost the orientation, L and E sway with that of the run, which it may have
    # lost as well.
    if slow := found["slow"]:
        found["slow"] = replace(slow, high=max(slow.high, apart[2]))
    return found


def _rotations(scene: Scene, observables: Observables) -> float:
    """N = ∫|ω|dt/2π, about, from the output alone: |ω| is 2E/|L| and somewhat more."""
    size = np.linalg.norm(observables.angular_momentum, axis=1)
    speed = np.divide(2 * observables.energy, size, out=np.zeros_like(size), where=size > 0)
    return float(np.mean(speed)) * scene.time / (2 * pi) if np.all(speed < inf) else 0.0
