"""Errors of averaged runs: against a full run, or from an estimate of the theory.

First-order averaging errs like 1/St, and like 1/√St once a run crosses L² = 2EI₂. A surrogate, the
same slow motion at a smaller St, is followed by the full equations as well; its error is scaled to
the scene's own St by these powers, as measured over random bodies (`averaging_laws.py`), never by
larger ones. The kicks of resonances, which fall like 1/√St, are added. Second order, and the
segments of `hybrid`, state errors of their own, from the size of the terms left out.

L is the angular momentum, E the energy, I₂ the middle moment of inertia. L² = 2EI₂ is the separatrix of
the motion without torque, between rotations about the longest and about the shortest axis.
docs/second-order.md derives second order; docs/references.md names the theory of crossings and jumps.
"""

from dataclasses import replace
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from polhode.harness.answers.averaging_laws import ORDER_ONE, power
from polhode.harness.answers.fitted import PACED_TOLERANCE
from polhode.harness.answers.rules import (
    EXPLICIT,
    SHARP,
    TABLED_FROM,
    Method,
    first_available,
    full_method,
    hybrid_family,
    is_efficient,
    rotations,
    steps_of,
)
from polhode.harness.answers.runs import MAX_STEPS, TIGHTER, Run, Runner
from polhode.harness.answers.statement import INNER, Difference, difference
from polhode.harness.references.rotations import damping_times
from polhode.models.libraries import IMPORTS
from polhode.models.observables import Observables
from polhode.models.scene import BodyStart, Scene, SlowStart
from polhode.models.shape import Ellipsoid

# Rotations of a full run that an averaged one is compared with, at most. An estimate that bounds the cost: with
# half of it a surrogate has half the St, and its error is scaled over twice the ratio.
COMPARED_TURNS = 1_000.0
# Rotations that a run without any counts as, so that a quotient stays finite.
_NO_TURNS = 1e-300


class NotKnownError(ValueError):
    """Nothing tells the error of averaging for a scene; the message says why."""


class Confirmation(NamedTuple):
    """The confirmation of a run that averages."""

    kind: str  # "estimate" or "unlike"
    family: str  # of methods, as `fitted.factors` has them
    difference: Difference
    note: str  # what it rests on


def compared(runner: Runner, run: Run) -> Confirmation:
    """The confirmation of a run that averages; raises NotKnownError if there is none.

    Confirmations are tried in this order: segments by what they estimate; a short run by a full one;
    second order by its own estimate; first order by a surrogate. The last two add what a second averaged
    run differs by, which is the error of the solver alone.
    """
    if run.solution.segments:
        return Confirmation("estimate", hybrid_family(runner.scene), *_of_segments(runner, run))
    form = run.method.form
    turns = rotations(runner.scene)
    ellipsoid = runner.scene.ellipsoid
    if turns <= COMPARED_TURNS and not isinstance(runner.scene.start, SlowStart):
        second = runner.run(full_method(runner.scene), SHARP, MAX_STEPS)
        if second.success:
            apart = difference(ellipsoid, run.observables, second.observables)
            return Confirmation("unlike", "averaged", apart, f"unlike: {second.words}")
    usual = run.method
    if not usual.solver.implicit:
        usual = Method(form, first_available(EXPLICIT))
    exact = _ended(runner.run(usual, min(run.tolerance, SHARP), MAX_STEPS), "a second run")
    numerical_error = difference(ellipsoid, run.observables, exact.observables)
    # Second order alone states an error of its own.
    if hasattr(form, "estimate"):
        said: Any = form.estimate(runner.scene)  # pyright: ignore[reportAttributeAccessIssue]
        apart = _raised(numerical_error, said.slow, said.orientation)
        return Confirmation("estimate", "second order", apart, "estimate of second order")
    model, stokes = _surrogate_difference(runner, exact, turns)
    apart = Difference(numerical_error.slow + model, None)
    return Confirmation("estimate", "first order", apart, f"estimate from St = {stokes:.2g}")


def _of_segments(runner: Runner, run: Run) -> tuple[Difference, str]:
    """The errors that the segments of a run estimate, raised by its difference from a second run, and a note.

    The second one, by the usual solver, is looser: its segments of the full equations are fewer and
    shorter. A run that averages all along by a solver that follows its tolerance has no other.
    """
    method = run.method
    if is_efficient(method.solver) and all(segment.averaged for segment in run.solution.segments):
        # The run differs from itself by nothing: the estimate alone is left.
        return with_estimate(runner, run, run), "estimate of its segments"
    usual = method._replace(solver=first_available(EXPLICIT))
    looser = min(1.0, run.tolerance / TIGHTER)
    second = _ended(runner.run(usual, looser, run.limit), "a second run")
    note = f"estimate of its segments, and {second.words}"
    return with_estimate(runner, run, second), note


def _ended(run: Run, name: str) -> Run:
    """The run; raises NotKnownError if it did not reach its end."""
    if not run.success:
        raise NotKnownError(f"{name} ended with {run.solution.status}")
    return run


