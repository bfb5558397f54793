"""Certificates of references: short segments solved again by an unrelated method in another form, and back again.

A segment starts from the reference's own observables (of averaged forms, its state). Its end is compared
with the reference there: the ratio of their difference to the other method's own error must be at most
1. A segment is then gone back over by the reference's own method.
"""

from dataclasses import dataclass, replace

import numpy as np

from polhode.harness.references.errors import errors, magnitude
from polhode.harness.references.extended import ROUNDING_RUN, ReferenceFailedError, extended_run
from polhode.models.catalogue import form as find_form
from polhode.models.form import Form, FormNotValidError
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.rotation import quaternion_from_matrix
from polhode.models.scene import BodyStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.catalogue import first_available, solver as find_solver
from polhode.solvers.solve import solve

# Segments of a run, evenly spread over it. At least `_REQUIRED` of them must be decided, none against
# the reference: the others may run into the other form's singularity. Both numbers are estimates.
_SEGMENTS = 24
_REQUIRED = 20
# Longest segment that a solver is given, in units of the inverse shear rate for full forms, in slow
# time for averaged ones: methods of low order are slow.
_LONGEST = {"cyrk-vern8": 500.0, "exact": 500.0, "ida": 20.0, "dop853": 20.0}
# Methods unrelated to Taylor's, the quicker one first.
_UNRELATED = ("cyrk-vern8", "dop853")
# Going back amplifies by exp(max(8πX/I) Δt/St): segments that go back keep the exponent below this, an
# estimate. 8πX/I is the damping rate about a body axis at St = 1 (`Ellipsoid.damping`).
_LARGEST_EXPONENT = 5.0
# The other method's own error at the tight tolerance is a sum: the tolerance, the difference of the
# loose run, ten times the effect of an ulp in the start, an ulp for each step, and rounding of the
# numbers compared. It holds for L and E too: their rounding adds up, to 2e-12 in 10,000 steps of a
# disc at St = 3e5, where √n ulps are 2e-14.
# The pairs are a tight and a loose tolerance.
_TOLERANCES = {
    "cyrk-vern8": (1e-14, 1e-13),
    "dop853": (1e-13, 1e-12),
    "ida": (1e-12, 1e-11),
    "exact": (1e-15, 1e-15),
}
# Multiple of the effect of an ulp in the start, and rounding of the numbers compared; both estimates.
_ULPS = 10.0
_ROUNDING = 1e-14
# Ways to move the numbers of a start by an ulp, up and down. Four rows of signs, orthogonal to each
# other, so that no direction of a start of four numbers escapes all of them.
_SIGNS = np.array([[1.0, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]])


@dataclass(frozen=True)
class Certificate:
    """Confirmation of a reference: the form and solver that solved its segments again."""

    form: str
    solver: str
    segments: int  # that agreed forwards, of `_SEGMENTS` tried; the others ran into the other form's singularity
    back: int  # that agreed when the reference's own method went back over them
    ratio: float  # largest difference over the method's own error; at most 1


def segments(scene: Scene, form: Form, end: float) -> list[tuple[float, float, float]]:
    """Segments evenly spread over a run to `end`, in the form's own time: start, end, and end if gone back over."""
    length = min(end / _SEGMENTS, _LONGEST[opposite(scene, form)[1]])
    damping = max(scene.ellipsoid.damping) * (
        1.0 if form.averaged else min(scene.torque_factor, 1e300)
    )
    # 0.9 keeps the exponent below its limit.
    short = length if damping * length < _LARGEST_EXPONENT else 0.9 * _LARGEST_EXPONENT / damping
    starts = np.arange(_SEGMENTS) * (end / _SEGMENTS)
    return [(start, start + length, start + short) for start in starts.tolist()]


