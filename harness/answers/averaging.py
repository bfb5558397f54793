"""Errors of averaged runs: against a full run, or from an estimate of the theory.

First-order averaging errs like 1/St, and like 1/√St once a run crosses L² = 2EI₂. A surrogate, the
same slow motion at a smaller St, is followed by the full equations as well; its error is scaled to
the scene's own St by these powers, as measured over random bodies (`averaging_laws.py`), never by
larger ones. The kicks of resonances, which fall like 1/√St, are added. Second order, and the
segments of `hybrid`, state errors of their own, from the size of the terms left out.
"""

from dataclasses import replace
from math import pi, sqrt
from typing import Any

import numpy as np

from polhode.harness.answers.averaging_laws import ORDER_ONE, power
from polhode.harness.answers.rules import (
    EXPLICIT,
    Method,
    first_available,
    full_method,
    rotations,
    steps_of,
)
from polhode.harness.answers.runs import Run, Runner
from polhode.harness.answers.statement import INNER, Difference, difference
from polhode.harness.references.rotations import damping_times
from polhode.models.observables import Observables
from polhode.models.scene import BodyStart, Scene, SlowStart

# Rotations up to which an averaged run is compared with a full one.
_DIRECT_TURNS = 1_000.0
# Rotations of a surrogate.
_SURROGATE_TURNS = 500.0
# Tolerance of full runs that averaged ones are compared with.
_FULL_TOLERANCE = 1e-8
# Steps of such a run, at most.
_MAX_STEPS = 300_000
# Tolerance of an averaged run whose own error counts for nothing.
_EXACT_TOLERANCE = 1e-12
# Rotations in a damping time from which on there is something to average over.
_LEAST_TURNS = 0.3
# Steps of a full run from which on resonances are looked up.
_KICKS_FROM = 1e5
# Ratio of the tolerances of a second run in segments and the run: it has fewer and shorter full
# segments.
_LOOSER_SEGMENTS = 10.0


class NotKnownError(ValueError):
    """Nothing tells the error of averaging for a scene; the message says why."""


def compared(runner: Runner, run: Run) -> tuple[str, str, Difference, str]:
    """Kind of confirmation, family, difference and note of a run that averages."""
    form = run.method.form
    if run.solution.segments:
        second = _second_in_segments(runner, run)
        note = f"estimate of its segments, and {second.words}"
        return "estimate", "hybrid", with_estimate(runner, run, second), note
    turns = rotations(runner.scene)
    if turns <= _DIRECT_TURNS and not isinstance(runner.scene.start, SlowStart):
        method = full_method(runner.scene)
        second = runner.run(method, _FULL_TOLERANCE, _MAX_STEPS)
        if second.success:
            apart = difference(runner.scene.ellipsoid, run.observables, second.observables)
            return "unlike", "averaged", apart, f"unlike: {second.words}"
    usual = run.method
    if not run.method.solver.implicit:
        usual = Method(form, first_available(EXPLICIT))
    exact = runner.run(usual, min(run.tolerance, _EXACT_TOLERANCE), _MAX_STEPS)
    if not exact.success:
        raise NotKnownError(f"a second run ended with {exact.solution.status}")
    numerical_error = difference(runner.scene.ellipsoid, run.observables, exact.observables)
    if hasattr(form, "estimate"):
        said: Any = form.estimate(runner.scene)  # pyright: ignore[reportAttributeAccessIssue]
        apart = _raised(numerical_error, said.slow, said.orientation)
        return "estimate", "second order", apart, "estimate of second order"
    model, stokes = _surrogate_difference(runner, exact, turns)
    apart = Difference(numerical_error.slow + model, None)
    return "estimate", "first order", apart, f"estimate from St = {stokes:.2g}"


def with_estimate(runner: Runner, run: Run, second: Run) -> Difference:
    """Difference of two runs in segments, raised by what the first one's segments state."""
    apart = difference(runner.scene.ellipsoid, run.observables, second.observables)
    slow = np.zeros_like(apart.slow)
    angle = np.zeros_like(apart.slow)
    times = runner.inner
    for segment in run.solution.segments:
        later = times > segment.begin
        slow[later] += segment.error
        angle[later] += segment.angle
    return _raised(apart, slow, angle)