def with_estimate(runner: Runner, run: Run, second: Run) -> Difference:
    """Difference of two runs in segments, raised by what the first one's segments state."""
    apart = difference(runner.scene.ellipsoid, run.observables, second.observables)
    slow = np.zeros_like(apart.slow)
    angle = np.zeros_like(apart.slow)
    times = runner.inner
    # A segment's error is in all that follows its beginning.
    for segment in run.solution.segments:
        later = times > segment.begin
        slow[later] += segment.error
        angle[later] += segment.angle
    return _raised(apart, slow, angle)


def _raised(apart: Difference, slow: Any, angle: Any) -> Difference:
    """A difference with errors of L and E (`slow`) and of the orientation (`angle`, in rad) added to it.

    The angle may exceed π: an estimate stays one, whatever a factor makes of it.
    """
    orientation = apart.orientation
    if orientation is not None:
        orientation = orientation + angle
    return Difference(apart.slow + slow, orientation)


def _surrogate_difference(runner: Runner, exact: Run, turns: float) -> tuple[np.ndarray, float]:
    """The error of L and E of first-order averaging at the compared times, from a surrogate, and the latter's St."""
    scene = oriented(runner.scene)
    # The surrogate has St and time smaller by the same ratio: its slow time is the same, its rotations are
    # `COMPARED_TURNS`. Its averaged motion is the one of `exact`, since it depends on the slow time alone.
    ratio = min(1.0, COMPARED_TURNS / max(turns, _NO_TURNS))
    surrogate = replace(scene, stokes=scene.stokes * ratio, time=scene.time * ratio)
    # With more damping times than rotations the torque changes much within a rotation.
    if damping_times(surrogate) > COMPARED_TURNS:
        raise NotKnownError("St is too small to average over rotations")
    small = Runner(surrogate, np.array([0.0, surrogate.time]))
    full = _ended(small.run(full_method(surrogate), SHARP, MAX_STEPS), "the surrogate's run")
    apart = difference(scene.ellipsoid, exact.observables, full.observables)
    kicks = None if crosses(scene, exact.observables) else _kicks(scene)
    if kicks is None:
        # The surrogate's error may be a crossing's or a kick: both fall like 1/√St.
        return apart.slow * ratio ** power(ORDER_ONE, crosses=True), surrogate.stokes
    return apart.slow * ratio ** power(ORDER_ONE) + kicks, surrogate.stokes


def _kicks(scene: Scene) -> np.ndarray | float | None:
    """Changes of L by resonances, over I_max, at the compared times of a triaxial run; first order leaves them out.

    They fall like 1/√St. None if a run is too short for the tables that tell them.
    """
    if scene.ellipsoid.kind != "triaxial":
        return 0.0
    if steps_of(scene, full_method(scene), PACED_TOLERANCE) < TABLED_FROM:
        return None
    from polhode.models.second_order.outline import outline

    # A body has passed each kick that lies before a time; kicks of independent phases add up in squares.
    square = np.zeros_like(INNER)
    for kick in outline(scene).kicks:
        square[scene.slow_time * INNER >= kick.time] += kick.size**2
    return np.sqrt(square)


def above_separatrix(ellipsoid: Ellipsoid, observables: Observables) -> np.ndarray:
    """L² - 2EI₂ of each sample, shape (n,), I₂ the middle moment of inertia of a triaxial body."""
    middle = ellipsoid.inertia[ellipsoid.order[1]]
    return (observables.angular_momentum**2).sum(axis=1) - 2 * middle * observables.energy


def crosses(scene: Scene, observables: Observables) -> bool:
    """Whether a run crosses L² = 2EI₂."""
    if scene.ellipsoid.kind != "triaxial":
        return False
    excess = above_separatrix(scene.ellipsoid, observables)
    return bool(excess.min() < 0 < excess.max())


def oriented(scene: Scene) -> Scene:
    """The scene itself, or one of those that a start by L and E alone stands for: the middle axis across L.

    Raises NotKnownError for a start with L = 0 and no orientation.
    """
    if not isinstance(scene.start, SlowStart):
        return scene
    ellipsoid = scene.ellipsoid
    momentum = np.array(scene.start.angular_momentum)
    size = float(np.linalg.norm(momentum))
    if size == 0:
        raise NotKnownError("the start has L = 0 and no orientation")
    # In body axes L lies in the plane of the longest axis (least inertia) and the shortest one (largest).
    # The share s of L² along the longest gives 2E/L² = s/I_min + (1 - s)/I_max; s is solved for.
    first, _, last = ellipsoid.order
    low = ellipsoid.inertia[first]
    high = ellipsoid.inertia[last]
    share = 1.0
    if low < high:
        share = (2 * scene.start.energy / size**2 - 1 / high) / (1 / low - 1 / high)
        share = min(1.0, max(0.0, share))
    body = np.zeros(3)
    body[first] = sqrt(share)
    body[last] = sqrt(1 - share)
    with IMPORTS:
        from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.align_vectors([momentum], [body])[0].as_quat().tolist()
    v1, v2, v3 = (size * body / np.array(ellipsoid.inertia)).tolist()
    return replace(scene, start=BodyStart((w, x, y, z), (v1, v2, v3)))
