"""Certificates of references: short segments solved again, forwards and backwards.

Forwards, an unrelated method solves a segment in another form. It starts from the reference's own
observables, or from its state where the form is averaged. Its end is compared with the reference
there. The "ratio" is the difference of the two over the other method's own error. It must be at most
1. Backwards, the reference's own method returns over the segment, and its ratio must be at
most 1 too.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

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

# Segments of a run, evenly spread over it. An estimate: a certificate takes a time in proportion to it.
_SEGMENTS = 24
# Segments that must agree with the reference. None may disagree: the others may run into the other form's
# singularity. An estimate: a larger number would refuse references that pass singularities often.
_REQUIRED = 20
# Longest segment that a solver is given, in the form's own time: the inverse shear rate for full forms, slow
# time for averaged ones. The slower solvers have shorter ones. Estimates: the cost grows in proportion.
_LONGEST = {"cyrk-vern8": 500.0, "exact": 500.0, "ida": 20.0, "dop853": 20.0}
# Methods unrelated to Taylor's, the quicker one first.
_UNRELATED = ("cyrk-vern8", "dop853")
# Going back amplifies by exp(max(8πX/I) Δt/St). Segments that go back keep the exponent below this, an
# estimate: a smaller one leaves shorter segments to check. 8πX/I is the damping rate about a body axis at
# St = 1 (`Ellipsoid.damping`).
_LARGEST_EXPONENT = 5.0
# Tight and loose tolerance of the other method. They are estimates, near the smallest that each one keeps. The
# closed form of "exact" has no tolerance: its number only counts as error.
# The method's own error at the tight one is a sum: the tolerance, the difference of the loose run, ten times
# the effect of an ulp in the start, an ulp for each step, and rounding of the numbers compared. (An ulp is the
# distance of neighbouring numbers in double precision.) An ulp for each step holds for L and E too, whose
# rounding adds up: to 2e-12 in 10,000 steps of a disc at St = 3e5, where √n ulps are 2e-14.
_TOLERANCES = {
    "cyrk-vern8": (1e-14, 1e-13),
    "dop853": (1e-13, 1e-12),
    "ida": (1e-12, 1e-11),
    "exact": (1e-15, 1e-15),
}
# Multiple of the effect of an ulp in the start that counts as error: rounding of later steps is amplified too.
# An estimate. A smaller one would refuse more references, a larger one would overlook larger errors.
_ULPS = 10.0
# Rounding of the numbers compared, over max(1, their size). An estimate of some fifty ulps.
_ROUNDING = 1e-14
# Share of `_LARGEST_EXPONENT` that a shortened segment has: rounding does not take it beyond the limit. Any
# number just below 1 would do.
_SHORTENED = 0.9
# Largest 1/St that counts, so that products with it stay finite at St = 0.
_LARGEST_RATE = 1e300
# The body axis z', about which ψ of the Euler angles turns. Axes are renamed for these alone, so that each
# axis can take the place of z'.
_THIRD_AXIS = 2
# Four ways to move the numbers of a start by an ulp, up and down. The rows are orthogonal: no direction of a
# start of four numbers escapes all of them. A longer start repeats a row's signs.
_SIGNS = np.array([[1.0, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]])


@dataclass(frozen=True)
class Certificate:
    """Confirmation of a reference: the form and solver that solved its segments again.

    A reference that two methods in double precision make has its whole run as one segment, and ratio 1.
    """

    form: str
    solver: str
    # Segments that agreed forwards, of `_SEGMENTS` tried; the others ran into the other form's singularity.
    segments: int
    back: int  # Segments that agreed when the reference's own method went back over them.
    ratio: float  # Largest difference over the method's own error; at most 1.


class Segment(NamedTuple):
    """Times of a segment, in the form's own time."""

    start: float
    stop: float
    turn: float  # Where the reference's own method turns back to the start.