def certify(
    scene: Scene, form: Form, problem: Problem, states: dict[float, np.ndarray]
) -> Certificate:
    """Try a reference's states, shape (d,), at the times of `segments` of its run; `problem` is what it solves.

    Raises ReferenceFailedError if a segment disagrees by more than the other method's own error, or
    too few can be tried.
    """
    opposite_form, solver = opposite(scene, form)
    observables = {time: observe(form, scene, state[None]) for time, state in states.items()}
    agreed = 0
    back = 0
    worst = 0.0
    for start, stop, turn in segments(scene, form, problem.end):
        if form.averaged:
            ratio = _same_form(scene, form, solver, states[start], observables[stop], stop - start)
        else:
            later = scene.later(start, scene.start, stop - start)
            ratio = _other_form(
                later, (opposite_form, solver), observables[start], observables[stop], stop - start
            )
        if ratio is not None:
            agreed += 1
            worst = np.maximum(worst, ratio)
        if scene.stokes > 0:
            worst = np.maximum(worst, _backward(scene, form, problem, states, (start, turn)))
            back += 1
        if not worst <= 1:  # No number where a run ended beyond all numbers.
            raise ReferenceFailedError(
                f"the reference of form {form.name!r} at St = {scene.stokes:g} differs from form "
                f"{opposite_form!r} by {solver} on the segment from {start:g} to {stop:g}: "
                f"{worst:.1f} times the method's error"
            )
    if agreed < _REQUIRED:
        raise ReferenceFailedError(
            f"only {agreed} of {_SEGMENTS} segments could be tried, expected at least {_REQUIRED}"
        )
    return Certificate(opposite_form, solver, agreed, back, worst)


def observe(form: Form, scene: Scene, states: np.ndarray) -> Observables:
    """Observables of states in long double; averaged forms, whose images need special functions, in double."""
    return form.observe(scene, states.astype(float) if form.averaged else states)


def opposite(scene: Scene, form: Form) -> tuple[str, str]:
    """Another form and an unrelated method; averaged forms have no second form of their own."""
    if form.averaged:
        return form.name, first_available(*_UNRELATED)
    spheroidal = scene.ellipsoid.kind in ("prolate", "oblate")
    if scene.stokes == 0:
        if scene.flow is None and scene.ellipsoid.kind != "triaxial":
            return "jeffery", "exact"
        if find_solver("ida").available:
            return "euler-angles", "ida"
        # No other solver takes Euler angles at St = 0.
        return "jeffery", first_available(*_UNRELATED)
    return "spheroid-axis" if spheroidal else "euler-angles", first_available(*_UNRELATED)


def restart(scene: Scene, observables: Observables, ulps: np.ndarray) -> BodyStart:
    """Start from observables at one time; `ulps`, shape (4,), moves quaternion and L, in ulps.

    The four move the quaternion's components, by half an ulp of 1 each; the last three move L_x to L_z.
    """
    rotation = observables.rotation[0].astype(float)
    ulp = np.finfo(float).eps * ulps
    momentum = observables.angular_momentum[0].astype(float) * (1 + ulp[1:])
    w1, w2, w3 = (rotation @ momentum / np.array(scene.ellipsoid.inertia)).tolist()
    q0, q1, q2, q3 = (quaternion_from_matrix(rotation) + 0.5 * ulp).tolist()
    return BodyStart((q0, q1, q2, q3), (w1, w2, w3))


def _other_form(
    scene: Scene,
    by: tuple[str, str],
    before: Observables,
    after: Observables,
    length: float,
) -> float | None:
    """Ratio of difference to own error of a segment solved again; None where it cannot be solved."""
    # Euler angles are taken about the three body axes in turn, from the one farthest from their pole on:
    # the pole is where an axis lies along z, so `rotation[0, :, 2]`, the axes' z-components, tells.
    form = find_form(by[0])
    axes = (
        [2]
        if by[0] != "euler-angles"
        else np.argsort(np.abs(before.rotation[0, :, 2].astype(float))).tolist()
    )
    ratios: list[float] = []
    for axis in axes:
        x, y, z = np.roll(scene.ellipsoid.semi_axes, -1 - axis).tolist()
        body = Ellipsoid((x, y, z))
        turned = replace(scene, ellipsoid=body, time=length)
        starts = (restart(turned, _turned(before, axis), ulps) for ulps in (np.zeros(4), *_SIGNS))
        try:
            problems = [form.problem(replace(turned, start=start)) for start in starts]
        except FormNotValidError:
            continue
        if (ratio := _tried(turned, form, by[1], problems, _turned(after, axis))) is not None:
            ratios.append(ratio)
            if ratio <= 1:
                break
    return min(ratios, default=None)


