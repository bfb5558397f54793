"""Form `hybrid`: a run from its start to the settled state and beyond, by averaged and full segments.

The cost of a full segment grows like √St (`docs/second-order.md`, section 10, which says where a run costs
more).
"""

from dataclasses import replace

import numpy as np

from polhode.models.catalogue import form as find_form, full_form
from polhode.models.form import Form, Orientation
from polhode.models.hybrid.plan import HybridPlan
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import Scene

# Largest time of a run, in inverse shear rates. From 2^52 on doubles are whole numbers: parts of a turn, and
# so the ends of segments of a few turns, cannot be placed.
_LONGEST = 2.0**52


class Hybrid(Form):
    """State of the form of the full equations: `quaternion`, or `spheroid-axis` for spheroids.

    The run goes in segments (`polhode.models.hybrid.plan`). It is averaged to second order where that
    is good enough for the requested error. Else, and where St is too small for it altogether, it goes
    by the full equations.
    """

    name = "hybrid"
    summary = (
        "second-order averaging where it holds, full equations in the segments where it does not"
    )
    valid_for = (
        "spheroids and triaxial ellipsoids at finite St > 0, with an orientation; from rest too"
    )
    state = ("q0", "q1", "q2", "q3", "w1", "w2", "w3")
    orientation = "full"

    def check(self, scene: Scene) -> None:
        """Refuse other flows than shear, spheres, St = 0 and inf, starts without orientation, too long times."""
        # `require_slow_motion` asks for shear too. Here another flow is refused before a sphere is.
        self.require_flow(scene)
        if scene.ellipsoid.kind == "sphere":
            raise self.refuse(
                "a sphere has no symmetry axis, and L obeys a linear equation", full_form(scene)
            )
        self.require_slow_motion(scene, rest=True)
        self.require_orientation(scene)
        if scene.time > _LONGEST:
            long = f"the run of {scene.time:g} inverse shear rates is too long"
            raise self.refuse(f"{long}, expected at most {_LONGEST:.1e}", "")

    def problem(self, scene: Scene) -> Problem:
        """Initial value problem in time t: the full equations, run by a plan of segments."""
        self.check(scene)
        full = find_form(full_form(scene)).problem(scene)
        # `spheroid-axis` states parts. Without them solvers such as `splitting` refuse this problem.
        return replace(full, name=self.name, parts=None, next_segment=HybridPlan(scene, full))

    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        """Observables, as of the full equations."""
        return find_form(full_form(scene)).observe(scene, states)

    def orientation_of(self, scene: Scene) -> Orientation:
        """The complete orientation of a triaxial ellipsoid, the symmetry axis alone of a spheroid."""
        return find_form(full_form(scene)).orientation

    def state_of(self, scene: Scene) -> tuple[str, ...]:
        """Those of the form of the full equations."""
        return find_form(full_form(scene)).state