def segments(scene: Scene, form: Form, end: float) -> list[Segment]:
    """Segments evenly spread over a run from 0 to `end`, in the form's own time."""
    _, solver = opposite(scene, form)
    length = min(end / _SEGMENTS, _LONGEST[solver])
    # The fastest damping about a body axis, in the form's own time: slow time if it is averaged, where the
    # factor 1/St is part of the time.
    damping = max(scene.ellipsoid.damping)
    if not form.averaged:
        damping *= min(scene.torque_factor, _LARGEST_RATE)
    short = length
    if damping * length >= _LARGEST_EXPONENT:
        short = _SHORTENED * _LARGEST_EXPONENT / damping
    starts = np.arange(_SEGMENTS) * (end / _SEGMENTS)
    return [Segment(start, start + length, start + short) for start in starts.tolist()]


def certify(
    scene: Scene, form: Form, problem: Problem, states: dict[float, np.ndarray]
) -> Certificate:
    """Solve the segments of a reference's run again, forwards and backwards.

    `states` has the reference's states, shape (d,), by the times of `segments`. `problem` is what it solves.
    Raises ReferenceFailedError if a ratio, forwards or backwards, is above 1, or if too few segments can be
    tried.
    """
    opposite_form, solver = opposite(scene, form)
    observables = {time: observe(form, scene, state[None]) for time, state in states.items()}
    agreed = 0
    back = 0
    worst = 0.0
    for start, stop, turn in segments(scene, form, problem.end):
        length = stop - start
        if form.averaged:
            ratio = _same_form(scene, form, solver, states[start], observables[stop], length)
        else:
            # The flow as it is from `start` on. `_other_form` replaces the scene's start.
            later = scene.later(start, scene.start, length)
            ratio = _other_form(
                later, opposite_form, solver, observables[start], observables[stop], length
            )
        if ratio is not None:
            agreed += 1
            # `np.maximum` keeps a NaN, `max` may lose it.
            worst = np.maximum(worst, ratio)
        # At St = 0 the part to go back over has no length (`segments`).
        if scene.stokes > 0:
            worst = np.maximum(worst, _backward(scene, form, problem, states, start, turn))
            back += 1
        # This holds for NaN too, where a run ended beyond all numbers.
        if not worst <= 1:
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
    """Names of the form and of the solver, unrelated to Taylor's method, that solve segments again.

    The form is another one, with two exceptions. Averaged forms have no second form. At St = 0 `jeffery` is
    solved by its closed form, where it has one, and by itself where IDA is missing.
    """
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

    All four move the quaternion's components, by half an ulp of 1 each. The last three also move L_x, L_y
    and L_z, each by an ulp of itself.
    """
    rotation = observables.rotation[0].astype(float)
    ulp = np.finfo(float).eps * ulps
    momentum = observables.angular_momentum[0].astype(float) * (1 + ulp[1:])
    w1, w2, w3 = (rotation @ momentum / np.array(scene.ellipsoid.inertia)).tolist()
    q0, q1, q2, q3 = (quaternion_from_matrix(rotation) + 0.5 * ulp).tolist()
    return BodyStart((q0, q1, q2, q3), (w1, w2, w3))


def _other_form(
    scene: Scene,
    form_name: str,
    solver: str,
    before: Observables,
    after: Observables,
    length: float,
) -> float | None:
    """Ratio of a segment solved again in another form; None where it cannot be solved.

    `before` and `after` are the reference's observables at its start and end, one time each. Euler angles are
    tried about the three body axes in turn, until one agrees with the reference.
    """
    form = find_form(form_name)
    # Other forms have no pole: their axes keep their names.
    axes = _axes_off_the_pole(before) if form_name == "euler-angles" else [_THIRD_AXIS]
    ratios: list[float] = []
    for axis in axes:
        renamed = _renamed_scene(scene, axis, length)
        start_observables = _renamed(before, axis)
        problems = []
        try:
            for ulps in (np.zeros(4), *_SIGNS):
                start = restart(renamed, start_observables, ulps)
                problems.append(form.problem(replace(renamed, start=start)))
        except FormNotValidError:
            continue
        ratio = _tried(renamed, form, solver, problems, _renamed(after, axis))
        if ratio is not None:
            ratios.append(ratio)
            if ratio <= 1:
                break
    return min(ratios, default=None)


def _axes_off_the_pole(observables: Observables) -> list[int]:
    """Body axes at the first time, from the one farthest from the vorticity axis z to the nearest.

    Euler angles about a body axis are singular where it lies along z.
    """
    z_components = observables.rotation[0, :, 2].astype(float)
    return np.argsort(np.abs(z_components)).tolist()


def _renamed_scene(scene: Scene, axis: int, length: float) -> Scene:
    """A scene of a segment's length with the body axes renamed cyclically, so that `axis` is the third one."""
    x, y, z = np.roll(scene.ellipsoid.semi_axes, _THIRD_AXIS - axis).tolist()
    return replace(scene, ellipsoid=Ellipsoid((x, y, z)), time=length)