def _same_form(
    scene: Scene, form: Form, solver: str, before: np.ndarray, after: Observables, length: float
) -> float | None:
    """As `_other_form`, from the very state."""
    state = before.astype(float)
    ulps = np.finfo(float).eps * np.resize(_SIGNS, (len(_SIGNS), len(state)))
    starts = (tuple((state * (1 + ulp)).tolist()) for ulp in (np.zeros(len(state)), *ulps))
    problem = replace(form.problem(scene), end=length)
    return _tried(scene, form, solver, [replace(problem, start=start) for start in starts], after)


def _tried(
    scene: Scene, form: Form, solver: str, problems: list[Problem], after: Observables
) -> float | None:
    """Ratio of solving a segment from its start, at two tolerances, and from starts moved by an ulp.

    The first of `problems` starts from the reference itself, the others from moved starts.
    """
    tight, loose = _TOLERANCES[solver]
    solutions = [
        solve(problems[0], solver, loose),
        *(solve(problem, solver, tight) for problem in problems),
    ]
    if not all(solution.success for solution in solutions):
        return None
    accumulated = tight + np.finfo(float).eps * (solutions[1].work.steps or 0)
    return _compare(
        scene.ellipsoid,
        [form.observe(scene, solution.states[-1:]) for solution in solutions],
        after,
        accumulated,
    )


def _compare(
    ellipsoid: Ellipsoid, runs: list[Observables], reference: Observables, tolerance: float
) -> float:
    """Ratio of difference to own error, of L and E or of the orientation, whichever is larger."""
    # The second run is compared; the first is looser, and the others start elsewhere by an ulp.
    loose, tight, *moved = runs
    deviation = errors(ellipsoid, tight, reference)
    numerical_error = errors(ellipsoid, loose, tight)
    spread = [errors(ellipsoid, moved_run, tight) for moved_run in moved]
    rounding = (_ROUNDING + tolerance) * max(1.0, magnitude(ellipsoid, reference))
    slow = numerical_error.slow + _ULPS * max(shift.slow for shift in spread) + rounding
    angle = (
        (numerical_error.orientation or 0.0)
        + _ULPS * max(shift.orientation or 0.0 for shift in spread)
        + rounding
    )
    return max(deviation.slow / slow, (deviation.orientation or 0.0) / angle)


def _backward(
    scene: Scene,
    form: Form,
    problem: Problem,
    states: dict[float, np.ndarray],
    segment: tuple[float, float],
) -> float:
    """Ratio of the difference after going back over a segment to what an ulp at its end makes of it."""
    start, end = segment
    ulp = np.abs(states[end].astype(float)) * np.finfo(float).eps
    returned, moved = (
        extended_run(replace(problem, start=tuple(state)), np.array([end, start]), *ROUNDING_RUN)[
            -1
        ]
        for state in (states[end], states[end] + ulp)
    )
    reference, returned_observables, moved_observables = (
        observe(form, scene, state[None]) for state in (states[start], returned, moved)
    )
    return _compare(
        scene.ellipsoid,
        [returned_observables, returned_observables, moved_observables],
        reference,
        0.0,
    )


def _turned(observables: Observables, axis: int) -> Observables:
    """The same with the body axes renamed cyclically, so that `axis` is the third one."""
    return replace(observables, rotation=np.roll(observables.rotation, -1 - axis, axis=1))
