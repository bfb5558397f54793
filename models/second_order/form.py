"""Form `averaged-second-order`: slow variables to O(1/St²) and orientation to O(1/St)."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import hypot

import numpy as np

from polhode.models.catalogue import form as find_form, full_form
from polhode.models.form import Form, FormNotValidError, Orientation
from polhode.models.forms.spheroid import Spheroid, axis_drift
from polhode.models.observables import Observables
from polhode.models.once import once
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.models.second_order import (
    field as triaxial,
    run as triaxial_run,
    spheroid as spheroidal,
)
from polhode.models.second_order.outline import Outline, outline

# Most passes by which the slow start x solves x = z - u(x)/St. Each pass gains a factor of the
# correction's size: these reach rounding where a pass gains a factor of 1.8 or more.
_START_PASSES = 60
# Passes diverge if a component becomes this many times the largest one of z. An estimate: components
# that grow at all soon exceed any such number.
_START_DIVERGED = 1e3
# Passes end when the next residual of that equation is expected to be at most this, over the larger one of |L|
# and 1, the length of p: rounding.
_START_CLOSE = 1e-15
# Shares of the time to the first segment of the full equations at which a run is tried to be stopped,
# the longest first. Estimates: smaller ones stop a run earlier than it need be, and are taken more often.
STOPS = (0.98, 0.9)
# Above this estimated error of L and E, over I_max, the expansion in 1/St means nothing: it exceeds L of a settled
# body. An estimate, strict for fast bodies.
_MEANINGLESS = 1.0


class SecondOrder(Form):
    """State (L, q, σ) of a spheroid in slow time.

    L is over I_e; q is the axis with its turn about L taken out; σ is the angle of that turn over St.
    A triaxial ellipsoid has the state of `polhode.models.second_order.field` instead, and its
    complete orientation; it is followed on one side of L² = 2EI₂ alone, down to rotation about a
    principal axis, and past resonances, whose kicks it misses and estimates. Caveat: the angle St σ
    carries St times the tolerance, and at best St times rounding, so that the orientation stops
    gaining accuracy near St = 1e8.
    """

    name = "averaged-second-order"
    summary = (
        "second-order averaging: L and E to O(1/St²), orientation to O(1/St), at a cost free of St"
    )
    valid_for = (
        "large finite St, L away from 0: spheroids; triaxial ellipsoids on one side of L² = 2EI₂"
    )
    state = ("Lx/Ie", "Ly/Ie", "Lz/Ie", "qx", "qy", "qz", "sigma")
    orientation = "axis"
    averaged = True

    def check(self, scene: Scene) -> None:
        """Refuse what second order does not follow.

        These are spheres, flows other than shear, and St that is 0, infinite or too small. So are starts without
        orientation or with L = 0, and runs that reach a time at which averaging fails.
        """
        self.require_flow(scene)
        if scene.ellipsoid.kind == "sphere":
            raise self.refuse(
                "a sphere has no symmetry axis, and L obeys a linear equation", full_form(scene)
            )
        self.require_slow_motion(scene)
        self.require_orientation(scene)
        prediction = outline(scene)
        for segment in prediction.segments:
            if not segment.second_order:
                when = (
                    f"averaging does not hold from t₂ = {segment.start:.2g}"
                    if segment.start > 0
                    else "the start"
                )
                raise self.refuse(f"{when}: {segment.reason}", full_form(scene))
        if scene.ellipsoid.kind == "triaxial":
            self._entry(scene)
        elif _started(scene) is None:
            raise self.refuse(
                f"St = {scene.stokes:g} is too small for the start's |L|", full_form(scene)
            )
        if not prediction.slow < _MEANINGLESS:
            raise self.refuse(f"St = {scene.stokes:g} is too small for this run", full_form(scene))

    def orientation_of(self, scene: Scene) -> Orientation:
        """The complete orientation of a triaxial ellipsoid, the axis alone of a spheroid."""
        return "full" if scene.ellipsoid.kind == "triaxial" else "axis"

    def state_of(self, scene: Scene) -> tuple[str, ...]:
        """Those of a spheroid, or of a triaxial ellipsoid."""
        return triaxial.STATE if scene.ellipsoid.kind == "triaxial" else self.state

    def problem(self, scene: Scene) -> Problem:
        """Initial value problem in slow time t₂ = t/St."""
        self.check(scene)
        if scene.ellipsoid.kind == "triaxial":
            run = self._entry(scene)
            # The invariant is the length of e₁, whose components are 4 to 6 of the state.
            return self.slow_problem(
                scene, triaxial.field, run.state, run.parameters, partial(axis_drift, first=4)
            )
        parameters = spheroidal.parameters(Spheroid.of(scene.ellipsoid), scene.torque_factor)
        return self.slow_problem(
            scene, spheroidal.field, (*(_started(scene) or ()), 0.0), parameters, axis_drift
        )

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        """Observables, the fast motion and the O(1/St) swing put back.

        Rotations of a spheroid hold the axis' row alone.
        """
        if scene.ellipsoid.kind == "triaxial":
            return self._entry(scene).observe(states)
        exact = spheroidal.exact(Spheroid.of(scene.ellipsoid), scene.torque_factor, states)
        return find_form(full_form(scene)).observe(scene, exact)

    def estimate(self, scene: Scene) -> Outline:
        """Largest model errors over the run, `slow` and `orientation`, as estimated.

        They come from the next terms of the expansion, the kicks of resonances left out, and the lag of the angles.
        """
        self.check(scene)
        return outline(scene)

    def reach(self, scene: Scene) -> float:
        """Slow time to which the form follows a scene: its end, or short of the first segment of the full equations."""
        try:
            self.check(scene)
        except FormNotValidError:
            self.require_slow_motion(scene)
            self.require_orientation(scene)
            first = outline(scene).segments[0]
            for share in STOPS if first.second_order and first.end < scene.slow_time else ():
                part = replace(scene, time=share * first.end * scene.stokes)
                if self.takes(part):
                    return part.slow_time
            raise
        return scene.slow_time

    def _entry(self, scene: Scene) -> triaxial_run.Entry:
        try:
            return triaxial_run.started(scene)
        except triaxial_run.NotAveragedError as error:
            raise self.refuse(str(error), full_form(scene)) from None


@once()
def _started(scene: Scene) -> tuple[float, ...] | None:
    """The slow start of a spheroid's scene; None if there is none."""
    exact = find_form(full_form(scene)).problem(scene).start
    return slow_start(Spheroid.of(scene.ellipsoid), scene.torque_factor, exact)


def slow_start(
    spheroid: Spheroid, torque_factor: float, exact: Sequence[float]
) -> tuple[float, ...] | None:
    """Slow L over I_e and p whose image under the transformation are the exact ones.

    None if none are found.
    """
    slow = exact
    # Residual before the first pass, taken as 1.
    left = 1.0
    size = max(1.0, hypot(*exact[:3]))
    for _ in range(_START_PASSES):
        image = spheroidal.swung(spheroid, torque_factor, slow[:3], slow[3:])
        residual = [moved - fixed for moved, fixed in zip(image, exact, strict=True)]
        slow = [component - change for component, change in zip(slow, residual, strict=True)]
        slow[3:] = spheroidal.unit(slow[3:])
        before = left
        left = max(map(abs, residual)) / size
        # The next pass gains the same factor as this one: its residual is forecast.
        if left * min(1, left / before) <= _START_CLOSE:
            return tuple(slow)
        # The passes diverge, or met numbers that are not finite.
        if not max(map(abs, slow)) < _START_DIVERGED * max(map(abs, exact)):
            return None
    return None