def _renamed(observables: Observables, axis: int) -> Observables:
    """Observables with the body axes renamed in this way: they are the rows of the rotation matrices."""
    rotation = np.roll(observables.rotation, _THIRD_AXIS - axis, axis=1)
    return replace(observables, rotation=rotation)


def _same_form(
    scene: Scene, form: Form, solver: str, before: np.ndarray, after: Observables, length: float
) -> float | None:
    """Ratio as of `_other_form` for an averaged form, from the reference's state `before`, shape (d,)."""
    state = before.astype(float)
    signs = _SIGNS[:, np.arange(len(state)) % _SIGNS.shape[1]]
    ulps = np.finfo(float).eps * signs
    problem = replace(form.problem(scene), end=length)
    problems = []
    for ulp in (np.zeros(len(state)), *ulps):
        start = tuple((state * (1 + ulp)).tolist())
        problems.append(replace(problem, start=start))
    return _tried(scene, form, solver, problems, after)


def _tried(
    scene: Scene, form: Form, solver: str, problems: list[Problem], after: Observables
) -> float | None:
    """Ratio of a segment solved at two tolerances, and from starts moved by an ulp; None if a run fails.

    The first of `problems` starts from the reference itself, the others from moved starts.
    """
    tight_tolerance, loose_tolerance = _TOLERANCES[solver]
    loose = solve(problems[0], solver, loose_tolerance)
    tight, *moved = (solve(problem, solver, tight_tolerance) for problem in problems)
    solutions = (loose, tight, *moved)
    if not all(solution.success for solution in solutions):
        return None
    accumulated = tight_tolerance + np.finfo(float).eps * (tight.work.steps or 0)
    loose_end, tight_end, *moved_ends = (
        form.observe(scene, solution.states[-1:]) for solution in solutions
    )
    return _compare(scene.ellipsoid, loose_end, tight_end, moved_ends, after, accumulated)


def _compare(
    ellipsoid: Ellipsoid,
    loose: Observables,
    tight: Observables,
    moved: list[Observables],
    reference: Observables,
    accumulated: float,
) -> float:
    """Ratio of difference to own error, of L and E or of the orientation, whichever is larger.

    All observables are of one time, the segment's end. The run `tight` is compared with the reference.
    `loose` has a looser tolerance, and the runs `moved` start elsewhere by an ulp. `accumulated` is what
    tolerance and steps add to the run's own error.
    """
    deviation = errors(ellipsoid, tight, reference)
    numerical_error = errors(ellipsoid, loose, tight)
    spread = [errors(ellipsoid, moved_run, tight) for moved_run in moved]
    rounding = (_ROUNDING + accumulated) * max(1.0, magnitude(ellipsoid, reference))
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
    start: float,
    turn: float,
) -> float:
    """Ratio of a run back from `turn` to `start`: its difference from the reference over an ulp's effect.

    The ulp is one at `turn`.
    """

    def returned_from(state: np.ndarray) -> Observables:
        """Observables at `start` of a run back from a state at `turn`."""
        way_back = np.array([turn, start])
        states_back = extended_run(replace(problem, start=tuple(state)), way_back, *ROUNDING_RUN)
        return observe(form, scene, states_back[-1][None])

    ulp = np.abs(states[turn].astype(float)) * np.finfo(float).eps
    returned = returned_from(states[turn])
    moved = returned_from(states[turn] + ulp)
    reference = observe(form, scene, states[start][None])
    # There is no looser run, and the method is the reference's own: an ulp alone makes the difference.
    return _compare(scene.ellipsoid, returned, returned, [moved], reference, accumulated=0.0)