def _raised(apart: Difference, slow: Any, angle: Any) -> Difference:
    orientation = apart.orientation
    if orientation is not None:
        orientation = np.minimum(pi, orientation + angle)
    return Difference(apart.slow + slow, orientation)


def _second_in_segments(runner: Runner, run: Run) -> Run:
    """A second run in segments: by an unlike solver where the run's own is not the usual one, else looser."""
    usual = first_available(EXPLICIT)
    if run.method.solver.name == usual.name:
        method = run.method
        tolerance = min(1.0, _LOOSER_SEGMENTS * run.tolerance)
    else:
        method = Method(run.method.form, usual)
        tolerance = run.tolerance
    second = runner.run(method, tolerance, _MAX_STEPS + 4 * run.steps)
    if not second.success:
        raise NotKnownError(f"a second run ended with {second.solution.status}")
    return second


def _surrogate_difference(runner: Runner, exact: Run, turns: float) -> tuple[np.ndarray, float]:
    """The error of L and E of first-order averaging at the compared times, from a surrogate, and the latter's St."""
    scene = oriented(runner.scene)
    ratio = min(1.0, _SURROGATE_TURNS / max(turns, 1e-300))
    surrogate = replace(scene, stokes=scene.stokes * ratio, time=scene.time * ratio)
    if _LEAST_TURNS * damping_times(surrogate) > _SURROGATE_TURNS:
        raise NotKnownError("St is too small to average over rotations")
    small = Runner(surrogate, np.array([0.0, surrogate.time]))
    full = small.run(full_method(surrogate), _FULL_TOLERANCE, _MAX_STEPS)
    if not full.success:
        raise NotKnownError(f"the surrogate's run ended with {full.solution.status}")
    apart = difference(scene.ellipsoid, exact.observables, full.observables)
    crossing = crosses(scene, exact.observables)
    model = apart.slow * ratio ** power(ORDER_ONE, crossing)
    if not crossing:
        model = model + _kicks(scene)
    return model, surrogate.stokes


def _kicks(scene: Scene) -> np.ndarray | float:
    """Changes of L by resonances, over I_max, at the compared times of a triaxial run; first order leaves them out.

    The kicks of a run fall like 1/√St. Looking them up takes tables of the shape: where a full run
    takes less than that, first order's own error outweighs them.
    """
    if scene.ellipsoid.kind != "triaxial":
        return 0.0
    if steps_of(scene, full_method(scene), _FULL_TOLERANCE) < _KICKS_FROM:
        return 0.0
    from polhode.models.second_order.outline import outline

    square = np.zeros_like(INNER)
    for kick in outline(scene).kicks:
        square[scene.slow_time * INNER >= kick.time] += kick.size**2
    return np.sqrt(square)


def crosses(scene: Scene, observables: Observables) -> bool:
    """Whether a run crosses L² = 2EI₂."""
    if scene.ellipsoid.kind != "triaxial":
        return False
    middle = scene.ellipsoid.inertia[scene.ellipsoid.order[1]]
    excess = (observables.angular_momentum**2).sum(axis=1) - 2 * middle * observables.energy
    return bool(excess.min() < 0 < excess.max())


def oriented(scene: Scene) -> Scene:
    """The scene itself, or one of those that a start by L and E alone stands for: the middle axis across L."""
    if not isinstance(scene.start, SlowStart):
        return scene
    ellipsoid = scene.ellipsoid
    momentum = np.array(scene.start.angular_momentum)
    size = float(np.linalg.norm(momentum))
    if size == 0:
        raise NotKnownError("the start has L = 0 and no orientation")
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
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.align_vectors([momentum], [body])[0].as_quat().tolist()
    v1, v2, v3 = (size * body / np.array(ellipsoid.inertia)).tolist()
    return replace(scene, start=BodyStart((w, x, y, z), (v1, v2, v3)))
